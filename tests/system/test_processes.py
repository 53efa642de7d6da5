"""One process per node: dead nodes, restarts, signals at any moment, the demo."""

import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from push_bringup.launcher import Child, Launcher
from push_bringup.monitor import Monitor
from push_bringup.node_kinds import MODULES
from push_bringup.systems import recorder
from push_model.jobs import JobError
from push_msgs.msg import JobState
from push_record.bag import read_bag
from push_scenario.scenario import load_scenario
from tests.system.processes import (
    alive,
    assert_closed,
    children_of,
    command,
    launcher_of,
    running,
    until,
)

pytestmark = pytest.mark.live
GOAL = (0.1, 0.04, 0.1)


def standstill(bag, sign, limit):
    """Sim time [s] that the bag covers after the last ``sign``, and the robot's way [m] from
    ``limit`` [s] after it on, both by the ground truth."""
    truth, last = [], 0.0
    for record in read_bag(bag, {sign, "/ground_truth/poses"}):
        header = record.message if record.topic == "/epuck1/heartbeat" else record.message.header
        stamp = header.stamp.sec + 1e-9 * header.stamp.nanosec
        if record.topic == sign:
            last = max(last, stamp)
        else:
            place = list(record.message.names).index("epuck1")
            truth.append((stamp, record.message.x[place], record.message.y[place]))
    table = np.array(truth)
    moving = table[(table[:, 0] > last - 0.5) & (table[:, 0] <= last)]
    assert np.hypot(*(moving[-1] - moving[0])[1:]) > 0.01, "it was to be killed on the move"
    rest = table[table[:, 0] > last + limit]
    return table[-1, 0] - last, float(np.hypot(*np.ptp(rest[:, 1:], axis=0)))


@pytest.mark.long
@pytest.mark.parametrize(
    ("victim", "respawn"), [("controller", True), ("controller", False), ("supervisor", False)]
)
def test_killed_node(domain, victim, respawn, tmp_path):
    """FAULTS 11: wheels stop, the launcher names the dead; with respawn the goal is reached."""
    said = []
    bag = tmp_path / "bag"
    launcher = launcher_of(tmp_path / "s", said=said, respawn=respawn, record=bag, factor=3.0)
    launcher.start()
    try:
        with Monitor() as monitor:
            assert monitor.connect(40.0, lambda: not launcher.check())
            monitor.send_goal(GOAL)
            assert monitor.wait(40.0, lambda: monitor.pose[0] > -0.35)
            (child,) = [c for c in launcher.children if c.name == victim]
            child.process.send_signal(signal.SIGKILL)
            killed = monitor.stamp
            assert monitor.wait(2.0, lambda: bool(launcher.check()) or bool(said))
            assert any(f"{victim} died (signal 9)" in text for text in said)
            if not respawn:
                assert monitor.wait(20.0, lambda: monitor.stamp > killed + 5.0)
            else:
                result = monitor.follow(90.0, lambda: launcher.check() is not None)
                assert result.success, result
                assert result.position_error < 0.02
    finally:
        children = list(launcher.children)
        started = time.monotonic()
        launcher.stop()
    assert time.monotonic() - started < 5.0 and not alive(children)
    if not respawn:
        # three times real time: 0.2 s of sim time for commands, 0.25 s of wall time for heartbeats
        sign, limit = {
            "controller": ("/epuck1/cmd_vel", 0.4),
            "supervisor": ("/epuck1/heartbeat", 1.0),
        }[victim]
        covered, way = standstill(bag, sign, limit)
        assert covered > 1.5 and way < 1e-3  # it rocks by 0.2 mm
    topics = {r.topic for r in read_bag(bag)}
    assert {"/poses", "/epuck1/cmd_vel", "/job_state"} <= topics


