"""Start a system, one process a node, until Ctrl-C."""

import argparse
import tempfile
from pathlib import Path

from planar_push.words import (
    add_factor,
    add_namespace,
    add_scenario,
    add_system,
    stop_on_signals,
)


def add_words(parser: argparse.ArgumentParser) -> None:
    """The words of this verb."""
    add_system(parser)
    add_scenario(parser)
    parser.add_argument("--record", default="", help="bag folder")
    parser.add_argument("--respawn", action="store_true", help="start a node that died again")
    add_factor(parser)
    add_namespace(parser)


def run(arguments: argparse.Namespace) -> int:
    """Check everything, then start."""
    from push_bringup.launcher import Launcher
    from push_bringup.preparation import check_domain, prepare
    from push_bringup.systems import teams_of

    setup = prepare(
        arguments.scenario,
        system=arguments.system,
        namespace=arguments.namespace,
        record=arguments.record,
        factor=arguments.factor,
    )
    check_domain(setup.namespace)
    with tempfile.TemporaryDirectory("-planar-push") as folder:
        launcher = Launcher(setup.write(Path(folder)), respawn=arguments.respawn)
        stop_on_signals(launcher.request_stop)
        launcher.start()
        words = f" --namespace {arguments.namespace}" if arguments.namespace else ""
        team = teams_of(setup.scenario)[0].name
        words += f" --team {team}" if team else ""
        print(
            f"running {arguments.scenario}; send a goal with: planar-push goal X Y THETA{words}",
            flush=True,
        )
        return launcher.run()
