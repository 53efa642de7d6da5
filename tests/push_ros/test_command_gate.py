"""The gate between commands and motors: FAULTS 13, row 10, and silence."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from push_ros.command_gate import CommandGate, Limits

NAMES = ("a", "b", "disc")


def gate(age=0.2, wall=math.inf):
    twist = np.array([[1.0, 0.0, 5.0], [1.0, 0.0, 5.0], [2.0, 2.0, 9.0]])
    return CommandGate(NAMES, Limits(twist, np.array([0.0, 3.0, 0.0]), age, wall))


def admit(g, names, twists, stamp=1.0, now=1.0, wall=0.0, fixed=False):
    return g.admit(names, np.array(twists, dtype=float).reshape(-1, 3), stamp, now, wall, fixed)


def test_good_commands_pass_unchanged_and_in_order():
    result = admit(gate(), ["disc", "a"], [[1, -1, 2], [0.5, 0, -1]])
    assert result.rows.tolist() == [2, 0] and not result.refused
    assert result.values.tolist() == [[1, -1, 2], [0.5, 0, -1]]


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("column", [0, 1, 2])
def test_what_is_not_finite_is_refused_robot_by_robot(bad, column):
    g = gate()
    twists = np.zeros((3, 3))
    twists[:, 0], twists[1, column] = 0.1, bad
    result = admit(g, list(NAMES), twists)
    assert result.rows.tolist() == [0, 2] and np.isfinite(result.values).all()
    assert len(result.refused) == 1 and result.refused[0].startswith("not finite: b")
    assert g.driving.tolist() == [True, False, True]


def test_absurd_sideways_and_fixed_frame_commands_are_refused():
    g = gate()
    result = admit(g, ["a", "b", "disc"], [[1.01, 0, 0], [0, 0, -5.1], [0, 2.1, 0]])
    assert result.rows.size == 0 and result.refused[0].startswith("absurd: a [1.01, 0.0, 0.0]")
    assert admit(g, ["a"], [[0.1, 0.01, 0]]).rows.size == 0  # two wheels move no robot sideways
    result = admit(g, ["a", "disc"], [[0.1, 0, 0], [0.1, 0.1, 0]], fixed=True)
    assert result.rows.tolist() == [2] and "fixed frame" in result.refused[0]


def test_unknown_names_and_names_that_stand_twice_are_refused():
    result = admit(gate(), ["moon", "a", "a", "b"], np.full((4, 3), [0.1, 0.0, 0.0]))
    assert result.rows.tolist() == [1 - 1, 1]
    assert result.refused == ["unknown or named twice: moon, a"]


@pytest.mark.parametrize(
    ("stamp", "fresh"),
    [(5.0, True), (4.8, True), (4.79, False), (5.01, False), (0.0, False), (-1.0, False)],
)
def test_only_answers_to_poses_of_late_are_obeyed(stamp, fresh):
    result = admit(gate(), ["a"], [[0.1, 0, 0]], stamp, 5.0)
    assert (result.rows.size == 1) is fresh
    assert fresh or "not a fresh one" in result.refused[0]
    assert admit(gate(), ["a"], [[0.1, 0, 0]], math.nan, 5.0).rows.size == 0


def test_who_drives_on_an_old_command_is_silent_once():
    g = gate(age=0.2)
    admit(g, ["a", "b", "disc"], [[0.1, 0, 0], [0, 0, 0], [0, 0.1, 0]], 1.0, 1.0)
    assert g.silent(1.2, 0.0).size == 0
    admit(g, ["disc"], [[0, 0.1, 0]], 1.2, 1.2)
    assert g.silent(1.21, 0.0).tolist() == [0]  # b stands, the disc was told anew
    assert g.silent(1.22, 0.0).size == 0 and g.driving.tolist() == [False, False, True]


def test_a_command_holds_from_the_frame_that_it_answers_not_from_when_it_came():
    g = gate(age=0.2)
    admit(g, ["a"], [[0.1, 0, 0]], 1.0, 1.19)
    assert g.silent(1.2, 0.0).size == 0
    assert g.silent(1.21, 0.0).tolist() == [0] and not g.driving.any()
    g.admit_torques("b", np.array([1.0, 1.0]), 1.0, 1.19, 0.0)
    assert g.silent(1.21, 0.0).tolist() == [1]


def test_a_motion_that_answers_an_older_frame_than_the_last_command_is_refused():
    g = gate()
    admit(g, ["a"], [[0, 0, 0]], 1.1, 1.1)
    late = admit(g, ["a", "disc"], [[0.1, 0, 0], [0.1, 0, 0]], 1.0, 1.11)
    assert late.rows.tolist() == [2] and not g.driving[0]
    assert late.refused == ["answers an older frame than the last command: a"]
    again = admit(g, ["a"], [[0.2, 0, 0]], 1.1, 1.12)
    assert again.rows.tolist() == [0] and g.driving[0], "of one frame, the last command counts"


def test_torques_that_answer_an_older_frame_are_taken():
    """A controller brakes by them when it refuses a frame whose stamp has gone back a little."""
    g = gate()
    g.admit_torques("b", np.array([1.0, 1.0]), 1.1, 1.1, 0.0)
    brake = g.admit_torques("b", np.array([-2.0, -2.0]), 1.0, 1.11, 0.0)
    assert brake.rows.size == 1 and not brake.refused


def test_a_late_order_to_stand_is_obeyed_and_does_not_let_older_motions_in():
    g = gate()
    admit(g, ["a"], [[0.1, 0, 0]], 1.1, 1.1)
    assert admit(g, ["a"], [[0, 0, 0]], 1.0, 1.11).rows.tolist() == [0] and not g.driving[0]
    assert admit(g, ["a"], [[0.1, 0, 0]], 1.05, 1.12).rows.size == 0


def test_after_the_clock_has_gone_back_commands_with_its_stamps_are_taken():
    g = gate()
    admit(g, ["a"], [[0.1, 0, 0]], 50.0, 50.0)
    g.restart()
    assert admit(g, ["a"], [[0.1, 0, 0]], 0.5, 0.5).rows.tolist() == [0]
    assert g.silent(0.7, 0.0).size == 0 and g.silent(0.71, 0.0).tolist() == [0]


def test_wall_time_counts_when_sim_time_crawls():
    g = gate(wall=0.5)
    admit(g, ["a"], [[0.1, 0, 0]], 1.0, 1.0, wall=100.0)
    assert g.silent(1.0, 100.4).size == 0
    assert g.silent(1.0, 100.6).tolist() == [0]
    g = gate()  # in lockstep a robot waits for as long as it takes
    admit(g, ["a"], [[0.1, 0, 0]], 1.0, 1.0, wall=100.0)
    assert g.silent(1.0, 1e6).size == 0


def test_torques_are_for_robots_that_take_them():
    g = gate()
    assert g.admit_torques("b", np.array([3.0, -3.0]), 1.0, 1.0, 0.0).values.tolist() == [[3, -3]]
    assert g.driving[1]
    for name, torque in [("a", [0.1, 0]), ("b", [3.1, 0]), ("b", [math.nan, 0]), ("x", [0, 0])]:
        result = g.admit_torques(name, np.array(torque), 1.0, 1.0, 0.0)
        assert result.rows.size == 0 and len(result.refused) == 1
    assert g.admit_torques("b", np.zeros(2), 0.5, 1.0, 0.0).rows.size == 0


number = st.floats(allow_nan=True, allow_infinity=True, width=64)


@given(
    st.lists(st.tuples(st.sampled_from([*NAMES, "moon"]), number, number, number), max_size=8),
    number,
    number,
)
def test_nothing_harmful_passes_whatever_comes(entries, stamp, now):
    g = gate()
    names = [e[0] for e in entries]
    twists = np.array([e[1:] for e in entries], dtype=float).reshape(-1, 3)
    result = g.admit(names, twists, stamp, now, 0.0)
    assert np.isfinite(result.values).all() and len(set(result.rows)) == len(result.rows)
    assert (np.abs(result.values) <= g.limits.twist[result.rows]).all()
    if result.rows.size:
        assert 0.0 < stamp <= now + 1e-5 and now - stamp <= 0.21