@pytest.mark.long
def test_a_planner_killed_at_work_is_asked_again(domain, tmp_path):
    """FAULTS 11: it dies with the request; the one started in its place gets it anew."""
    said = []
    launcher = launcher_of(tmp_path / "s", said=said, respawn=True, factor=3.0)
    launcher.start()
    try:
        with Monitor() as monitor:
            assert monitor.connect(40.0, lambda: not launcher.check())
            (child,) = [c for c in launcher.children if c.name == "planner"]
            child.process.send_signal(signal.SIGSTOP)  # it takes the request but never answers
            monitor.send_goal(GOAL)
            assert monitor.wait(10.0, lambda: monitor.state.state == JobState.PLANNING)
            monitor.wait(0.5, lambda: False)
            child.process.send_signal(signal.SIGKILL)
            result = monitor.follow(90.0, lambda: launcher.check() is not None)
            assert result.success, result
    finally:
        launcher.stop()
    assert any("planner died (signal 9)" in text for text in said)


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("seed", range(2))
def test_signals_at_random_moments(domain, number, seed, tmp_path):
    """FAULTS 18: everything ends within five seconds, none left, the bag is readable."""
    moment = np.random.default_rng([seed, int(number)]).uniform(0.05, 8.0)
    process = command(
        *("launch", "single", "--scenario", "short", "--record", str(tmp_path / "bag")),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        time.sleep(moment)
        children = children_of(process.pid)
        process.send_signal(number)
        process.wait(5.0)
    finally:
        process.kill()  # children die with it
    time.sleep(0.1)
    assert not running(children)
    if (tmp_path / "bag").exists():
        assert_closed(tmp_path / "bag")


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_end_a_demo(domain, number, tmp_path):
    """FAULTS 18, in the middle of a push."""
    process = command(
        *("demo", "--scenario", "short", "--out", str(tmp_path / "demo")),
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )
    for line in process.stdout:
        if "pushing" in line:
            break
    children = children_of(process.pid)
    assert len(children) >= 5
    process.send_signal(number)
    process.communicate(timeout=5.0)
    assert process.returncode == 130
    assert not running(children)
    assert_closed(tmp_path / "demo" / "bag")


@pytest.mark.long
def test_a_recorder_that_is_started_again_writes_beside_the_first_bag(domain, tmp_path):
    said = []
    bag = tmp_path / "b"
    words = recorder(str(bag)).words("short")
    launcher = Launcher([Child("recorder", MODULES["recorder"], words, bag)], True, said.append)
    launcher.start()
    try:
        assert until(lambda: list(bag.glob("*.mcap")), 30.0)
        launcher.children[0].process.send_signal(signal.SIGKILL)
        assert until(launcher.check, 5.0) or said
        assert until(lambda: list((tmp_path / "b-2").glob("*.mcap")), 30.0)
        assert not launcher.check(), said
    finally:
        launcher.stop()
    assert_closed(tmp_path / "b-2")


@pytest.mark.long
def test_a_node_that_dies_again_and_again_is_given_up(domain, tmp_path):
    said = []
    words = ["--ros-args", "-p", "scenario:=atlantis"]
    bad = Child("bad", MODULES["bridge"], words)
    launcher = Launcher([bad], True, said.append, logs=tmp_path)
    launcher.start()
    assert launcher.run() == 1
    assert sum("is started again" in text for text in said) == 5
    assert "not started again" in " ".join(said) and said[-1] == "stopping the rest"
    assert "atlantis" in launcher.last_words("bad")


@pytest.mark.parametrize("value", ["0.0", "fast"])
def test_a_wrong_parameter_on_the_command_line_is_an_error_not_a_traceback(domain, value):
    """FAULTS 20."""
    words = ["bridge", "--scenario", "short", "--ros", "-p", f"real_time_factor:={value}"]
    done = subprocess.run(
        [sys.executable, "-m", "planar_push", "node", *words],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 2 and "Traceback" not in done.stderr
    assert "real_time_factor" in done.stderr


@pytest.mark.long
def test_demo_ends_with_bag_pictures_and_report(domain, tmp_path):
    process = command(
        *("demo", "--scenario", "short", "--factor", "3", "--out", str(tmp_path / "demo")),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    out, err = process.communicate(timeout=240)
    assert process.returncode == 0, out + err
    assert "final error" in out
    assert (out + err).count("push 1 of 1 on side 0") == 1  # each state is told once
    for name in ("trajectory.png", "animation.gif", "report.pdf", "bag/metadata.yaml"):
        assert (tmp_path / "demo" / name).stat().st_size > 1000, name


def test_goal_ends_with_the_suite(domain, tmp_path):
    """Nobody waits for an answer that cannot come."""
    launcher = launcher_of(tmp_path / "s")
    launcher.start()
    try:
        process = command(
            *("goal", "0.1", "0.04", "0.1"), stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        for line in process.stdout:
            if "planning" in line:
                break
        launcher.stop()
        _, error = process.communicate(timeout=20.0)
    finally:
        launcher.stop()
    assert process.returncode == 1 and "ended before the job" in error


@pytest.mark.long
def test_goal_waits_for_an_owner_that_is_frozen_and_for_one_that_was_restarted(domain, tmp_path):
    """8 s without the supervisor, longer than it stays in the graph; then it dies, and the one that
    is started in its place takes the job up again."""
    events, said = [], []
    launcher = launcher_of(tmp_path / "s", said=said, respawn=True, factor=3.0)
    launcher.start()
    try:
        with Monitor(on_event=events.append) as monitor:
            assert monitor.connect(40.0, lambda: not launcher.check())
            monitor.send_goal(GOAL)
            assert monitor.wait(40.0, lambda: monitor.pose[0] > -0.35)
            (child,) = [c for c in launcher.children if c.name == "supervisor"]
            child.process.send_signal(signal.SIGSTOP)
            end = time.monotonic() + 8.0
            while time.monotonic() < end:
                monitor.spin()
                assert monitor.poll() is None
            child.process.send_signal(signal.SIGCONT)
            result = monitor.follow(120.0)
            assert result.success, result
            assert [e.kind for e in events if e.kind == "silent"] == ["silent"]
            monitor.send_goal((-0.3, 0.3, 0.0))
            assert monitor.wait(20.0, lambda: monitor.state.state == JobState.PLANNING)
            child.process.send_signal(signal.SIGKILL)
            result = monitor.follow(120.0, lambda: launcher.check() is not None)
            assert result.success and result.position_error < 0.02, result
    finally:
        launcher.stop()
    assert any("supervisor died (signal 9)" in text for text in said)


@pytest.mark.long
@pytest.mark.parametrize(
    ("system", "scenario"), [("swarm", "swarm-square"), ("group", "group-ellipse")]
)
def test_a_job_outlives_the_node_that_owns_it(domain, tmp_path, system, scenario):
    """It dies in the middle of a push; `planar-push goal` follows the job to its end."""
    said = []
    launcher = launcher_of(
        *(tmp_path / "s", scenario, said),
        respawn=True,
        system=system,
        parameters={"bridge": {"world": "planar"}},
    )
    launcher.start()
    try:
        with Monitor() as monitor:
            assert monitor.connect(90.0, lambda: not launcher.check())
            goal = [str(v) for v in load_scenario(scenario).goal]
            process = command(
                *("goal", "--timeout", "240", "--", *goal),
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
            )
            assert monitor.wait(120.0, lambda: monitor.state.state == JobState.PUSHING)
            job = monitor.state.job
            (child,) = [c for c in launcher.children if c.name == system]
            child.process.send_signal(signal.SIGKILL)
            assert until(lambda: launcher.check() or bool(said), 5.0)
            out, err = process.communicate(timeout=250.0)
            assert process.returncode == 0, out + err
            assert "restarted" in out + err and monitor.wait(5.0, lambda: monitor.state.job == job)
    finally:
        launcher.stop()
    assert any(f"{system} died (signal 9)" in text for text in said)


@pytest.mark.long
def test_goal_follows_its_own_goal(domain, tmp_path):
    """A stranger's goals, refused or taken, are not mistaken for its own."""
    launcher = launcher_of(tmp_path / "s", factor=3.0)
    launcher.start()
    try:
        with Monitor() as mine, Monitor() as stranger:
            assert mine.connect(40.0) and stranger.connect(40.0)
            mine.send_goal(GOAL)
            assert mine.wait(20.0, lambda: mine.state.state > JobState.PLANNING)
            stranger.send_goal((50.0, 0.0, 0.0))  # outside the map
            refused = stranger.follow(20.0)
            assert refused.refused and refused.code is JobError.OUTSIDE_MAP, refused
            mine.spin()
            assert mine.poll() is None
            # the same goal, sent by somebody else, changes nothing
            stranger.send_goal(GOAL)
            result = mine.follow(90.0)
            assert result.success and result.position_error < 0.02, result
            # another one takes over, and that is told
            mine.send_goal((-0.3, 0.3, 0.0))
            assert mine.wait(20.0, lambda: mine.state.state == JobState.PLANNING)
            assert mine.poll() is None
            stranger.send_goal((0.4, 0.1, 0.0))
            replaced = mine.follow(30.0)
            assert replaced.code is JobError.PREEMPTED and not replaced.refused, replaced
    finally:
        launcher.stop()
