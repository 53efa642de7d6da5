"""One process per node: dead nodes, restarts, signals at any moment, the demo."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader

from push_bringup.launcher import Child, Launcher, single_robot
from push_bringup.monitor import Monitor
from push_msgs.msg import JobState
from push_record.bag import bag_file, read_bag

FACTOR = ["--ros", "-p", "real_time_factor:=3.0"]


def alive(group):
    return [c for c in group if c.process is not None and c.process.poll() is None]


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


@pytest.mark.parametrize(
    ("victim", "respawn"), [("controller", True), ("controller", False), ("supervisor", False)]
)
def test_killed_node(domain, victim, respawn, tmp_path):
    """FAULTS 11: wheels stop, the launcher names the dead; with respawn the goal is reached."""
    said = []
    launcher = Launcher(
        single_robot("short", str(tmp_path / "bag"), {"bridge": FACTOR}), respawn, said.append
    )
    launcher.start()
    try:
        with Monitor() as monitor:
            assert monitor.connect(40.0, lambda: not launcher.check())
            monitor.send_goal((0.1, 0.04, 0.1))
            assert monitor.wait(40.0, lambda: monitor.position[0] > -0.35)
            (child,) = [c for c in launcher.children if c.name == victim]
            child.process.send_signal(signal.SIGKILL)
            killed = monitor.stamp
            assert monitor.wait(2.0, lambda: bool(launcher.check()) or bool(said))
            assert any(f"{victim} died (signal 9)" in text for text in said)
            if not respawn:
                assert monitor.wait(20.0, lambda: monitor.stamp > killed + 2.0)
            else:
                code = monitor.follow(90.0, lambda: launcher.check() is not None)
                assert code == 0, monitor.state.reason
                assert np.hypot(monitor.position[0] - 0.1, monitor.position[1] - 0.04) < 0.02
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
        covered, way = standstill(tmp_path / "bag", sign, limit)
        assert covered > 1.5 and way < 1e-3  # it rocks by 0.2 mm
    topics = {r.topic for r in read_bag(tmp_path / "bag")}
    assert {"/poses", "/epuck1/cmd_vel", "/job_state"} <= topics


def test_a_planner_killed_at_work_is_asked_again(domain):
    """FAULTS 11: it dies with the request; the one started in its place gets it anew."""
    said = []
    launcher = Launcher(single_robot("short", "", {"bridge": FACTOR}), True, said.append)
    launcher.start()
    try:
        with Monitor() as monitor:
            assert monitor.connect(40.0, lambda: not launcher.check())
            (child,) = [c for c in launcher.children if c.name == "planner"]
            child.process.send_signal(signal.SIGSTOP)  # it takes the request but never answers
            monitor.send_goal((0.1, 0.04, 0.1))
            assert monitor.wait(10.0, lambda: monitor.state.state == JobState.PLANNING)
            monitor.wait(0.5, lambda: False)
            child.process.send_signal(signal.SIGKILL)
            assert monitor.follow(90.0, lambda: launcher.check() is not None) == 0, monitor.state
    finally:
        launcher.stop()
    assert any("planner died (signal 9)" in text for text in said)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("seed", range(2))
def test_signals_at_random_moments(domain, number, seed, tmp_path):
    """FAULTS 18: everything ends within five seconds, none left, the bag is readable."""
    moment = np.random.default_rng([seed, int(number)]).uniform(0.05, 5.0)
    process = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "planar_push.cli",
            "launch",
            "single",
            "--scenario",
            "short",
            "--record",
            str(tmp_path / "bag"),
        ],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    time.sleep(moment)
    children = children_of(process.pid)
    process.send_signal(number)
    process.wait(5.0)
    time.sleep(0.1)
    assert not [pid for pid in children if os.path.exists(f"/proc/{pid}") and not zombie(pid)]
    if (tmp_path / "bag").exists():
        assert_closed(tmp_path / "bag")


def assert_closed(bag):
    """By a strict reader: footer, summary and metadata are there and agree."""
    with bag_file(bag).open("rb") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None and summary.statistics is not None
        count = summary.statistics.message_count
    information = yaml.safe_load((bag / "metadata.yaml").read_text())
    assert information["rosbag2_bagfile_information"]["message_count"] == count


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_end_a_demo(domain, number, tmp_path):
    """FAULTS 18, in the middle of a push."""
    words = ["demo", "--scenario", "short", "--out", str(tmp_path / "demo")]
    process = subprocess.Popen(
        [sys.executable, "-m", "planar_push.cli", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
    )
    for line in process.stdout:
        if "pushing" in line:
            break
    children = children_of(process.pid)
    assert len(children) >= 5
    process.send_signal(number)
    process.communicate(timeout=5.0)
    assert process.returncode == 130
    assert not [pid for pid in children if os.path.exists(f"/proc/{pid}") and not zombie(pid)]
    assert_closed(tmp_path / "demo" / "bag")


def test_a_recorder_that_is_started_again_writes_beside_the_first_bag(domain, tmp_path):
    said = []
    children = [
        Child("recorder", ["recorder", "--scenario", "short", "--out", str(tmp_path / "b")])
    ]
    launcher = Launcher(children, True, said.append)
    launcher.start()
    try:
        assert until(lambda: list((tmp_path / "b").glob("*.mcap")), 30.0)
        children[0].process.send_signal(signal.SIGKILL)
        assert until(launcher.check, 5.0) or said
        assert until(lambda: list((tmp_path / "b-2").glob("*.mcap")), 30.0)
        assert not launcher.check(), said
    finally:
        launcher.stop()
    assert_closed(tmp_path / "b-2")


def test_a_node_that_dies_again_and_again_is_given_up(domain):
    said = []
    launcher = Launcher([Child("bad", ["bridge", "--scenario", "atlantis"])], True, said.append)
    launcher.start()
    assert launcher.run() == 1
    assert sum("is started again" in text for text in said) == 5
    assert "not started again" in " ".join(said) and said[-1] == "stopping the rest"


def until(condition, limit):
    end = time.monotonic() + limit
    while time.monotonic() < end and not condition():
        time.sleep(0.05)
    return condition()


@pytest.mark.parametrize("value", ["0.0", "fast"])
def test_a_wrong_parameter_on_the_command_line_is_an_error_not_a_traceback(domain, value):
    """FAULTS 20."""
    words = ["node", "bridge", "--scenario", "short", "--ros", "-p", f"real_time_factor:={value}"]
    done = subprocess.run(
        [sys.executable, "-m", "planar_push.cli", *words],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 2 and "Traceback" not in done.stderr
    assert "real_time_factor" in done.stderr


def children_of(pid):
    found = []
    for entry in os.listdir("/proc"):
        if entry.isdigit():
            try:
                with open(f"/proc/{entry}/stat") as file:
                    if int(file.read().rsplit(")", 1)[1].split()[1]) == pid:
                        found.append(int(entry))
            except OSError:
                continue
    return found


def zombie(pid):
    try:
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rsplit(")", 1)[1].split()[0] == "Z"
    except OSError:
        return True


def test_demo_ends_with_bag_pictures_and_report(domain, tmp_path):
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "planar_push.cli",
            "demo",
            "--scenario",
            "short",
            "--factor",
            "3",
            "--out",
            str(tmp_path / "demo"),
        ],
        capture_output=True,
        text=True,
        timeout=180,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "final error" in done.stdout and "pushing" in done.stdout
    for name in ("trajectory.png", "animation.gif", "report.pdf", "bag/metadata.yaml"):
        assert (tmp_path / "demo" / name).stat().st_size > 1000, name


def test_goal_ends_with_the_suite(domain):
    """Nobody waits for an answer that cannot come."""
    launcher = Launcher(single_robot("short"), False, lambda text: None)
    launcher.start()
    try:
        words = ["goal", "0.1", "0.04", "0.1"]
        process = subprocess.Popen(
            [sys.executable, "-m", "planar_push.cli", *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for line in process.stdout:
            if "planning" in line:
                break
        launcher.stop()
        _, error = process.communicate(timeout=20.0)
    finally:
        launcher.stop()
    assert process.returncode == 1 and "ended before the job" in error


def test_wrong_words_are_answered_with_what_to_do():
    done = subprocess.run(
        [sys.executable, "-m", "planar_push.cli", "launch", "single", "--scenario", "atlantis"],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode != 0 and "atlantis" in done.stderr and "env1-target1" in done.stderr
