"""Section 2.3.2: slopes, constraints and optimum of the wheel-slip NMPC; garbage in."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.nmpc import Ipopt, arc, random_cases
from push_model.settings import SettingsError
from push_model.torque_robot import TorqueRobot
from push_mpc.torque_prediction import NEWTON, ROWS
from push_mpc.wheel_slip_nmpc import WheelSlipNmpc, WheelSlipSettings, beside
from push_scenario.scenario import load_scenario
from tests.samples import mostly_long

PIONEER = next(iter(load_scenario("pioneer").robots.values()))[0]
FULL = replace(WheelSlipSettings(), friction_trust=1.0, sideways_share=1.0)
"""(2.31)-(2.33) as printed."""


@pytest.fixture
def nmpc():
    return WheelSlipNmpc(FULL, PIONEER)


LOADS = [(0.0, 0.0), (8.0, -1.5)]
"""[N], [Nm]: nothing, and a box that is pushed round a bend."""


def rolled(nmpc, z, state, load):
    """States and inputs by Euler's rule, from the model itself."""
    robot, steps, step = nmpc.robot, nmpc.settings.horizon, nmpc.settings.step
    q, states, inputs = state.copy(), [], []
    for k in range(steps):
        j = 2 * min(k, len(z) // 2 - 1)
        a, eps = robot.accelerations(q[3], q[4], z[j], z[j + 1], load)
        inputs.append((z[j], z[j + 1]))
        states.append(q)
        rate = [np.cos(q[2]) * q[3], np.sin(q[2]) * q[3], q[4], a, eps]
        q = q + step * np.array(rate)
    return [*states, q], inputs


@pytest.mark.parametrize(("load", "share"), [(LOADS[0], 1.0), (LOADS[1], 1.0), (LOADS[1], 0.5)])
def test_rows_and_cost_are_those_of_the_model(load, share):
    nmpc = WheelSlipNmpc(replace(FULL, sideways_share=share), PIONEER)
    random = np.random.default_rng(1)
    for state, reference in random_cases(40, 3):
        z = random.uniform(-3, 3, 12)
        cost, _ = nmpc.evaluate(z, state, reference, load)
        states, inputs = rolled(nmpc, z, state, load)
        rows = nmpc._c[: ROWS * nmpc.settings.horizon].reshape(-1, ROWS)
        expected = 0.0
        for k, (right, left) in enumerate(inputs):
            v, omega = states[k][3:]
            margin = nmpc.robot.slip_margins(v, omega, right, left, 0.5, load, share)
            assert rows[k, :2] == pytest.approx(-NEWTON * margin, abs=0.011)  # rounded off
            loads = nmpc.robot.loads(v, omega, right, left, load)
            assert rows[k, 2:5] == pytest.approx(-NEWTON * loads, abs=1e-9)
            x, y, _, v, omega = states[k + 1]
            turn = nmpc.robot.half_track * omega
            speeds = np.array([v + turn, v - turn]) / nmpc.robot.radius
            most = PIONEER.drive.max_wheel_speed
            assert rows[k, 5:9] == pytest.approx([*(speeds - most), *(-speeds - most)], abs=1e-9)
            assert rows[k, 9:] == pytest.approx([x - 10, -x - 10, y - 10, -y - 10], abs=1e-9)
            error = states[k + 1] - reference[k + 1]
            c, s = np.cos(states[k + 1][2]), np.sin(states[k + 1][2])
            error[:2] = c * error[0] + s * error[1], -s * error[0] + c * error[1]
            factor = 4.0 if k == len(inputs) - 1 else 1.0
            expected += factor * float(np.array(FULL.state_weight) @ error**2)
        assert cost == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("load", LOADS)
def test_slopes_against_differences(nmpc, load):
    random = np.random.default_rng(2)
    for state, reference in random_cases(10, 5):
        z = random.uniform(-3, 3, 12)
        nmpc.evaluate(z, state, reference, load)
        g, G = nmpc._g.copy(), nmpc._G.copy()
        for i in range(12):
            h = 1e-6 * np.eye(12)[i]
            up, _ = nmpc.evaluate(z + h, state, reference, load)
            above = nmpc._c.copy()
            down, _ = nmpc.evaluate(z - h, state, reference, load)
            assert g[i] == pytest.approx((up - down) / 2e-6, abs=1e-5)
            assert G[:, i] == pytest.approx((above - nmpc._c) / 2e-6, abs=1e-5)


@pytest.mark.parametrize("constraint", mostly_long([True, False], 1))
def test_the_optimum_is_that_of_ipopt(constraint):
    """From nothing, and with the last solution; local, as both are: nearly always the same."""
    nmpc = WheelSlipNmpc(replace(FULL, constraint=constraint), PIONEER)
    rival = Ipopt(nmpc)
    over, pressed = [], 0
    for state, reference in random_cases(60, 8):
        nmpc.reset()
        z = nmpc.start.copy()
        ours = nmpc.solve(state, reference)
        assert ours.solved
        _, cost, _ = rival.solve(z, state, reference)
        over.append(ours.cost / cost - 1.0)
        slips = nmpc._c[: ROWS * 15].reshape(-1, ROWS)[:, :2]
        pressed += slips.max() > -1e-4
    assert np.median(over) < 1e-3 and np.quantile(over, 0.9) < 0.01, np.sort(over)[-8:]
    assert pressed > 30 or not constraint


def test_with_the_constraint_no_wheel_is_asked_for_more_than_friction(nmpc):
    free = WheelSlipNmpc(replace(FULL, constraint=False), PIONEER)
    slipped = 0
    for state, reference in random_cases(60, 9):
        state = np.array([*state[:3], 0.3, 0.0])  # rolls straight on: a feasible way exists
        for controller in (nmpc, free):
            controller.reset()
            right, left = controller.solve(state, reference).torques
            margin = controller.robot.slip_margins(state[3], state[4], right, left, 0.5).min()
            assert max(abs(right), abs(left)) <= PIONEER.drive.max_torque + 1e-9
            if controller is nmpc:
                assert margin > -0.1
            else:
                slipped += margin < -1.0
    assert slipped > 20


def test_headings_are_taken_on_the_turn_that_the_robot_is_in(nmpc):
    reference = arc(0.3, 0.4)
    state = np.array([0.0, 0.02, 0.1, 0.3, 0.4])
    plain = nmpc.solve(state, reference)
    for turns in (-2, 1, 5):
        nmpc.reset()
        other = reference.copy()
        other[:, 2] = np.angle(np.exp(1j * other[:, 2]))
        moved = state + [0.0, 0.0, 2.0 * np.pi * turns, 0.0, 0.0]
        assert nmpc.solve(moved, other).torques == pytest.approx(plain.torques, abs=1e-6)
    near = beside(np.array([0, 0, 3.1, 0, 0]), np.array([[0, 0, -3.1, 0, 0], [0, 0, 3.1, 0, 0]]))
    assert near[:, 2] == pytest.approx([-3.1 + 2 * np.pi, 3.1])


def test_what_is_not_finite_is_not_solved_and_leaves_nothing_behind(nmpc):
    good = nmpc.solve(np.zeros(5), arc(0.3, 0.0))
    for bad in (np.nan, np.inf):
        assert not nmpc.solve(np.array([0, 0, 0, bad, 0.0]), arc(0.3, 0.0)).solved
        broken = arc(0.3, 0.0)
        broken[3, 1] = bad
        result = nmpc.solve(np.zeros(5), broken)
        assert not result.solved and result.torques == (0.0, 0.0) and "finite" in result.reason
    assert nmpc.solve(np.zeros(5), arc(0.3, 0.0)).torques == good.torques


def test_a_robot_that_slides_already_gets_torques_all_the_same(nmpc):
    """No feasible way: the least violation, and finite."""
    result = nmpc.solve(np.array([0.0, 0.0, 0.0, 1.0, 4.0]), arc(0.3, 0.0))
    assert result.solved and result.violation > 0.0
    assert np.isfinite(result.torques).all()


def test_what_has_no_torques_or_no_caster_is_refused(robot):
    with pytest.raises(SettingsError, match="kind 'torque'"):
        WheelSlipNmpc(FULL, robot)
    with pytest.raises(SettingsError, match="one caster"):
        WheelSlipNmpc(FULL, replace(PIONEER, casters=(-0.2, 0.2)))
    with pytest.raises(SettingsError, match="control_horizon"):
        replace(FULL, control_horizon=16)
    with pytest.raises(SettingsError, match="state_weight"):
        replace(FULL, state_weight=(0.0,) * 5)


@pytest.mark.parametrize("load", LOADS)
def test_loads_carry_the_weight_and_tractions_the_motion(load):
    """Newton and Euler, written down anew: forces, moments about the axle, moments about z."""
    robot = TorqueRobot.of(PIONEER)
    drag, moment = load
    random = np.random.default_rng(4)
    for _ in range(300):
        v, omega, right, left = random.uniform([-1, -2, -4, -4], [1, 2, 4, 4])
        a, eps = robot.accelerations(v, omega, right, left, load)
        f_right, f_left, aside = robot.tractions(v, omega, right, left, load)
        loads = robot.loads(v, omega, right, left, load)
        assert loads.sum() == pytest.approx(robot.mass * 9.81)
        along = robot.body_mass * (a - robot.ahead * omega**2) + 2 * robot.wheel_mass * a
        assert f_right + f_left - drag == pytest.approx(along)
        about = robot.turning * eps + robot.body_mass * robot.ahead * v * omega
        assert (f_right - f_left) * robot.half_track + moment == pytest.approx(about)
        mass = robot.body_mass * (v * omega + robot.ahead * eps)
        assert aside == pytest.approx(mass + 2 * robot.wheel_mass * v * omega)
        plain = robot.loads(
            v, omega, right - 0.5 * drag * robot.radius, left - 0.5 * drag * robot.radius
        )
        leaned = (loads - plain)[2] * -robot.caster
        assert leaned == pytest.approx(drag * PIONEER.bumper_z, abs=1e-9)
