"""The command line ``planar-push``. Each command is a file of this package with its options and its
action; this file is the grammar."""

import argparse
import importlib
import os
import pkgutil
import sys
from collections.abc import Sequence
from pathlib import Path

from planar_push.arguments import hear_signals
from push_bringup.failures import DomainInUse, SuiteFailed
from push_model.settings import SettingsError
from push_ros.claims import DOMAINS, runs_in_lockstep
from push_ros.process import prepare_environment

NOT_VERBS = ("main", "arguments", "entry", "__main__")


def verbs() -> list[str]:
    """Names of the modules that are commands: each has ``add_arguments`` and ``run``."""
    found = (m.name for m in pkgutil.iter_modules([str(Path(__file__).parent)]))
    return sorted(name for name in found if name not in NOT_VERBS)


def parser() -> argparse.ArgumentParser:
    """The command line's grammar."""
    top = argparse.ArgumentParser(
        prog="planar-push", description="Make mobile robots move objects by pushing them."
    )
    commands = top.add_subparsers(required=True, metavar="COMMAND")
    for name in verbs():
        verb = importlib.import_module(f"planar_push.{name}")
        text = (verb.__doc__ or "").split("\n")[0].rstrip(".")
        text = text[:1].lower() + text[1:]
        command = commands.add_parser(name.replace("_", "-"), help=text, description=verb.__doc__)
        command.set_defaults(run=verb.run)
        verb.add_arguments(command)
    return top


def main(words: Sequence[str] | None = None) -> int:
    """Run a command line; returns the exit code: 2 for what was wrong before anything started."""
    prepare_environment()
    arguments = parser().parse_args(words)
    try:
        if hasattr(arguments, "namespace"):
            _keep_out_of_studies()
        return int(arguments.run(arguments))
    except (SettingsError, FileExistsError, FileNotFoundError, DomainInUse) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except SuiteFailed as error:
        print(f"error: {error}", file=sys.stderr)
        return 1


def _keep_out_of_studies() -> None:
    """Raise DomainInUse where a command for a suite would reach a run in lockstep of another
    process."""
    domain = os.environ.get("ROS_DOMAIN_ID") or "0"
    if runs_in_lockstep(domain):
        first, last = DOMAINS
        raise DomainInUse(
            f"another process uses ROS domain {domain} now, for a study or another run in lockstep "
            f"(these use the domains {first} to {last} in turn); set ROS_DOMAIN_ID to 0, or to "
            f"{last + 1}"
        )


def command() -> None:
    """Entry point of the process. It exits immediately. Tearing down all modules would take
    a second or more, in which a signal would seem to be ignored."""
    hear_signals()
    try:
        code = main()
    except KeyboardInterrupt:
        code = 130
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


if __name__ == "__main__":
    command()
