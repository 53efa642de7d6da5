"""No wall clock decides anything in lockstep: FAULTS row 30, issue 18 row 10, read off the code.

Every look at a clock of the machine is listed here with the reason why it decides nothing there. A
new one, or one that has gone, fails the test.
"""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = (
    "push_model",
    "push_qp",
    "push_scenario",
    "push_estimation",
    "push_ros",
    "push_supervisor",
    "push_planner",
    "push_mpc",
    "grasp_opt",
    "swarm_push",
    "sim_bridge",
    "push_record",
    "push_study",
    "push_bringup/one_robot_*.py",
)
"""What runs in a lockstep run. Launcher, command line and page are for people, in their time."""
CLOCKS = {
    "monotonic",
    "monotonic_ns",
    "time",
    "time_ns",
    "perf_counter",
    "perf_counter_ns",
    "process_time",
    "thread_time",
    "sleep",
}
TIMERS = {"STEADY_TIME", "SYSTEM_TIME"}

COST = "tells what something has cost"
PERSON = "tells people something, no matter when"
START = "before anything moves"
LIVE = "in lockstep the silence of the poses is 0"
CLOCK = "the one clock for silence; in lockstep it takes the time of the poses"
DECIDES_NOTHING = {
    "push_ros/pace_feed.py:LivenessClock.__init__": CLOCK,
    "push_ros/pace_feed.py:LivenessClock.now": CLOCK,
    "push_ros/diagnostics.py:Diagnostics.__init__": PERSON,
    "push_ros/diagnostics.py:Diagnostics.publish": PERSON,
    "push_ros/process.py:Spinner.until": "a limit that its caller sets, who is no node",
    "push_ros/scheduling.py:RealTimePriority": "when the system runs a process, not what it does",
    "push_supervisor/node.py:SupervisorNode._connect": LIVE,
    "push_planner/work.py:Work.__init__": COST,
    "push_planner/work.py:Work.counted": COST,
    "push_ros/map_feed.py:FirstMap.__init__": "its timer looks for the first map, see below",
    "push_ros/map_feed.py:FirstMap.wait": "see below",
    "push_ros/map_feed.py:FirstMap._on_timer": "refuses a request when no map has come, "
    "which a lockstep run has before it starts",
    "push_planner/node.py:PlannerNode._begin": COST,
    "push_planner/rearranger_node.py:RearrangerNode.__init__": LIVE,
    "push_planner/rearranger_node.py:RearrangerNode._on_slice": COST,
    "push_planner/node.py:PlannerNode._slice": "signs of life, which nobody waits for in "
    "lockstep; a time budget only where the asker gives one, in wall time by its definition",
    "push_planner/node.py:PlannerNode._now": "stamps of messages",
    "push_planner/node.py:PlannerNode._succeed": COST,
    "push_study/rivals/lone_pusher.py:LonePusher.step": COST,
    "push_study/rivals/stable_nmpc.py:StableNmpcMethod._solve": COST,
    "push_mpc/ltv_mpc.py": COST,
    "push_mpc/contact_force_mpc.py": COST,
    "push_mpc/wheel_slip_nmpc.py": COST,
    "push_mpc/tracker.py:TrajectoryTracker._solve": "a solve has a deadline in live use alone",
    "push_mpc/follower_node.py:FollowerNode.__init__": LIVE,
    "push_mpc/follower_node.py:FollowerNode._on_watchdog": LIVE,
    "grasp_opt/optimizer_node.py": COST,
    "sim_bridge/node.py:BridgeNode.__init__": "when to look at the graph, and to warn",
    "sim_bridge/node.py:BridgeNode._on_timer": "when to look at the graph, and to warn",
    "sim_bridge/node.py:BridgeNode._advance": "when to look at the graph, and to warn",
    "push_ros/command_intake.py:CommandIntake": "the limit in wall time is infinite in lockstep",
    "push_ros/lone_bridge.py:refuse_second_bridge": START,
    "push_ros/lone_bridge.py:_seen": START,
    "push_record/bag.py": "when to flush a file",
    "push_record/player.py": "plays a bag; there is no bridge beside it",
    "push_record/recorder.py": "stamps of a live bag",
    "push_study/experiments/pusht.py:trial": COST,
    "push_study/bench_push/episode.py:run": COST,
    "push_study/gco/team.py:push": COST,
    "push_study/gco/worker.py:Room.solve": COST,
    "push_study/experiments/relopush.py:_rebuilt": COST,
    "push_study/experiments/relopush.py:_ours": COST,
    "push_study/leaderboard/match.py:play": COST,
    "push_study/progress.py": PERSON,
    "push_ros/method_node.py:MethodNode.__init__": LIVE,
    "push_ros/method_node.py:MethodNode._step": COST,
    "grasp_opt/plan_source.py": COST,
    "push_study/given_grasp.py:GraspPlans.answer": COST,
    "push_bringup/one_robot_method.py": COST,
}
"""Files, classes or functions, with the reason."""


def looks(tree):
    """Name of the function or class that looks at a clock, and the line, for each look."""
    found = []

    def visit(node, inside):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            inside = [*inside, node.name]
        if isinstance(node, ast.Attribute) and (
            node.attr in TIMERS
            or node.attr == "get_clock"
            or (
                isinstance(node.value, ast.Name) and node.value.id == "time" and node.attr in CLOCKS
            )
        ):
            found.append((".".join(inside), node.lineno))
        if isinstance(node, ast.ImportFrom) and node.module in ("time", "datetime", "asyncio"):
            found.append((".".join(inside), node.lineno))
        for child in ast.iter_child_nodes(node):
            visit(child, inside)

    visit(tree, [])
    return found


def listed(path, name):
    """The entry that allows a look in a function, None where there is none."""
    parts = name.split(".") if name else []
    keys = [path, *(f"{path}:{'.'.join(parts[:k])}" for k in range(1, len(parts) + 1))]
    return next((key for key in keys if key in DECIDES_NOTHING), None)


def all_looks():
    for folder in FOLDERS:
        for file in sorted(ROOT.glob(folder if "*" in folder else f"{folder}/**/*.py")):
            path = file.relative_to(ROOT).as_posix()
            for name, line in looks(ast.parse(file.read_text())):
                yield path, name, line


def test_every_look_at_a_wall_clock_is_known_to_decide_nothing_in_lockstep():
    used, unknown = set(), []
    for path, name, line in all_looks():
        key = listed(path, name)
        used.add(key)
        if key is None:
            unknown.append(f"{path}:{line} in {name or 'the module'}")
    assert not unknown, "\n".join(unknown)
    stale = set(DECIDES_NOTHING) - used
    assert not stale, stale


@pytest.mark.parametrize(
    ("code", "where"),
    [
        ("import time\ndef f():\n    return time.monotonic() > 3", ["f"]),
        ("import time\nclass A:\n    def g(self):\n        time.sleep(1.0)", ["A.g"]),
        ("from time import monotonic", [""]),
        ("def f(node):\n    Clock(clock_type=ClockType.STEADY_TIME)", ["f"]),
        ("def f(self):\n    return self.get_clock().now()", ["f"]),
        ("def f(feed):\n    return feed.clock.now, feed.time", []),
    ],
)
def test_looks_are_found(code, where):
    assert [name for name, _ in looks(ast.parse(code))] == where
