"""The command line: planar-push."""

import argparse
import shutil
import signal
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from push_model.settings import SettingsError
from push_ros.process import prepare_environment

_LIVE_DEADLINE = 0.03  # [s] wall time of a solve in live use; a lockstep run must not depend on it


def _warm_up(arguments: argparse.Namespace) -> int:
    """Compile what is compiled at first use, so that no run waits for it."""
    import numpy as np

    from push_mpc import LtvMpc, MpcSettings, TrackerSettings, TrajectoryTracker
    from push_planner import PlannerSettings, PushPlanner
    from push_scenario.scenario import load_scenario

    print("compiling the numerical kernels")
    scenario = load_scenario("env1-target1")
    _, robot = scenario.robot()
    _, item = scenario.object()
    TrajectoryTracker(TrackerSettings(), LtvMpc(MpcSettings(), robot.differential)).warm_up()
    start = next(iter(scenario.objects.values()))[1]
    goal = scenario.goal if scenario.goal is not None else np.zeros(3)
    PushPlanner(PlannerSettings(), scenario.grid, robot, item).solve(start, goal)
    return 0


def _node(arguments: argparse.Namespace) -> int:
    """Run one node in this process."""
    from push_ros.process import run_node
    from push_scenario.scenario import Scenario, load_scenario

    try:
        scenario: Scenario = load_scenario(arguments.scenario)
    except SettingsError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2

    def make() -> object:
        if arguments.name == "bridge":
            from sim_bridge.node import BridgeNode

            return BridgeNode(scenario)
        if arguments.name == "planner":
            from push_planner.node import PlannerNode

            return PlannerNode(scenario)
        if arguments.name == "controller":
            from push_mpc.node import ControllerNode

            live = {"tracker__deadline": _LIVE_DEADLINE}
            given = scenario.parameters.get("controller", {}).get("tracker", {})
            return ControllerNode(
                scenario if "deadline" in given else scenario.settings("controller", **live),
                scenario.robot()[0],
            )
        if arguments.name == "supervisor":
            from push_supervisor.node import SupervisorNode

            return SupervisorNode(scenario)
        from push_record.recorder import RecorderNode

        seed = int(scenario.parameters.get("bridge", {}).get("seed", 1))
        return RecorderNode(Path(arguments.out), scenario, seed)

    words = ["--ros-args", *arguments.ros] if arguments.ros else None
    return run_node(make, words)  # type: ignore[arg-type]


def _stop_on_signals(request_stop: Callable[[], None]) -> None:
    def handler(number: int, frame: object) -> None:
        request_stop()

    signal.signal(signal.SIGINT, handler)
    signal.signal(signal.SIGTERM, handler)


def _launch(arguments: argparse.Namespace) -> int:
    from push_bringup.launcher import Launcher, single_robot

    if arguments.system != "single":
        print(f"error: the system '{arguments.system}' is not built yet", file=sys.stderr)
        return 2
    extra = {"bridge": ["--ros", "-p", f"real_time_factor:={arguments.factor}"]}
    children = single_robot(arguments.scenario, arguments.record, extra)
    launcher = Launcher(children, respawn=arguments.respawn)
    _stop_on_signals(launcher.request_stop)
    launcher.start()
    print(f"running {arguments.scenario}; send a goal with: planar-push goal X Y THETA", flush=True)
    return launcher.run()


def _goal(arguments: argparse.Namespace) -> int:
    from push_bringup.monitor import Monitor

    with Monitor() as monitor:
        if not monitor.connect(10.0):
            print(
                "error: no supervisor is running; start one with: planar-push launch single",
                file=sys.stderr,
            )
            return 1
        monitor.send_goal((arguments.x, arguments.y, arguments.theta))
        if arguments.no_wait:
            return 0
        return monitor.follow(arguments.timeout, lambda: monitor.supervised)


