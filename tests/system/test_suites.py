"""Suites from Python, two of them side by side, and the examples; all live."""

import contextlib
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rclpy
from rclpy.signals import SignalHandlerOptions

from push_bringup.failures import DomainInUse, SuiteFailed
from push_bringup.launcher import Launcher
from push_bringup.node_kinds import SECTIONS
from push_bringup.suite import Suite
from push_model.jobs import JobError
from push_record.bag import read_bag
from push_record.contents import load
from push_scenario.scenario import load_scenario
from push_view.report import final_error
from tests.system.processes import command

pytestmark = pytest.mark.live
ROOT = Path(__file__).resolve().parents[2]


def topics_outside(bag, namespace):
    """Topics of a bag that are not in a namespace."""
    return {r.topic for r in read_bag(bag) if not r.topic.startswith(f"/{namespace}/")}


def strangers_touched(contents, bag):
    """Pairs of bodies of different teams, and of a body and a wall, that touched."""
    teams = {}
    for name, team in contents.scenario.teams.items():
        teams |= dict.fromkeys((*team.robots, team.object), name)
    namespace = contents.metadata["namespace"]
    found = set()
    for record in read_bag(bag, {f"{namespace}contacts"}):
        m = record.message
        for a, b in zip(m.body_a, m.body_b, strict=True):
            if {a, b} & teams.keys() and teams.get(a) != teams.get(b):
                found.add((a, b))
    return found


def test_a_script_starts_a_suite_and_is_told_how_it_ended(domain, tmp_path, capfd):
    events = []
    parameters = {"planner": {"push_speed": 0.06}, "bridge": {"real_time_factor": 3.0}}
    with Suite(
        "short", parameters=parameters, record=tmp_path / "bag", on_event=events.append
    ) as suite:
        result = suite.reach(0.1, 0.04, 0.1)
        refused = suite.reach(50.0, 0.0, 0.0)
        with pytest.raises(DomainInUse, match=f"domain {domain}"), Suite("short"):
            pass
    assert result.success and result.position_error < 0.02 and result.orientation_error < 0.1
    assert result.code is JobError.NONE and result.duration > 5.0 and result.reason
    assert result.bag == tmp_path / "bag"
    assert refused.refused and refused.code is JobError.OUTSIDE_MAP and not refused.success
    names = [e.state for e in events if e.kind == "state"]
    assert [n for n, before in zip(names, ["", *names], strict=False) if n != before][:5] == [
        "planning",
        "positioning",
        "approach",
        "pushing",
        "idle",
    ]
    contents = load(result.bag)
    assert final_error(contents, contents.jobs["/"]).position < 0.02
    said = contents.scenario.parameters
    assert said["planner"]["push_speed"] == 0.06
    assert set(said) == set(SECTIONS) and said["supervisor"]["wait"] == 3.0  # defaults too
    out, err = capfd.readouterr()
    assert out == "" and err == ""  # silent unless asked


@pytest.mark.long
def test_a_suite_in_a_given_context_ends_with_a_dead_node(domain):
    context = rclpy.Context()
    rclpy.init(args=[], context=context, signal_handler_options=SignalHandlerOptions.NO)
    try:
        with Suite("short", context=context, factor=3.0) as suite:
            (child,) = [c for c in suite._launcher.children if c.name == "controller"]
            child.process.kill()
            with pytest.raises(SuiteFailed, match=r"controller died \(signal 9\)"):
                suite.reach(0.1, 0.04, 0.1)
            launcher = suite._launcher
        assert all(c.process is None or c.process.poll() is not None for c in launcher.children)
        assert context.ok()  # it is not the suite's to shut down
    finally:
        rclpy.try_shutdown(context=context)


def test_what_a_dead_node_said_is_quoted(domain, monkeypatch):
    suite = Suite("short")
    write = type(suite.setup).write

    def spoiled(self, folder):
        children = write(self, folder)
        children[0].arguments += ["-p", "real_time_factor:=-1.0"]
        return children

    monkeypatch.setattr(type(suite.setup), "write", spoiled)
    with pytest.raises(SuiteFailed, match="real_time_factor"), suite:
        pass


