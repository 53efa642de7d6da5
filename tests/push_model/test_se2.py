import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from push_model import se2

numbers = st.floats(-10, 10)
poses = st.tuples(numbers, numbers, st.floats(-math.pi, 3.14)).map(np.array)


@given(poses, poses)
def test_between_undoes_compose(a, b):
    back = se2.between(a, se2.compose(a, b))
    assert np.allclose(back[:2], b[:2], atol=1e-9)
    assert abs(se2.wrap(back[2] - b[2])) < 1e-9


@given(poses, st.lists(st.tuples(numbers, numbers), min_size=1, max_size=5))
def test_transform_agrees_with_homogeneous_matrices(pose, points):
    c, s = math.cos(pose[2]), math.sin(pose[2])
    matrix = np.array([[c, -s, pose[0]], [s, c, pose[1]], [0, 0, 1]])
    expected = [(matrix @ [x, y, 1])[:2] for x, y in points]
    assert np.allclose(se2.transform(pose, np.array(points)), expected)


@given(st.floats(-100, 100))
def test_wrap_is_the_same_angle_in_range(angle):
    wrapped = se2.wrap(angle)
    assert -math.pi <= wrapped <= math.pi
    assert math.isclose(math.cos(wrapped), math.cos(angle), abs_tol=1e-9)


@given(st.floats(-3.1, 3.1))
def test_quaternion_round_trip(theta):
    assert math.isclose(
        se2.yaw_from_quaternion(*se2.quaternion_from_yaw(theta)), theta, abs_tol=1e-12
    )
