"""Following a trajectory by torques, against the model of the robot; what ends it."""

from dataclasses import replace

import numpy as np
import pytest

from push_model.trajectory import line
from push_mpc.task import TrackError
from push_mpc.torque_tracker import SpeedEstimate, TorqueTracker, TorqueTrackerSettings
from push_mpc.wheel_slip_nmpc import NmpcResult, WheelSlipNmpc, WheelSlipSettings
from push_scenario.scenario import load_scenario

PIONEER = next(iter(load_scenario("pioneer").robots.values()))[0]
DT = 0.02


class Plant:
    """The robot without slip; ``drag`` [N] is what nobody models."""

    def __init__(self, robot, start, drag=0.0):
        self.robot, self.q, self.drag = robot, np.array([*start, 0.0, 0.0]), drag

    def step(self, torques, seconds=DT):
        right, left = torques or (0.0, 0.0)
        for _ in range(20):
            held = 0.5 * self.drag * self.robot.radius * np.sign(self.q[3])
            a, eps = self.robot.accelerations(self.q[3], self.q[4], right - held, left - held)
            v, theta = self.q[3], self.q[2]
            rate = [np.cos(theta) * v, np.sin(theta) * v, self.q[4], a, eps]
            self.q = self.q + seconds / 20 * np.array(rate)
        if torques is None:
            self.q[3:] = 0.0

    @property
    def wheels(self):
        turn = self.robot.half_track * self.q[4]
        return np.array([self.q[3] - turn, self.q[3] + turn]) / self.robot.radius


def tracker_of(**changes):
    nmpc = WheelSlipNmpc(WheelSlipSettings(), PIONEER)
    nmpc.warm_up()
    return TorqueTracker(replace(TorqueTrackerSettings(), **changes), nmpc)


def follow(tracker, plant, trajectory, ticks=1000, wheels=lambda plant: plant.wheels):
    tracker.start(trajectory)
    errors = []
    for _ in range(ticks):
        tick = tracker.tick(DT, plant.q[:3].copy(), wheels(plant))
        if tick.finished:
            return tick, errors
        errors.append(np.hypot(*tick.error[:2]))
        plant.step(tick.torques)
    raise AssertionError("no end")


@pytest.mark.parametrize("drag", [0.0, 5.0])
def test_a_line_is_followed_from_beside(drag):
    tracker = tracker_of()
    plant = Plant(tracker.controller.robot, [-0.3, 0.2, 0.1], drag)
    tick, errors = follow(tracker, plant, line(np.zeros(3), 3.0, 0.5, 0.5))
    assert tick.code is TrackError.NONE, tick.message
    assert errors[0] > 0.3 and np.mean(errors[-50:]) < 0.08
    assert tracker.failures == 0 and tracker.solves > 100


def test_the_speed_is_that_of_the_poses_whatever_the_wheels_do():
    robot = tracker_of().controller.robot
    random = np.random.default_rng(3)
    for gain in (0.2, 0.4, 1.0):
        estimate, plant = SpeedEstimate(robot, gain), Plant(robot, [0, 0, 0])
        off = []
        for k in range(300):
            torques = (0.4 * np.sin(0.1 * k), 0.4 * np.sin(0.1 * k + 0.5))
            plant.step(torques)
            noise = random.normal(0.0, [1e-4, 1e-4, 1e-4])
            estimate.update(DT, plant.q[:3] + noise, *torques)
            off.append([estimate.v - plant.q[3], estimate.omega - plant.q[4]])
        assert np.abs(off[50:]).max() < 0.05
    # torques that only spin the wheels: the poses win
    estimate = SpeedEstimate(robot, 0.4)
    for _ in range(100):
        estimate.update(DT, np.zeros(3), 5.0, 5.0)
    assert abs(estimate.v) < 0.3
    estimate.update(5.0, np.ones(3), 0.0, 0.0)  # long unseen
    assert estimate.v == estimate.omega == 0.0


def test_less_friction_is_trusted_while_a_wheel_slips_and_more_again_when_it_rolls():
    tracker = tracker_of()
    full = tracker.controller.trusted
    plant = Plant(tracker.controller.robot, [0, 0, 0])
    tracker.start(line(np.zeros(3), 20.0, 0.5, 0.5))
    seen = []
    for k in range(700):
        spinning = 20 <= k < 60
        wheels = plant.wheels + (3.0 if spinning else 0.0)
        tick = tracker.tick(DT, plant.q[:3].copy(), wheels)
        plant.step(tick.torques)
        seen.append(tracker.controller.trusted)
    assert seen[10] == full and min(seen) == pytest.approx(0.3 * full)
    assert seen[59] < 0.35 * full and seen[-1] > 0.8 * full
    steady = tracker_of(adapt=False)
    steady.start(line(np.zeros(3), 1.0, 0.5, 0.5))
    steady.tick(DT, np.zeros(3), np.array([50.0, 50.0]))
    assert steady.controller.trusted == full


def test_off_course_ends_it_and_so_does_an_end_far_away():
    tracker = tracker_of(off_course=0.2)
    tracker.start(line(np.zeros(3), 1.0, 0.5, 0.5))
    tick = tracker.tick(DT, np.array([0.0, 0.25, 0.0]))
    assert tick.finished and tick.code is TrackError.OFF_COURSE and tick.torques is None
    tracker = tracker_of(off_course=5.0, settle_time=0.0)
    tracker.start(line(np.zeros(3), 0.5, 0.5, 0.5))
    for _ in range(200):  # it does not move, whatever it is told
        tick = tracker.tick(DT, np.zeros(3))
        if tick.finished:
            break
    assert tick.code is TrackError.TIMEOUT and "500 mm" in tick.message
    assert not tracker.active
    with pytest.raises(RuntimeError):
        tracker.tick(DT, np.zeros(3))


def test_failed_solves_mean_standing_and_in_a_row_the_end(monkeypatch):
    tracker = tracker_of(solver_patience=4)
    tracker.start(line(np.zeros(3), 1.0, 0.5, 0.5))
    bad = NmpcResult((9.0, 9.0), False, np.inf, np.inf, 0, 0.0, "broken")
    good = tracker.controller.solve
    answers = iter([True, False, False, False, True, False, False, False, False])
    solve = lambda state, reference: good(state, reference) if next(answers) else bad  # noqa: E731
    monkeypatch.setattr(tracker.controller, "solve", solve)
    ticks = [tracker.tick(DT, np.zeros(3)) for _ in range(9)]
    assert [t.torques is None for t in ticks] == [False] + 3 * [True] + [False] + 4 * [True]
    assert [t.finished for t in ticks] == 8 * [False] + [True]
    assert ticks[-1].code is TrackError.SOLVER_FAILED and ticks[-1].message == "broken"


def test_the_reference_waits_while_there_are_no_poses():
    tracker = tracker_of()
    tracker.start(line(np.zeros(3), 3.0, 0.5, 0.5))
    tracker.tick(DT, np.zeros(3))
    before = tracker.reference()[0, 0]
    tick = tracker.tick(4.0, np.zeros(3))  # four seconds of silence
    assert not tick.finished and tracker.reference()[0, 0] - before < 0.05