@pytest.mark.long
def test_two_teams_side_by_side_in_one_world(domain, tmp_path):
    """Done-when 3: two single-robot systems in one graph, neither touches the other."""
    with Suite("two-singles", record=tmp_path / "bag", namespace="a") as suite:
        results = suite.reach_all()
    assert set(results) == {"south", "north"}
    for result in results.values():
        assert result.success and result.position_error < 0.02, result
    contents = load(tmp_path / "bag")
    assert not topics_outside(tmp_path / "bag", "a")
    assert not strangers_touched(contents, tmp_path / "bag")
    for name, result in results.items():
        job = contents.jobs[f"/a/{name}/"]
        assert final_error(contents, job).position < 0.02
        assert "PUSHING" in [s.name for s in job.states] and result.replans == 0


@pytest.mark.long
def test_two_suites_in_two_namespaces_of_one_domain(domain, tmp_path):
    """Two bridges, two of everything: each hears its own."""
    with contextlib.ExitStack() as stack:
        bags = {n: tmp_path / n for n in ("a", "b")}
        suites = {
            n: stack.enter_context(Suite("short", namespace=n, record=bags[n], factor=1.5))
            for n in bags
        }
        suites["a"].monitor().send_goal((0.1, 0.04, 0.1))
        suites["b"].monitor().send_goal((0.05, -0.04, -0.1))
        results = {n: s.monitor().follow(120.0) for n, s in suites.items()}
        with pytest.raises(DomainInUse, match="in namespace b"):
            stack.enter_context(Suite("short", namespace="b"))
    goals = {n: r.goal for n, r in results.items()}
    assert goals == {"a": (0.1, 0.04, 0.1), "b": (0.05, -0.04, -0.1)}
    for name, result in results.items():
        assert result.success and result.position_error < 0.02, result
        assert not topics_outside(bags[name], name)
        contents = load(bags[name])
        assert final_error(contents, contents.jobs[f"/{name}/"]).position < 0.02


def example(name, *words, limit=300.0):
    """Run a script of the folder ``examples`` to its end; limit: [s] of wall time."""
    return subprocess.run(
        [sys.executable, str(ROOT / "examples" / name), *words],
        cwd=ROOT,
        env=Launcher([])._environment | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=limit,
        check=False,
    )


@contextlib.contextmanager
def launched(*words):
    """A suite of ``planar-push launch`` with its first line of output."""
    process = command("launch", *words, stdout=subprocess.PIPE)
    try:
        yield process.stdout.readline()
    finally:
        process.terminate()
        process.wait(20)


@pytest.mark.long
@pytest.mark.parametrize(
    "words",
    [
        ["reach_a_goal.py", "3"],
        ["reach_a_goal_in_lockstep.py"],
        ["two_teams_recorded.py", "2"],
    ],
)
def test_examples(domain, words):
    done = example(*words)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "NONE: the goal is reached" in done.stdout


@pytest.mark.long
def test_a_suite_goes_through_all_goals_of_its_scenario(domain):
    scenario = load_scenario("short").settings("bridge", real_time_factor=3.0)
    goals = (0.0, 0.02, 0.0), (0.3, -0.02, -0.1)
    events = []
    given = replace(scenario, goals=tuple(np.array(goal) for goal in goals))
    with Suite(given, on_event=events.append) as suite:
        (result,) = suite.reach_all().values()
    assert result.success and result.goal == goals[1] and result.position_error < 0.02
    assert [e.state for e in events if e.kind == "state"].count("idle") == 2


@pytest.mark.long
def test_the_example_pushes_along_the_trajectory_of_a_scenario(domain):
    with launched("group", "--scenario", "group-trajectory") as told:
        assert "examples/push_along_a_trajectory.py" in told
        done = example("push_along_a_trajectory.py", limit=400.0)
    assert done.returncode == 0 and done.stdout.startswith("0: at its end"), done.stdout


@pytest.mark.long
def test_the_example_drives_a_torque_robot(domain, tmp_path):
    with launched("torque", "--scenario", "wheel-slip") as told:
        assert "send trajectories to" in told
        done = example("follow_a_trajectory.py", "pioneer", "0.5", limit=120.0)
    assert done.returncode == 0 and done.stdout.startswith("0: at its end"), done.stdout
