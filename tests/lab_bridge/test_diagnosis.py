"""The rules of the doctor on made-up facts: every mistake has its name, and a good lab has none."""

import math
from dataclasses import replace

import numpy as np
import pytest

from lab_bridge.capture_diagnosis import CaptureFacts, Room, Sample, diagnose_capture
from lab_bridge.findings import Weight
from lab_bridge.marker_mapping import Marker
from lab_bridge.robot_diagnosis import DriveTest, RobotFacts, diagnose_robots
from push_scenario.lab import LabBody, LabSettings, PoseArraySource, TwistLink

ROOM = Room(np.array([-1.5, -1.0]), np.array([1.5, 1.0]))
BODIES = ("epuck1", "box")
KIND = "geometry_msgs/msg/PoseArray"


def lab(**words):
    values = {"axes": "y_up", "units": "mm", "latency": 0.03, **words}
    return LabSettings(
        poses=PoseArraySource(topic="/mocap", order=("Robot 1", "Box")),
        robots={"epuck1": TwistLink(topic="/t")},
        bodies={"epuck1": LabBody("Robot 1"), "box": LabBody("Box")},
        **values,
    )


def marker(x, y, yaw, y_up=True, unit=1000.0):
    """A marker frame at a height of 5 cm."""
    half = yaw / 2
    if y_up:
        return Marker(
            unit * np.array([x, 0.05, -y]), np.array([0, math.sin(half), 0, math.cos(half)])
        )
    return Marker(unit * np.array([x, y, 0.05]), np.array([0, 0, math.sin(half), math.cos(half)]))


def facts(count=120, age=0.022, names=("Robot 1", "Box"), publishers=(KIND,), clock=0.0, **words):
    samples = []
    for k in range(count):
        stamp = 1000.0 + k / 120.0
        for name, place in zip(names, ((-0.6, 0.3, 0.4), (-0.4, -0.5, -0.2)), strict=True):
            seen = marker(*place, **words)
            samples.append(Sample(name, seen, stamp + clock, stamp + age))
    return CaptureFacts(("/mocap",), samples, {"/mocap": publishers}, KIND, others=("/other",))


def codes(found, weight=Weight.ERROR):
    return [f.code for f in found if f.weight is weight]


def test_a_good_lab_has_no_errors():
    found = diagnose_capture(facts(), lab(), BODIES, ROOM)
    assert not codes(found) and not codes(found, Weight.WARNING)
    (latency,) = [f.what for f in found if f.code == "LATENCY"]
    assert "of capture" in latency and "22.0 ms" in latency
    (rate,) = [f.what for f in found if f.code == "RATE"]
    assert ": 120 poses per second" in rate


@pytest.mark.parametrize(
    ("observed", "settings", "code", "words"),
    [
        (facts(0, publishers=()), lab(), "NO_POSES", "nobody publishes on /mocap in domain 0"),
        (facts(0, publishers=()), lab(), "NO_POSES", "topics with poses: /other"),
        (facts(0), lab(), "NO_POSES", "nothing arrives on /mocap"),
        (facts(0, publishers=("x/msg/Y",)), lab(), "WRONG_TYPE", "carries x/msg/Y"),
        (facts(publishers=(KIND, KIND)), lab(), "TWO_PUBLISHERS", "2 nodes publish on /mocap"),
        (facts(names=("Robot1", "Box")), lab(), "WRONG_NAME", "no pose of 'Robot 1'"),
        (facts(), lab(units="m"), "MILLIMETRES", "from the origin of a map of 3.6 m"),
        (facts(unit=1.0), lab(), "METRES", "of each other"),
        (facts(), lab(axes="z_up"), "WRONG_AXES", "heights differ"),
        (facts(y_up=False), lab(), "WRONG_AXES", "tilted"),
        (facts(), lab(origin=(9.0, 0.0, 0.0)), "OUTSIDE", "outside the map"),
    ],
)
def test_a_mistake_has_its_name(observed, settings, code, words):
    found = diagnose_capture(observed, settings, BODIES, ROOM)
    assert found[0].code == code and codes(found).count(code) >= 1
    assert set(codes(found)) == {code}
    assert any(words in f.what for f in found if f.code == code)


def test_the_right_name_and_axes_are_proposed():
    (found, *_) = diagnose_capture(facts(names=("Robot1", "Box")), lab(), BODIES, ROOM)
    assert "perhaps to 'Robot1'" in found.remedy
    (found, *_) = diagnose_capture(facts(), lab(axes="z_up"), BODIES, ROOM)
    assert "lab.axes: y_up" in found.remedy


def test_clocks():
    observed = facts()
    still = [Sample(s.marker, s.seen, 1000.0, s.arrived) for s in observed.samples]
    stale = CaptureFacts(("/mocap",), still, observed.publishers, KIND)
    assert codes(diagnose_capture(stale, lab(), BODIES, ROOM)) == ["STALE_CLOCK"]
    off = diagnose_capture(facts(clock=-37.0), lab(), BODIES, ROOM)
    assert codes(off, Weight.WARNING) == ["CLOCK_OFFSET"] and "+37.02 s" in off[0].what
    assert not codes(diagnose_capture(facts(clock=-37.0), lab(stamps="receipt"), BODIES, ROOM))
    late = diagnose_capture(facts(age=0.09), lab(), BODIES, ROOM)
    assert codes(late, Weight.WARNING) == ["LATENCY_DECLARED"]


def test_a_server_that_fails_is_quoted():
    observed = CaptureFacts(("vicon 10.0.0.1",), troubles=("vicon: no route",))
    (found,) = diagnose_capture(observed, lab(), BODIES, ROOM)
    assert found.code == "NO_POSES" and "no route" in found.what


