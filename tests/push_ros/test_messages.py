"""Conversions round-trip; nothing invalid gets past validation."""

import math

import numpy as np
import pytest
from geometry_msgs.msg import Pose, PoseStamped, Quaternion
from hypothesis import given
from hypothesis import strategies as st

from push_model import CurvatureLimits, PushSegment, line
from push_ros import conversions as c
from push_ros.validation import InvalidMessage, planar_pose, stamped_pose

numbers = st.floats(-100, 100)


@given(numbers, numbers, st.floats(-3.14, 3.14))
def test_pose_round_trip(x, y, theta):
    assert planar_pose(c.pose_to_ros(np.array([x, y, theta]))) == pytest.approx(
        [x, y, theta], abs=1e-9
    )


@given(st.integers(0, 10**7), st.integers(0, 999))
def test_time_round_trip(seconds, milli):
    t = seconds + 1e-3 * milli
    assert c.time_from_ros(c.time_to_ros(t)) == pytest.approx(t, abs=1e-6)


def test_trajectory_round_trip():
    t = line(np.array([1.0, 2.0, 0.5]), 0.3, 0.1, 0.1)
    back = c.trajectory_from_ros(c.trajectory_to_ros(t))
    for name in ("time", "pose", "twist"):
        assert np.array_equal(getattr(t, name), getattr(back, name))


def segment(turns=False):
    way = line(np.array([1.0, 2.0, 0.5]), 0.3, 0.1, 0.1)
    first, last = way.pose[0], way.pose[-1]
    limits = CurvatureLimits(-1.5, 2.0)
    item, after = first + [0.1, 0.0, 0.0], last + [0.1, 0.0, 0.0]
    return PushSegment(3, item, after, first, last, first, 0.3, 0.4, 0.3, limits, 0.02, way, turns)


@pytest.mark.parametrize("turns", [False, True])
def test_segment_round_trip(turns):
    there = segment(turns)
    back = c.segment_from_ros(c.segment_to_ros(there))
    for name, value in vars(there).items():
        if isinstance(value, np.ndarray):
            assert getattr(back, name) == pytest.approx(value, abs=1e-9)
        elif name != "trajectory":
            assert getattr(back, name) == value
    assert np.array_equal(back.trajectory.pose, there.trajectory.pose)


@pytest.mark.parametrize(
    "change", ["limits", "pose", "trajectory", "k_start", "k_end", "length", "clearance"]
)
def test_broken_segments_are_refused(change):
    message = c.segment_to_ros(segment())
    if hasattr(message, change) and change != "trajectory":
        setattr(message, change, math.nan)
    elif change == "limits":
        message.curvature_min = 0.5
    elif change == "pose":
        message.object_end.position.x = math.nan
    else:
        message.trajectory.x = message.trajectory.x[:-1]
    with pytest.raises(InvalidMessage):
        c.segment_from_ros(message)


def test_grid_round_trip(scenario):
    grid = scenario.grid
    back = c.grid_from_ros(c.grid_to_ros(grid, 1.0))
    assert np.array_equal(grid.occupied, back.occupied)
    assert back.resolution == pytest.approx(grid.resolution)
    assert back.origin == pytest.approx(grid.origin)


def test_unknown_cells_count_as_occupied(scenario):
    message = c.grid_to_ros(scenario.grid, 0.0)
    row, column = np.argwhere(~scenario.grid.occupied)[0]
    index = int(row * message.info.width + column)
    message.data[index] = -1
    assert c.grid_from_ros(message).occupied[row, column]


@pytest.mark.parametrize("change", ["short", "resolution", "turned", "nan"])
def test_broken_maps_are_refused(scenario, change):
    message = c.grid_to_ros(scenario.grid, 0.0)
    if change == "short":
        message.data = message.data[:-5]
    elif change == "resolution":
        message.info.resolution = 0.0
    elif change == "turned":
        message.info.origin.orientation = Quaternion(z=math.sin(0.5), w=math.cos(0.5))
    else:
        message.info.origin.position.x = math.nan
    with pytest.raises(InvalidMessage):
        c.grid_from_ros(message)


@given(*[st.floats()] * 7)
def test_any_pose_is_finite_or_refused(px, py, pz, x, y, z, w):
    """FAULTS 1 and 3."""
    message = Pose(orientation=Quaternion(x=x, y=y, z=z, w=w))
    message.position.x, message.position.y, message.position.z = px, py, pz
    try:
        assert np.isfinite(planar_pose(message)).all()
    except InvalidMessage:
        pass


def test_quaternion_policy():
    assert planar_pose(Pose(orientation=Quaternion(w=1.005)))[2] == 0.0
    for bad in (Quaternion(w=0.0), Quaternion(w=1.05), Quaternion(w=0.9)):
        with pytest.raises(InvalidMessage, match="quaternion"):
            planar_pose(Pose(orientation=bad))


def test_frame_must_be_the_fixed_one():
    message = PoseStamped()
    message.header.frame_id = "odom"
    with pytest.raises(InvalidMessage, match="'odom'"):
        stamped_pose(message, "the goal")


@given(st.lists(st.floats(), max_size=4), st.lists(st.floats(), max_size=4))
def test_any_trajectory_message_is_valid_or_refused(time, x):
    message = c.trajectory_to_ros(line(np.zeros(3), 0.1, 0.1, 0.1))
    message.time, message.x = time, x
    for name in ("y", "theta", "v", "omega"):
        setattr(message, name, [0.0] * len(time))
    try:
        t = c.trajectory_from_ros(message)
    except InvalidMessage:
        return
    assert np.isfinite(t.pose).all() and (np.diff(t.time) > 0).all()
