"""The house as docs/architecture.md draws it: imports run downward, cores know no ROS."""

import ast
import re
import subprocess
from enum import IntEnum
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FLOORS = [
    {"push_model", "push_msgs", "tf2_msgs"},
    {"push_job", "push_scenario", "push_estimation", "push_qp"},
    {"push_ros"},
    {
        "push_planner",
        "push_mpc",
        "push_supervisor",
        "grasp_opt",
        "swarm_push",
        "sim_bridge",
        "lab_bridge",
        "push_record",
    },
    {"push_bringup", "push_view", "push_gym"},
    {"push_study"},
    {"benchmarks"},
    {"planar_push"},
]
FLOOR = {room: number for number, rooms in enumerate(FLOORS) for room in rooms}
OURS = set(FLOOR)
ROS = {"rclpy", "push_ros", "push_msgs", "tf2_msgs", "ament_index_python"} | {
    f"{kind}_msgs"
    for kind in ("std", "geometry", "nav", "sensor", "visualization", "diagnostic", "rosgraph")
}
WITHOUT_ROS = {"push_model", "push_job", "push_scenario", "push_estimation", "push_qp", "push_gym"}
SHELLS = {"push_planner", "push_mpc", "push_supervisor", "grasp_opt", "swarm_push"}
LONGEST = 400  # lines


def sources():
    """Every Python file of the rooms that git knows or would."""
    words = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "*.py"]
    names = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    files = [Path(name) for name in names.split()]
    return [f for f in files if f.parts[0] in OURS and (ROOT / f).is_file()]


def imported(path):
    """Top packages that a file imports, anywhere in it."""
    found = set()
    for node in ast.walk(ast.parse((ROOT / path).read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            found.add(node.module.split(".")[0])
    return found


def is_shell(path):
    """Whether a file may know ROS: the node of a package, and how it talks to other nodes."""
    others = ("node.py", "parameters.py", "peers.py")
    return path.name in others or path.name.endswith(("_node.py", "_messages.py"))


FILES = sources()


def test_there_is_something_to_check():
    assert len(FILES) > 60 and {"push_model", "push_ros", "planar_push"} <= {
        f.parts[0] for f in FILES
    }
    known = {p.name for p in ROOT.iterdir() if (p / "__init__.py").is_file()} - {"tests"}
    assert known <= OURS, f"rooms without a floor: {known - OURS}"


@pytest.mark.parametrize("path", FILES, ids=str)
def test_imports_run_downward(path):
    room = path.parts[0]
    for other in (imported(path) & OURS) - {room}:
        assert FLOOR[other] < FLOOR[room], f"{path} imports {other}, which is not below it"


@pytest.mark.parametrize("path", FILES, ids=str)
def test_cores_know_neither_ros_nor_the_simulator(path):
    room, names = path.parts[0], imported(path)
    if room != "sim_bridge":
        assert "pybullet" not in names, path
    core = room in SHELLS and not is_shell(path)
    if room in WITHOUT_ROS or core or path.name.startswith("one_robot_"):
        assert not names & ROS, f"{path} imports {names & ROS}"


@pytest.mark.parametrize("path", FILES, ids=str)
def test_a_file_is_one_idea(path):
    assert len((ROOT / path).read_text().splitlines()) <= LONGEST


def constants(interface):
    """UPPER_CASE integer constants of a .msg, .srv or .action file."""
    text = (ROOT / "push_msgs" / interface).read_text()
    return {n: int(v) for n, v in re.findall(r"^u?int\d+ ([A-Z_]+) *= *(\d+)", text, re.M)}


def enumeration(name):
    from push_model.jobs import JobError
    from push_mpc import TrackError
    from push_planner import PlanError, RobotPathError
    from push_supervisor import State

    return {
        "JobError": JobError,
        "TrackError": TrackError,
        "PlanError": PlanError,
        "RobotPathError": RobotPathError,
        "State": State,
    }[name]


@pytest.mark.parametrize(
    ("name", "interface", "whole"),
    [
        ("JobError", "action/MoveObject.action", True),
        ("TrackError", "action/FollowTrajectory.action", False),
        ("PlanError", "action/PlanPush.action", False),
        ("RobotPathError", "srv/PlanRobotPath.srv", False),
        ("State", "msg/JobState.msg", True),
    ],
)
def test_enumerations_equal_the_constants_in_the_messages(name, interface, whole):
    """``whole``: the other way round too; other codes are given by the node alone."""
    members: type[IntEnum] = enumeration(name)
    ours, theirs = {m.name: int(m) for m in members}, constants(interface)
    assert theirs, interface
    for key, value in ours.items():
        assert theirs.get(key) == value, f"{name}.{key} is {value}, {interface} says {theirs}"
    if whole:
        assert ours == theirs


def modules():
    """By name, the modules and names that each module imports when it is loaded."""
    graph = {}
    for path in FILES:
        module = ".".join(path.with_suffix("").parts)
        names = set()
        for node in ast.parse((ROOT / path).read_text()).body:
            if isinstance(node, ast.ImportFrom) and node.module:
                names |= {node.module, *(f"{node.module}.{a.name}" for a in node.names)}
            elif isinstance(node, ast.Import):
                names |= {a.name for a in node.names}
        graph[module.removesuffix(".__init__")] = names
    return graph


def test_circles_of_imports_are_noticed():
    """The rule above leaves no room for a circle between packages; nor is there one inside any."""
    graph = modules()
    done, path_now = set(), []

    def visit(module):
        assert module not in path_now, f"circle: {' -> '.join([*path_now, module])}"
        if module in done or module not in graph:
            return
        path_now.append(module)
        for other in sorted(graph[module] & set(graph)):
            taken = {n for n in graph[module] if n.rpartition(".")[0] == other}
            # who imports modules of its own package only does not need its __init__
            own = module.startswith(other + ".") and taken <= set(graph)
            if other != module and not own:
                visit(other)
        path_now.pop()
        done.add(module)

    for module in sorted(graph):
        visit(module)
