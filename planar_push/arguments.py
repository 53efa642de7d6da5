"""Arguments that several commands share, with their checks."""

import argparse
import ast
import math
import signal
import sys
import textwrap
import time
from collections.abc import Callable, Iterable
from pathlib import Path

from push_bringup.job_result import JobEvent
from push_bringup.systems import SYSTEMS, system_names, system_of
from push_model.settings import SettingsError


def describe(parser: argparse.ArgumentParser, folder: Path, known: Iterable[str]) -> None:
    """List modules of a folder below the help, with the first paragraphs of their docstrings. Names
    have dashes. No module is imported."""
    lines = ["NAME:"]
    for name in known:
        source = (folder / f"{name.replace('-', '_')}.py").read_text()
        words = (ast.get_docstring(ast.parse(source)) or "").split("\n\n")[0]
        filled = textwrap.fill(
            words,
            96,
            initial_indent=" " * 24,
            subsequent_indent=" " * 24,
            break_on_hyphens=False,
        )
        lines.append(f"  {name:21s} {filled.lstrip()}")
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = "\n".join(lines)


def add_scenario(parser: argparse.ArgumentParser, default: str | None = "env1-target1") -> None:
    """``--scenario``; without a default it is received from the bridge."""
    silent = "" if default else "; what the running bridge publishes when it is not given"
    parser.add_argument(
        "--scenario",
        default=default or "",
        help=f"a name in config/scenarios, or a file{silent}",
    )


def add_system_and_scenario(parser: argparse.ArgumentParser) -> None:
    """The system and ``--scenario``; ``scenario_of`` resolves the latter."""
    parser.add_argument(
        "system",
        nargs="?",
        default="single",
        help=f"one of {', '.join(system_names())}, or MODULE:ATTRIBUTE of a method",
    )
    known = ", ".join(f"{system.example} for {name}" for name, system in SYSTEMS.items())
    parser.add_argument(
        "--scenario", default="", help=f"a name in config/scenarios, or a file; {known}"
    )


def scenario_of(arguments: argparse.Namespace) -> str:
    """Name or path of the requested scenario."""
    return str(arguments.scenario or system_of(arguments.system).example)


def add_namespace(parser: argparse.ArgumentParser) -> None:
    """``--namespace``."""
    parser.add_argument(
        "--namespace", default="", help="namespace of the whole suite, e.g. a or lab/a"
    )


def add_factor(parser: argparse.ArgumentParser) -> None:
    """``--factor``."""
    parser.add_argument(
        "--factor",
        type=positive,
        default=None,
        help="pace of the simulation, simulated over wall time; default: the scenario's",
    )


def add_timeout(
    parser: argparse.ArgumentParser, default: float, words: str = "[s] wall time to wait"
) -> None:
    """``--timeout``."""
    parser.add_argument("--timeout", type=positive, default=default, help=words)


def add_no_wait(parser: argparse.ArgumentParser, words: str) -> None:
    """``--no-wait`` and ``--timeout``; ``time_to_wait`` resolves them."""
    parser.add_argument("--no-wait", action="store_true", help=words)
    parser.add_argument("--timeout", type=positive, default=None, help="[s] wall time to wait")


def time_to_wait(arguments: argparse.Namespace, default: float) -> float:
    """[s] to follow a job; 0 for ``--no-wait``. Raises SettingsError if both options are given."""
    if not arguments.no_wait:
        return float(default if arguments.timeout is None else arguments.timeout)
    if arguments.timeout is not None:
        raise SettingsError(
            "--timeout: with --no-wait, the job is not followed; give only one of the two options"
        )
    return 0.0


def add_study(parser: argparse.ArgumentParser) -> None:
    """``--seed``, ``--out``, ``--scheduler``, ``--workers``: where and how trials run."""
    parser.add_argument("--seed", type=whole(0), default=1, help="seed of the first trial")
    parser.add_argument(
        "--out", default="", help="output folder; an interrupted study in it is continued"
    )
    parser.add_argument("--scheduler", default="", help="address of a Dask scheduler")
    parser.add_argument(
        "--workers", type=whole(0), default=0, help="local processes; 0: one per core"
    )


def study_folder(arguments: argparse.Namespace, name: str) -> Path:
    """The folder of a study: the one that was asked for, or a new one."""
    return Path(arguments.out or f"results/{name}-{time.strftime('%Y%m%d-%H%M%S')}")


def names(text: str) -> tuple[str, ...]:
    """Of a list with commas between them."""
    return tuple(name.strip() for name in text.split(",") if name.strip())


def positive(text: str) -> float:
    """A positive, finite number."""
    value = finite(text)
    if value <= 0.0:
        raise argparse.ArgumentTypeError(f"expected a positive number, got {text}")
    return value


def finite(text: str) -> float:
    """A finite number."""
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"expected a number, got '{text}'") from None
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"expected a finite number, got '{text}'")
    return value


def whole(least: int, most: int | None = None) -> Callable[[str], int]:
    """A whole number from ``least`` on, up to ``most`` where that is given."""

    def parse(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f"expected a whole number, got '{text}'") from None
        if value < least:
            raise argparse.ArgumentTypeError(f"expected at least {least}, got {value}")
        if most is not None and value > most:
            raise argparse.ArgumentTypeError(f"expected at most {most}, got {value}")
        return value

    return parse


def add_port(parser: argparse.ArgumentParser) -> None:
    """``--port`` of a page."""
    parser.add_argument(
        "--port", type=whole(0, 65535), default=8080, help="port; 0 chooses a free one"
    )


_asked: list[int] = []  # signals that arrived before anything could be stopped


def hear_signals() -> None:
    """Let SIGINT and SIGTERM interrupt the program from the first moment on, and remember them.

    Python drops an interrupt that falls into a finaliser or a callback. A start-up that went on
    after that would never be interrupted.
    """

    def handler(number: int, frame: object) -> None:
        _asked.append(number)
        interrupts = getattr(sys.modules.get("push_ros.process"), "INTERRUPTS", None)
        if interrupts is None:  # nothing spins yet
            raise KeyboardInterrupt
        interrupts.interrupt()

    signal.signal(signal.SIGINT, handler)
    signal.signal(signal.SIGTERM, handler)


def stop_on_signals(request_stop: Callable[[], None]) -> None:
    """Let SIGINT and SIGTERM call a function; it is called at once if one has arrived already."""

    def handler(number: int, frame: object) -> None:
        request_stop()

    signal.signal(signal.SIGINT, handler)
    signal.signal(signal.SIGTERM, handler)
    if _asked:
        request_stop()


def tell(event: JobEvent) -> None:
    """Print the progress of a job."""
    team = f"{event.team}: " if event.team else ""
    if event.kind == "state":
        print(f"  {team}{event.state:12s} {event.reason}", flush=True)
    elif event.kind in ("silent", "returned"):
        print(f"  {team}{event.reason}", flush=True)
    elif event.distance is not None:
        print(f"  {team}{event.distance:6.3f} m to go", flush=True)