def _demo(arguments: argparse.Namespace) -> int:
    from push_bringup.launcher import Launcher, single_robot
    from push_bringup.monitor import Monitor
    from push_scenario.scenario import load_scenario
    from push_view.report import PRODUCTS, write_report

    scenario = load_scenario(arguments.scenario)
    if scenario.goal is None:
        print(f"error: scenario '{scenario.name}' has no goal", file=sys.stderr)
        return 2
    out = Path(arguments.out)
    out.mkdir(parents=True, exist_ok=True)
    for name in PRODUCTS:
        (out / name).unlink(missing_ok=True)
    if (out / "bag").exists():
        shutil.rmtree(out / "bag")
    extra = {
        "bridge": ["--ros", "-p", f"real_time_factor:={arguments.factor}"],
        "supervisor": ["--ros", "--log-level", "supervisor:=warn"],  # the monitor shows its states
    }
    children = single_robot(arguments.scenario, str(out / "bag"), extra)
    launcher = Launcher(children)
    stopped = False

    def stop() -> None:
        nonlocal stopped
        stopped = True
        launcher.request_stop()

    _stop_on_signals(stop)
    code = 1
    try:
        launcher.start()
        with Monitor() as monitor:
            if monitor.connect(60.0, lambda: not stopped and not launcher.check()):
                goal = tuple(float(v) for v in scenario.goal)
                print(f"goal: {goal} on /goal_pose", flush=True)
                monitor.send_goal(goal)  # type: ignore[arg-type]
                code = monitor.follow(
                    arguments.timeout, lambda: not stopped and not launcher.check()
                )
            elif not stopped:
                print("error: the nodes did not come up", file=sys.stderr)
    finally:
        launcher.stop()
    if stopped:
        return 130
    if not any((out / "bag").glob("*.mcap")):
        return 1  # nothing was recorded; why has been said
    for number in (signal.SIGINT, signal.SIGTERM):  # nothing is left to stop: just end
        signal.signal(number, lambda *_: sys.exit(130))
    print("writing the report", flush=True)
    errors = write_report(out / "bag", out)
    position, orientation = errors["position_error_m"], errors["orientation_error_rad"]
    good = code == 0 and position <= 0.02 and orientation <= 0.1
    print(f"final error: {1e3 * position:.1f} mm, {orientation:.3f} rad")
    for name in (*PRODUCTS, "bag"):
        print(f"  {out / name}")
    return 0 if good else 1


def _record(arguments: argparse.Namespace) -> int:
    arguments.name, arguments.ros = "recorder", []
    return _node(arguments)


def _view(arguments: argparse.Namespace) -> int:
    from push_ros.process import run_node
    from push_scenario.scenario import load_scenario
    from push_view.page_server import PageServer
    from push_view.viewer_node import ViewerNode

    scenario = load_scenario(arguments.scenario) if arguments.scenario else None
    server: PageServer | None = None

    def make() -> ViewerNode:
        nonlocal server
        node = ViewerNode(scenario)
        server = PageServer(node, arguments.host, arguments.port)
        print(f"http://{arguments.host}:{server.port}/", flush=True)
        return node

    try:
        return run_node(make)
    except OSError as error:
        print(f"error: port {arguments.port}: {error.strerror}; try --port 0", file=sys.stderr)
        return 2
    finally:
        if server is not None:
            server.close()


