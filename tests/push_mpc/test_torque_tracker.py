"""Following a trajectory by torques, against the model of the robot; what ends it."""

from dataclasses import replace

import numpy as np
import pytest

from push_model.trajectory import along_curve, line
from push_mpc.task import TrackError
from push_mpc.torque_friction import FrictionTrustSettings
from push_mpc.torque_tracker import TorqueTracker, TorqueTrackerSettings
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


def tracker_of(friction=None, **changes):
    nmpc = WheelSlipNmpc(WheelSlipSettings(), PIONEER)
    nmpc.warm_up()
    settings = replace(TorqueTrackerSettings(), **changes)
    return TorqueTracker(settings, nmpc, friction=friction)


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
    assert errors[0] > 0.3 and np.mean(errors[-50:]) < 0.01
    assert tracker.observer.load[0] == pytest.approx(0.0 if drag == 0.0 else drag, abs=1.5)
    assert tracker.failures == 0 and tracker.solves > 100


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
    steady = tracker_of(FrictionTrustSettings(adapt=False))
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
    solve = lambda *given: good(*given) if next(answers) else bad  # noqa: E731
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


def test_without_a_solution_it_brakes_within_the_traction_and_then_stands(monkeypatch):
    """Neither free wheels nor locked ones: see tests/sim_bridge/test_torque_stop.py."""
    tracker = tracker_of(solver_patience=3)
    robot, plant = tracker.controller.robot, Plant(tracker.controller.robot, [0, 0, 0])
    tracker.start(line(np.zeros(3), 20.0, 0.6, 0.8))
    for _ in range(100):
        plant.step(tracker.tick(DT, plant.q[:3].copy(), plant.wheels).torques)
    assert plant.q[3] > 0.55
    bad = NmpcResult((9.0, 9.0), False, np.inf, np.inf, 0, 0.0, "broken")
    monkeypatch.setattr(tracker.controller, "solve", lambda *given: bad)
    ends, begin = [], plant.q[0]
    for _ in range(60):
        if tracker.active:
            tick = tracker.tick(DT, plant.q[:3].copy(), plant.wheels)
            ends.append(tick.finished)
            torques = tick.torques
        else:
            torques = tracker.rest(DT, plant.q[:3].copy())
        if torques is None:
            break
        v, omega = plant.q[3:]
        assert sum(torques) < 0.0
        assert robot.slip_margins(v, omega, *torques, 0.5, share=0.5).min() > 0.0
        plant.step(torques)
    assert torques is None and plant.q[3] < 0.05 and plant.q[0] - begin < 0.25
    assert ends == [False, False, True]
    # it stands from now on, whatever the noise of the poses looks like
    assert all(tracker.rest(DT, plant.q[:3] + 1e-3 * k) is None for k in range(5))


@pytest.mark.parametrize("latency", [2, 5])
def test_a_latency_that_is_known_costs_little(latency):
    """Frames come 40 and 100 ms late, along a bend; the error is of where the robot is."""
    turn = 0.6 * np.arange(0.0, 6.0, 0.01)
    way = np.column_stack([np.sin(turn), 1.0 - np.cos(turn)])
    curve = along_curve(way, turn, np.ones_like(turn), PIONEER.drive, 0.5, 0.5)
    found = []
    for late, known in ((0, 0.0), (latency, latency * DT), (latency, 0.0)):
        tracker, off = tracker_of(off_course=5.0, pose_delay=known), []
        plant = Plant(tracker.controller.robot, [0, 0, 0])
        seen = [(plant.q[:3].copy(), plant.wheels)] * (late + 1)
        tracker.start(curve)
        for k in range(250):
            seen.append((plant.q[:3].copy(), plant.wheels))
            pose, wheels = seen[-1 - late]
            plant.step(tracker.tick(DT, pose, wheels).torques)
            off.append(np.hypot(*(plant.q[:2] - curve.sample(np.array([DT * (k + 1)]))[0][0, :2])))
        found.append(np.sqrt(np.mean(np.square(off[50:]))))
    exact, made_good, ignored = found
    assert made_good < 1.2 * exact + 1e-3, found
    assert ignored > 1.5 * made_good, found


def test_frames_that_are_refused_move_no_estimate():
    """They come twice, or late: a wheel brakes at each, and no time passes."""
    tracker = tracker_of()
    tracker._standing = False
    for k in range(200):
        tracker._see(0.01, np.array([0.005 * k, 0.0, 0.0]), None)
    speed, ahead = tracker.observer.v, tracker.observer.ahead(tracker._sent)[0]
    told = [tracker.brake() for _ in range(20)]
    assert speed == pytest.approx(0.5, abs=0.02)
    assert all(torques is not None and max(torques) < 0.0 for torques in told)
    assert tracker.observer.v == speed and tracker.observer.ahead(tracker._sent)[0] == ahead
