"""What becomes of frames on their way in, and of commands on their way out; times are passed in."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from lab_bridge.crowding import Crowding
from lab_bridge.fleet import Fleet
from lab_bridge.marker_mapping import Marker
from lab_bridge.pose_intake import Clocks, PoseIntake
from lab_bridge.settings import LabBridgeSettings
from push_estimation.pose_gate import PoseGateSettings, Stamp
from push_scenario.bodies import load_robot
from push_scenario.lab import LabBody, LabSettings, PoseStampedSource, TwistLink
from push_scenario.scenario import load_scenario

UP = [0.0, 0.0, 0.0, 1.0]


class Bench:
    """An intake of two bodies with clocks that a test sets."""

    def __init__(self, **words):
        lab = LabSettings(
            poses=PoseStampedSource(),
            robots={"r": TwistLink(topic="/t")},
            bodies={"r": LabBody("Robot"), "box": LabBody("Box")},
            **words,
        )
        self.now, self.frames, self.complaints = 100.0, [], []
        self.intake = PoseIntake(
            lab,
            ["r", "box"],
            LabBridgeSettings(),
            PoseGateSettings(),
            Clocks(lambda: self.now, lambda: 5000.0 + self.now),
            lambda stamp, poses, verdict: self.frames.append((stamp, poses, verdict)),
            lambda where, why: self.complaints.append(f"{where}: {why}"),
        )

    def say(self, stamp, **markers):
        self.now += 0.01
        seen = {k: Marker(np.array([v, 0.0, 0.05]), np.array(UP)) for k, v in markers.items()}
        self.intake.frame(seen, stamp)


def test_frames_carry_the_stamp_of_capture_or_of_receipt():
    bench = Bench()
    bench.say(7.0, Robot=0.1, Box=0.2)
    stamp, poses, verdict = bench.frames[0]
    assert stamp == 7.0 and verdict is Stamp.OK and poses["box"].tolist() == [0.2, 0.0, 0.0]
    bench = Bench(stamps="receipt")
    bench.say(7.0, Robot=0.1, Box=0.2)
    assert bench.frames[0][0] == pytest.approx(5100.01)


def test_poses_that_come_one_by_one():
    bench = Bench()
    marker = Marker(np.array([0.1, 0.0, 0.05]), np.array(UP))
    bench.intake.part("Robot", marker, 7.0)
    bench.intake.part("Nobody", marker, 7.0)
    assert not bench.frames
    bench.now += 0.005
    bench.intake.poll()
    assert list(bench.frames[0][1]) == ["r"] and bench.intake.missing == ["box"]


def test_strange_bodies_are_named_once_and_left_out():
    bench = Bench()
    bench.say(7.0, Robot=0.1, Box=0.2, Hat=1.0)
    bench.say(7.01, Robot=0.1, Box=0.2, Hat=1.0)
    assert set(bench.frames[1][1]) == {"r", "box"}
    assert [c for c in bench.complaints if "Hat" in c] == [
        "body 'Hat': the scenario has no body of this name"
    ]
    assert bench.intake.unknown == {"Hat"}


@pytest.mark.parametrize(
    ("marker", "words"),
    [
        (Marker(np.array([math.nan, 0, 0]), np.array(UP)), "not finite"),
        (Marker(np.zeros(3), np.zeros(4)), "no rotation"),
        (
            Marker(np.zeros(3), np.array([math.sin(0.5), 0, 0, math.cos(0.5)])),
            "tilted by 57 degrees",
        ),
    ],
)
def test_a_pose_that_cannot_be_is_left_out(marker, words):
    bench = Bench()
    bench.intake.frame({"Robot": marker, "Box": Marker(np.zeros(3), np.array(UP))}, 7.0)
    assert list(bench.frames[0][1]) == ["box"]
    assert words in bench.complaints[0]


def test_a_jump_is_left_out_until_it_persists():
    bench = Bench()
    for k in range(5):
        bench.say(7.0 + 0.01 * k, Robot=0.1, Box=0.2)
    shown = []
    for k in range(12):
        bench.say(7.05 + 0.01 * k, Robot=0.1, Box=0.9)
        shown.append("box" in bench.frames[-1][1])
    assert shown == [False] * 9 + [True] * 3


def test_a_clock_that_stands_or_goes_back_is_refused_at_first():
    bench = Bench()
    for stamp in (7.0, 7.01, 7.01, 7.01):
        bench.say(stamp, Robot=0.1)
    assert len(bench.frames) == 2 and "not newer" in bench.complaints[0]
    for k in range(3):
        bench.say(3.0 + 0.01 * k, Robot=0.1)
    assert [f[2] for f in bench.frames[2:]] == [Stamp.RESET]


def test_rate_and_age_are_measured():
    bench = Bench()
    for k in range(50):
        bench.say(5100.0 + 0.01 * k, Robot=0.1)
    assert bench.intake.figures.rate == pytest.approx(100.0)
    assert bench.intake.figures.age == pytest.approx((0.01, 0.0), abs=1e-9)


class Wheels:
    """A robot driver that keeps what it is told."""

    def __init__(self):
        self.told, self.trouble, self.closed = [], "", False

    def command(self, twist, now):
        self.told.append(np.round(twist, 9).tolist())

    def poll(self, now):
        pass

    def close(self, now):
        self.closed = True


@pytest.fixture
def team():
    specs = {"e": load_robot("epuck"), "d": load_robot("disc")}
    drivers = {name: Wheels() for name in specs}
    headings = {"d": math.pi / 2}
    fleet = Fleet(specs, drivers, LabBridgeSettings(max_speed=0.1), lambda: 1.0, headings.get)
    fleet.held = False
    return SimpleNamespace(fleet=fleet, headings=headings, **drivers)


def test_commands_are_limited_and_keep_their_curvature(team):
    team.fleet.command("e", 0.2, 1.0)
    ((v, _, omega),) = team.e.told
    assert v <= 0.1 and v / omega == pytest.approx(0.2)


def test_a_command_in_the_frame_of_the_map_is_turned(team):
    team.fleet.command_all(["d"], np.array([[0.05, 0.0, 0.0]]), fixed_frame=True)
    assert team.d.told == [[pytest.approx(0.0), -0.05, 0.0]]
    team.headings.clear()
    team.fleet.command_all(["d"], np.array([[0.05, 0.0, 0.0]]), fixed_frame=True)
    assert team.d.told[-1] == [0.0, 0.0, 0.0]


def test_a_fleet_that_is_held_stands(team):
    team.fleet.held = True
    team.fleet.command("e", 0.05, 0.0)
    assert team.e.told == [[0.0, 0.0, 0.0]]


def test_lost_and_found_robots_are_told_once(team):
    team.d.trouble = "gone"
    assert team.fleet.poll() == ({"d": "gone"}, [])
    assert team.fleet.poll() == ({}, [])
    team.d.trouble = ""
    assert team.fleet.poll() == ({}, ["d"])
    team.fleet.close(lambda seconds: None)
    assert team.e.told[-1] == [0.0, 0.0, 0.0]
    assert team.e.closed and team.d.closed


@pytest.mark.parametrize(
    ("poses", "words"),
    [
        ({"epuck1": (-0.7, 0.0), "box": (-0.45, 0.0)}, ""),
        ({"epuck1": (-0.54, 0.0), "box": (-0.45, 0.0)}, ""),  # in contact
        ({"epuck1": (-7e-4, 0.0), "box": (-4.5e-4, 0.0)}, "epuck1 is inside box"),
        ({"epuck1": (-700.0, 0.0), "box": (-450.0, 0.0)}, "off the map"),
        ({}, ""),
    ],
)
def test_frames_that_cannot_be(poses, words):
    """Among them a lab in metres that is read as millimetres, and the other way round."""
    check = Crowding(load_scenario("short"))
    found = check.impossible({n: np.array([*xy, 0.3]) for n, xy in poses.items()})
    assert words in found and bool(found) == bool(words)


def test_robots_in_one_place():
    check = Crowding(load_scenario("group-ellipse"))
    poses = {f"epuck{i}": np.array([0.1 * i, 0.0, 0.0]) for i in (1, 2)}
    assert check.impossible(poses) == ""
    poses["epuck2"] = poses["epuck1"] + 0.01
    assert check.impossible(poses) == "epuck1 and epuck2 are in one place"


def test_a_frame_that_cannot_be_is_refused_as_a_whole():
    bench = Bench()
    bench.intake._impossible = lambda poses: "two in one place" if len(poses) > 1 else ""
    bench.say(7.0, Robot=0.1, Box=0.1)
    bench.say(7.01, Robot=0.1)
    assert [set(f[1]) for f in bench.frames] == [{"r"}]
    assert "two in one place; see lab.units" in bench.complaints[0]