def _report(arguments: argparse.Namespace) -> int:
    from push_view.report import write_report

    bag = Path(arguments.bag)
    out = Path(arguments.out) if arguments.out else bag.parent / f"{bag.name}-report"
    try:
        errors = write_report(bag, out)
    except (ValueError, FileNotFoundError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(
        f"{out}: final error {1e3 * errors['position_error_m']:.1f} mm, "
        f"{errors['orientation_error_rad']:.3f} rad"
    )
    return 0


def _recover(arguments: argparse.Namespace) -> int:
    from push_record.bag import recover

    count = recover(Path(arguments.bag), Path(arguments.out))
    print(f"{count} messages recovered into {arguments.out}")
    return 0 if count else 1


def _experiment(arguments: argparse.Namespace) -> int:
    from push_study.experiments.single_robot import single_robot

    out = Path(arguments.out or f"results/{arguments.name}-{time.strftime('%Y%m%d-%H%M%S')}")
    summary = single_robot(
        arguments.scenarios.split(","),
        arguments.trials,
        arguments.seed,
        out,
        arguments.scheduler,
        arguments.workers,
    )
    print(f"\n{out}/summary.json")
    return 0 if len(summary["trials"]) == summary["requested"] else 1


def _bench(arguments: argparse.Namespace) -> int:
    from benchmarks import run

    return run(arguments.what, Path(arguments.out) if arguments.out else None)


def parser() -> argparse.ArgumentParser:
    """The command line's grammar."""
    top = argparse.ArgumentParser(
        prog="planar-push", description="Make mobile robots move things by pushing them."
    )
    commands = top.add_subparsers(required=True, metavar="COMMAND")

    def add(
        name: str, run: Callable[[argparse.Namespace], int], text: str
    ) -> argparse.ArgumentParser:
        command = commands.add_parser(name, help=text, description=text)
        command.set_defaults(run=run)
        return command

    scenario = {"default": "env1-target1", "help": "name in config/scenarios, or a YAML file"}
    p = add("demo", _demo, "start everything, push a box to its goal, record, report")
    p.add_argument("--scenario", **scenario)  # type: ignore[arg-type]
    p.add_argument("--out", default="results/demo", help="folder; replaces an earlier demo")
    p.add_argument("--factor", type=float, default=1.0, help="sim time over wall time")
    p.add_argument("--timeout", type=float, default=220.0, help="[s] wall time")
    p = add("launch", _launch, "one process per node, until Ctrl-C")
    p.add_argument("system", choices=["single", "group", "swarm"])
    p.add_argument("--scenario", **scenario)  # type: ignore[arg-type]
    p.add_argument("--record", default="", help="bag folder")
    p.add_argument("--respawn", action="store_true", help="start a node that died again")
    p.add_argument("--factor", type=float, default=1.0, help="sim time over wall time")
    p = add("goal", _goal, "send a goal pose and follow the job")
    p.add_argument("x", type=float, help="[m]")
    p.add_argument("y", type=float, help="[m]")
    p.add_argument("theta", type=float, help="[rad]")
    p.add_argument("--no-wait", action="store_true")
    p.add_argument("--timeout", type=float, default=300.0, help="[s] wall time")
    p = add("view", _view, "a live view in the browser; goals by mouse")
    p.add_argument("--scenario", default="", help="shown until the suite tells its own")
    p.add_argument("--host", default="127.0.0.1", help="address to serve on")
    p.add_argument("--port", type=int, default=8080, help="0: any that is free")
    p = add("record", _record, "record the suite's topics until Ctrl-C")
    p.add_argument("--scenario", required=True, help="that is running; it goes into the bag")
    p.add_argument("--out", required=True, help="bag folder")
    p = add("report", _report, "pictures and a page from a bag")
    p.add_argument("bag")
    p.add_argument("--out", default="")
    p = add("recover", _recover, "copy what can be read of a cut-off bag")
    p.add_argument("bag")
    p.add_argument("--out", required=True)
    p = add("experiment", _experiment, "many seeded trials, a summary, plots, a bag")
    p.add_argument("name", choices=["single-robot"])
    p.add_argument("--scenarios", default="env1-target1", help="comma-separated")
    p.add_argument("--trials", type=int, default=5)
    p.add_argument("--seed", type=int, default=1)
    p.add_argument("--out", default="")
    p.add_argument("--scheduler", default="", help="address of a Dask scheduler")
    p.add_argument("--workers", type=int, default=0, help="local processes; 0: one a core")
    p = add("bench", _bench, "measure speed and physics, rivals beside")
    p.add_argument(
        "what",
        nargs="?",
        default="all",
        choices=["all", "physics", "curve", "mpc", "latency", "lockstep", "plan", "stable-push"],
    )
    p.add_argument("--out", default="", help="folder for the JSON")
    p = add("node", _node, "run one node in this process")
    p.add_argument("name", choices=["bridge", "planner", "controller", "supervisor", "recorder"])
    p.add_argument("--scenario", **scenario)  # type: ignore[arg-type]
    p.add_argument("--out", default="bag", help="bag folder of the recorder")
    p.add_argument("--ros", nargs=argparse.REMAINDER, default=[], help="ROS arguments, last")
    add("warm-up", _warm_up, "compile the numerical kernels")
    return top


def main(words: Sequence[str] | None = None) -> int:
    """Entry point; returns the exit code."""
    prepare_environment()
    arguments = parser().parse_args(words)
    try:
        code: int = arguments.run(arguments)
    except (SettingsError, FileExistsError, FileNotFoundError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return code


if __name__ == "__main__":
    sys.exit(main())