def test_a_slow_stream_is_warned_of():
    observed = facts(40)
    slow = [Sample(s.marker, s.seen, s.stamp, 10 * s.arrived) for s in observed.samples]
    observed = CaptureFacts(("/mocap",), slow, observed.publishers, KIND)
    found = diagnose_capture(observed, lab(stamps="receipt"), BODIES, ROOM)
    assert codes(found, Weight.WARNING) == ["RATE"]


def drive(x, y, dyaw, turned, others=()):
    return DriveTest(0.03, 0.5, np.array([x, y, dyaw]), turned, others)


@pytest.mark.parametrize(
    ("test", "code", "words"),
    [
        (drive(0.03, 0.0, 0.0, 0.5), "DRIVES", "100 % of the way"),
        (drive(-0.03, 0.0, 0.0, -0.5), "ROBOT_REVERSED", "wrong way round"),
        (drive(0.03, 0.0, 0.0, -0.5), "WHEELS_SWAPPED", "turns the wrong way"),
        (drive(0.0, 0.03, 0.0, 0.5), "MARKER_YAW", "90 degrees"),
        (drive(-0.03, 0.0, 0.0, 0.5), "MARKER_YAW", "180 degrees"),
        (drive(0.0, 0.0, 0.0, 0.0), "NO_MOTION", "does not move"),
        (drive(0.0, 0.0, 0.0, 0.0, ("epuck2",)), "ROBOTS_SWAPPED", "epuck2 moved"),
        (drive(0.06, 0.0, 0.0, 0.5), "SCALE", "2.00 times"),
        (drive(0.03, 0.0, 0.0, 1.5), "SCALE", "turns 3.00 times"),
        (drive(0.03, 0.0, 0.0, 0.001), "NO_MOTION", "does not turn"),
        (drive(0.03, 0.0, 0.0, -0.001), "NO_MOTION", "does not turn"),
        (drive(0.001, 0.001, 0.0, 0.5), "NO_MOTION", "does not drive ahead"),
    ],
)
def test_a_drive_tells_what_is_wrong(test, code, words):
    (found,) = diagnose_robots(RobotFacts({"epuck1": ""}, {"epuck1": test}))
    assert found.code == code and words in found.what


def test_links():
    found = diagnose_robots(RobotFacts({"a": "no answer", "b": "", "c": ""}, {}, frozenset("b")))
    assert [f.code for f in found] == ["ROBOT_SILENT", "CONNECTED", "NOT_SEEN"]


def swapped(observed, change, marker="Box"):
    """Facts with some poses of a body changed."""
    samples = [change(k, s) if s.marker == marker else s for k, s in enumerate(observed.samples)]
    return replace(observed, samples=[s for s in samples if s is not None])


@pytest.mark.parametrize("bad", [np.full(4, np.nan), np.zeros(4)])
def test_poses_that_the_bridge_leaves_out_are_told(bad):
    def spoil(k, sample):
        return replace(sample, seen=Marker(sample.seen.position, bad))

    found = diagnose_capture(swapped(facts(), spoil), lab(), BODIES, ROOM)
    assert codes(found) == ["UNUSABLE"] and "120 of 120 poses of 'Box'" in found[0].what
    often = swapped(facts(), lambda k, s: spoil(k, s) if k % 3 else s)
    found = diagnose_capture(often, lab(), BODIES, ROOM)
    assert not codes(found) and codes(found, Weight.WARNING) == ["UNUSABLE"]


def test_every_body_is_looked_at():
    once = swapped(facts(), lambda k, s: s if k < 2 else None)
    (found,) = [f for f in diagnose_capture(once, lab(), BODIES, ROOM) if f.code == "RATE"]
    assert found.weight is Weight.WARNING and "only 1 poses of 'Box'" in found.what
    for body in ("Box", "Robot 1"):
        still = swapped(facts(), lambda k, s: replace(s, stamp=1000.0), body)
        assert codes(diagnose_capture(still, lab(), BODIES, ROOM)) == ["STALE_CLOCK"]


def test_what_is_right_is_no_error():
    """Stamps that are not used, markers at different heights, several nodes on /tf."""
    still = swapped(facts(), lambda k, s: replace(s, stamp=0.0))
    still = swapped(still, lambda k, s: replace(s, stamp=0.0), "Robot 1")
    found = diagnose_capture(still, lab(stamps="receipt"), BODIES, ROOM)
    assert not codes(found) and not codes(found, Weight.WARNING)

    def lift(k, sample):
        up = np.array([0.0, 250.0, 0.0])
        return replace(sample, seen=Marker(sample.seen.position + up, sample.seen.quaternion))

    found = diagnose_capture(swapped(facts(), lift), lab(), BODIES, ROOM)
    assert not codes(found) and codes(found, Weight.WARNING) == ["WRONG_AXES"]
    kind = "tf2_msgs/msg/TFMessage"
    both = replace(facts(publishers=(kind, kind)), expected=kind)
    found = diagnose_capture(both, lab(), BODIES, ROOM)
    assert not codes(found) and codes(found, Weight.WARNING) == ["TWO_PUBLISHERS"]


def test_a_robot_that_was_lost_while_it_drove_is_an_error():
    (found,) = diagnose_robots(RobotFacts({"epuck1": ""}, {"epuck1": None}))
    assert found.weight is Weight.ERROR and found.code == "NOT_SEEN"


def test_a_clock_that_is_off_is_told_once():
    """The ages of the bodies differ by some milliseconds."""
    late = swapped(facts(clock=-37.0), lambda k, s: replace(s, arrived=s.arrived + 0.02))
    found = diagnose_capture(late, lab(), BODIES, ROOM)
    assert [f.code for f in found].count("CLOCK_OFFSET") == 1
