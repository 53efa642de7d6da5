"""Say why nothing moves: looks at the graph, at motion capture and at the robots."""

import argparse
import os
import time
from collections.abc import Iterator
from contextlib import nullcontext
from typing import TYPE_CHECKING, Any

from planar_push.arguments import add_namespace, add_scenario, positive
from push_bringup.systems import check_namespace
from push_model.settings import SettingsError

if TYPE_CHECKING:
    from lab_bridge.findings import Finding
    from lab_bridge.observation import Observer
    from push_scenario.scenario import Scenario

PARTS = ("all", "mocap", "robots")
_DISCOVERY = 1.2  # [s] wall time for other programs to be discovered
_GRAPH = 3.2  # [s] wall time until all of them must have said how they are; nodes do once a second


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of this verb."""
    parser.add_argument(
        "part",
        nargs="?",
        choices=PARTS,
        default="all",
        help="mocap: motion capture only; robots: robots only; default: everything",
    )
    add_scenario(parser, None)
    add_namespace(parser)
    parser.add_argument(
        "--drive",
        action="store_true",
        help="move each robot by 3 cm and by 23 degrees and back, and compare; needs free floor, "
        "and no suite that runs",
    )
    parser.add_argument(
        "--seconds", type=positive, default=3.0, help="[s] to listen to motion capture at most"
    )


def run(arguments: argparse.Namespace) -> int:
    """0 if no error is found; 1 if one is. Each finding is printed as soon as it is known."""
    from lab_bridge.findings import Weight

    check_namespace(arguments.namespace)
    errors = 0
    for finding in examine(arguments):
        errors += finding.weight is Weight.ERROR
        print(finding, flush=True)
    print(f"{errors} errors" if errors != 1 else "1 error")
    return 1 if errors else 0


def examine(arguments: argparse.Namespace) -> "Iterator[Finding]":
    """Everything that is found, as soon as it is.

    Raises
    ------
    SettingsError: the scenario is wrong, or not for a lab.
    """
    from lab_bridge.findings import error
    from lab_bridge.observation import Observer
    from push_ros.claims import OCCUPIED, claim_world
    from push_ros.latched import visitor
    from push_ros.names import space

    # Robots are driven here as by a bridge: none may be started meanwhile.
    domain, here = os.environ.get("ROS_DOMAIN_ID") or "0", space(arguments.namespace)
    claim = claim_world(domain, here) if arguments.drive else nullcontext()
    if claim is None:
        raise SettingsError(OCCUPIED)
    with claim, visitor() as (node, spinner):
        found, scenario, runs = _graph(arguments, node, spinner)
        yield from found
        if scenario is None:
            text = "no scenario is published, and none is given by --scenario"
            yield error("NO_SCENARIO", text, "give the scenario of the lab by --scenario")
            return
        if scenario.lab is None or scenario.on != "lab":
            if arguments.part != "all":
                raise SettingsError(f"scenario '{scenario.name}' is not for a lab ('on: lab')")
            return
        observer = Observer(node, spinner, scenario)
        try:
            yield from _lab(arguments, observer, runs)
        finally:
            observer.close()


def _graph(
    arguments: argparse.Namespace, node: Any, spinner: Any
) -> "tuple[list[Finding], Scenario | None, dict[str, str] | None]":
    """Findings about the graph, the scenario, and what a running lab bridge says of its robots."""
    from diagnostic_msgs.msg import DiagnosticArray
    from std_msgs.msg import Bool, String

    from lab_bridge.findings import error, fact, warning
    from push_ros.latched import publishers
    from push_ros.names import space
    from push_ros.qos import LATCHED, STATUS
    from push_scenario.scenario import load_scenario, scenario_from_text

    here = space(arguments.namespace)
    domain = os.environ.get("ROS_DOMAIN_ID") or "0"
    discovery = os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
    states: dict[str, Any] = {}
    texts: list[str] = []
    paused: list[bool] = []

    def on_states(message: DiagnosticArray) -> None:
        states.update({status.name: status for status in message.status})

    node.create_subscription(DiagnosticArray, f"{here}diagnostics", on_states, STATUS)
    node.create_subscription(String, f"{here}scenario", lambda m: texts.append(m.data), LATCHED)
    node.create_subscription(Bool, f"{here}paused", lambda m: paused.append(m.data), LATCHED)
    earliest = time.monotonic() + _DISCOVERY

    def complete() -> bool:
        """Whether everybody who was discovered has been heard."""
        infos = node.get_publishers_info_by_topic(f"{here}diagnostics")
        nodes = {f"{i.node_namespace}/{i.node_name}".strip("/") for i in infos}
        return (
            time.monotonic() > earliest
            and nodes <= states.keys()
            and (bool(paused) or not publishers(node, f"{here}paused"))
            and (bool(texts) or not publishers(node, f"{here}scenario"))
        )

    spinner.until(complete, _GRAPH)
    found = [fact("DOMAIN", f"ROS_DOMAIN_ID {domain}, discovery {discovery}")]
    sources = publishers(node, f"{here}poses", "push_msgs/msg/Poses")
    if sources > 1:
        text = f"{sources} bridges publish on {here}poses"
        found.append(error("TWO_BRIDGES", text, "stop one, or give it another --namespace"))
    elif not states and arguments.part == "all" and not arguments.drive:  # it needs the robots
        text = f"no node of a suite is in namespace {here}"
        found.append(warning("NO_SUITE", text, "planar-push launch starts one"))
    if paused and paused[-1]:
        found.append(
            warning(
                "PAUSED", "the suite is paused", "call /bridge/pause with data: false, or see below"
            )
        )
    runs: dict[str, str] | None = {} if sources else None
    for name, status in states.items():
        values = {v.key: v.value for v in status.values}
        robots = {k: v for k, v in values.items() if k.startswith("robot ")}
        if robots:
            runs = (runs or {}) | {k.removeprefix("robot "): v for k, v in robots.items()}
        level = status.level if isinstance(status.level, int) else status.level[0]
        if level > 0 and arguments.part == "all":
            found.append(warning("NODE", f"{name}: {status.message}", ""))
    if arguments.scenario:
        return found, load_scenario(arguments.scenario), runs
    text = texts[-1] if texts else ""
    return found, scenario_from_text(text, "scenario", "/scenario") if text else None, runs


def _lab(
    arguments: argparse.Namespace, observer: "Observer", runs: dict[str, str] | None
) -> "Iterator[Finding]":
    """runs: what a running bridge says of its robots; None where there is none."""
    import numpy as np

    from lab_bridge.capture_diagnosis import Room, diagnose_capture
    from lab_bridge.findings import Weight, warning
    from lab_bridge.robot_diagnosis import RobotFacts, diagnose_robots

    if runs is not None and arguments.drive:
        raise SettingsError("a suite is running; stop it before robots are driven")
    if runs is None and arguments.part != "mocap":  # a robot has one client
        observer.connect()
    observer.watch(arguments.seconds)
    grid = observer.scenario.grid
    rows, columns = grid.occupied.shape
    low = np.array(grid.origin, dtype=np.float64)
    room = Room(low, low + grid.resolution * np.array([columns, rows]))
    seen = diagnose_capture(observer.capture_facts(), observer.lab, observer.bodies, room)
    wrong = any(f.weight is Weight.ERROR for f in seen)
    if arguments.part != "robots":
        yield from seen
    if arguments.part == "mocap":
        return
    if runs == {}:
        text = "a bridge publishes poses, but does not say how its robots are"
        yield warning("BRIDGE_SILENT", text, "it may be frozen, or no lab bridge: start it again")
        return
    if runs is not None:
        troubles = {r: "" if v == "connected" else v for r, v in runs.items()}
        yield from diagnose_robots(RobotFacts(troubles))
        return
    troubles = observer.link_troubles()
    shown = None if wrong else frozenset(r for r in troubles if observer.pose(r) is not None)
    if arguments.drive and wrong:
        text = "no robot is driven, because there are errors of motion capture"
        yield warning("NOT_DRIVEN", text, "mend them first: planar-push doctor mocap shows them")
    for robot, trouble in troubles.items():
        tests = {}
        if arguments.drive and not trouble and shown is not None and robot in shown:
            tests[robot] = observer.drive_test(robot)
            trouble = observer.robots[robot].trouble  # it may have been lost meanwhile
        yield from diagnose_robots(RobotFacts({robot: trouble}, tests, shown))
