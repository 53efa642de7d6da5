"""Start a system, one process per node, until Ctrl-C."""

import argparse
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from planar_push.arguments import (
    add_factor,
    add_namespace,
    add_system_and_scenario,
    scenario_of,
    stop_on_signals,
)

if TYPE_CHECKING:
    from push_bringup.preparation import SuiteSetup


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of this verb."""
    add_system_and_scenario(parser)
    parser.add_argument("--record", default="", help="folder of the bag to record")
    parser.add_argument("--view", action="store_true", help="serve the page too, on a free port")
    parser.add_argument("--respawn", action="store_true", help="restart nodes that die")
    parser.add_argument(
        "--estimate",
        action="store_true",
        help="estimate while robots push: contact friction, centre of mass and latency with one "
        "robot, the outline of the object with several",
    )
    add_factor(parser)
    add_namespace(parser)


def run(arguments: argparse.Namespace) -> int:
    """Check everything, then start."""
    from push_bringup.launcher import Child, Launcher
    from push_bringup.preparation import check_domain, prepare
    from push_bringup.systems import estimated
    from push_scenario.scenario import load_scenario

    scenario = load_scenario(scenario_of(arguments))
    setup = prepare(
        estimated(arguments.system, scenario) if arguments.estimate else scenario,
        system=arguments.system,
        namespace=arguments.namespace,
        record=arguments.record,
        factor=arguments.factor,
    )
    check_domain(setup.namespace)
    with tempfile.TemporaryDirectory("-planar-push") as folder:
        children = setup.write(Path(folder))
        if arguments.view:
            words = ["view", "--port", "0"]
            words += ["--namespace", setup.namespace] if setup.namespace else []
            children.append(Child("viewer", "planar_push", words))
        launcher = Launcher(children, respawn=arguments.respawn)
        stop_on_signals(launcher.request_stop)
        launcher.start()
        print(f"running {setup.scenario.name}; {_what_next(setup)}", flush=True)
        return launcher.run()


def _what_next(setup: "SuiteSetup") -> str:
    """What to do next, for the terminal."""
    from push_bringup.systems import teams_of

    if not any(node.traits.owner for node in setup.nodes):
        spaces = [n.namespace for n in setup.nodes if n.kind == "torque_controller"]
        return "send trajectories to: " + ", ".join(f"{s}/follow_trajectory" for s in spaces)
    words = f" --namespace {setup.namespace}" if setup.namespace else ""
    if any(node.kind == "rearranger" for node in setup.nodes):
        return f"bring all objects to their places with: planar-push rearrange{words}"
    team, *_ = teams_of(setup.scenario)
    if team.trajectory and any(node.kind == "group" for node in setup.nodes):
        script = "python examples/push_along_a_trajectory.py"
        given = [team.name or "''", setup.namespace] if setup.namespace else [team.name]
        return " ".join(["send the trajectory with:", script, *given]).rstrip()
    words += f" --team {team.name}" if team.name else ""
    return f"send a goal with: planar-push goal X Y THETA{words}"
