"""From a marker frame to a pose, against scipy's rotations run the other way round."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from lab_bridge.marker_mapping import Marker, MarkerMapping
from push_model import se2
from push_scenario.lab import (
    LabBody,
    LabSettings,
    PoseStampedSource,
    TwistLink,
    axes_matrix,
)

CHOICES = ["z_up", "y_up", ("z", "x", "y"), ("-y", "x", "z"), ("-z", "y", "x")]


def lab(**words):
    return LabSettings(poses=PoseStampedSource(), robots={"r": TwistLink(topic="/t")}, **words)


def measured(pose, offset, origin, axes, unit):
    """What a driver would tell of a body at a pose in the map."""
    planar = se2.compose(se2.inverse(np.array(origin)), se2.compose(pose, np.array(offset)))
    matrix = axes_matrix(axes)
    turn = matrix.T @ Rotation.from_euler("z", planar[2]).as_matrix() @ matrix
    position = matrix.T @ np.array([planar[0], planar[1], 0.07]) / unit
    return Marker(position, Rotation.from_matrix(turn).as_quat())


numbers = st.floats(-2.0, 2.0)
angles = st.floats(-math.pi, math.pi)
poses = st.tuples(numbers, numbers, angles)


@given(poses, poses, poses, st.sampled_from(CHOICES), st.sampled_from(["m", "mm"]))
def test_a_pose_is_found_again(pose, offset, origin, axes, units):
    mapping = MarkerMapping(
        lab(axes=axes, units=units, origin=origin, bodies={"box": LabBody("Box", offset)}), ["box"]
    )
    unit = {"m": 1.0, "mm": 1e-3}[units]
    placed = mapping.place("box", measured(np.array(pose), offset, origin, axes, unit))
    assert placed is not None
    assert placed.pose[:2] == pytest.approx(pose[:2], abs=1e-9)
    assert abs(se2.wrap(placed.pose[2] - pose[2])) < 1e-7  # scipy's and ours differ by rounding
    assert placed.height == pytest.approx(0.07) and placed.tilt < 1e-6


def test_wrong_axes_show_as_a_tilt():
    mapping = MarkerMapping(lab(axes="z_up"), ["box"])
    seen = measured(np.array([0.3, 0.2, 1.0]), (0, 0, 0), (0, 0, 0), "y_up", 1.0)
    placed = mapping.place("box", seen)
    assert placed is not None and placed.tilt > 0.5


@pytest.mark.parametrize(
    ("position", "quaternion"),
    [
        ([math.nan, 0, 0], [0, 0, 0, 1]),
        ([0, 0, math.inf], [0, 0, 0, 1]),
        ([0, 0, 0], [0, 0, 0, 0]),
        ([0, 0, 0], [0, math.nan, 0, 1]),
        ([0, 0, 0], [9, 9, 9, 9]),
    ],
)
def test_what_is_no_pose_is_refused(position, quaternion):
    mapping = MarkerMapping(lab(), ["box"])
    assert mapping.place("box", Marker(np.array(position), np.array(quaternion))) is None
