"""Follow a trajectory: reference, controller, end and failure conditions. No ROS, no clock.

In a push the object is tracked. The reference of the robot is the trajectory, shifted by the
deviation of the object from its nominal place in the robot frame. The error is then zero if the
object, not the robot, is on its path.

Poses are late. The object's pose in the robot frame is taken from poses of the same time, that of
the frame. Robot and object are then both predicted to the present with the commands since.
"""

import math
import time
from dataclasses import replace

import numpy as np

from push_estimation.dead_reckoning import DeadReckoning
from push_model import se2
from push_model.arrays import Array
from push_model.stable_push import CurvatureLimits, shifted_limits
from push_model.stick_certificate import stick_margin, trusted_limits
from push_model.trajectory import Trajectory
from push_mpc.checks import EndCheck, FailureCheck
from push_mpc.command import Command
from push_mpc.controller import Contact, MpcResult, PredictiveController, Reference
from push_mpc.grasp_estimate import GraspEstimate, distance
from push_mpc.reference_clock import ReferenceClock
from push_mpc.settings import TrackerSettings
from push_mpc.task import Push, Task, Tick, TrackError

_NO_CIRCLES = np.zeros((0, 3))
_REACH = 1.5  # times the distance of the horizon at full speed: farther obstacles cannot matter
_PUSHING = 0.005  # [m/s] below which a push has no curvature that matters
_LOOK = 0.1  # [s] between poses of the path ahead
_EXCESS = 0.02  # of the turn rate: less is not told from rounding
_MOVING = 1e-3  # [m/s]: below it, omega / v is noise, not curvature


class TrajectoryTracker:
    """Follows one task at a time."""

    def __init__(self, settings: TrackerSettings, controller: PredictiveController) -> None:
        self.settings = settings
        self.controller = controller
        self._command = Command(settings, controller.drive)
        self._reckoning = DeadReckoning(settings.pose_delay)
        self._in_force = (0.0, 0.0)  # the answer to the previous frame
        self._task: Task | None = None
        self._clock: ReferenceClock

    @property
    def active(self) -> bool:
        """Whether there is a task."""
        return self._task is not None

    @property
    def v(self) -> float:
        """[m/s] of the command."""
        return self._command.v

    @property
    def omega(self) -> float:
        """[rad/s] of the command."""
        return self._command.omega

    @property
    def solves(self) -> int:
        """Number of solves."""
        return self._command.solves

    @property
    def failures(self) -> int:
        """Number of solves that could not be used."""
        return self._command.failures

    @property
    def trajectory(self) -> Trajectory | None:
        """Of the task, if there is one."""
        return None if self._task is None else self._task.trajectory

    @property
    def push(self) -> Push | None:
        """What the task pushes, if it does."""
        return None if self._task is None else self._task.push

    def believe(self, push: Push | None, delay: float) -> None:
        """Go on with another belief: of the push under way, and of the latency [s] of the poses."""
        if self._task is not None and push is not None:
            self._task, self._changed = replace(self._task, push=push), True
        self._reckoning.delay = delay

    def warm_up(self) -> None:
        """Compile and solve once, so that the first command does not wait."""
        self.controller.warm_up()

    def start(self, task: Task, going_on: bool = False) -> None:
        """Begin a task; the reference starts with the next tick.

        going_on: the trajectory begins like the one under way, at the same contact. The reference
        goes on from where it is.
        """
        if going_on:
            if self._task is None:
                raise RuntimeError("there is no task to go on with")
            self._clock = self._clock.moved_to(task.trajectory)
            self._checks(task)
            return
        self._checks(task)
        self._clock = ReferenceClock(self.settings, task.trajectory)
        self._grasp = (
            None
            if task.push is None
            else GraspEstimate(task.push.grasp, self.settings.grasp_filter)
        )
        self._changed = False  # whether a belief was taken up in this task
        self._lag = 0.0  # [m] behind the reference in the previous tick
        self._command.start()
        self.controller.reset()

    def _checks(self, task: Task) -> None:
        """Take a task, and what tells whether it has ended or failed."""
        self._task = task
        self._end = EndCheck(self.settings, task)
        self._failure = FailureCheck(self.settings, self.controller.drive.half_track)

    def stop(self) -> None:
        """Drop the task and the command."""
        self._task = None
        self._command.stop()

    def rest(self, dt: float) -> None:
        """Answer a frame, dt [s] after the previous one, with zero; the task is kept."""
        self._reckoning.record(dt, *self._in_force)
        self._reckoning.forget(0.0)
        self._command.stop()
        self._in_force = (0.0, 0.0)

    def halt(self) -> None:
        """Command zero after an interruption that stopped the robot; keep the task."""
        self._reckoning.clear()
        self._command.stop()
        self._in_force = (0.0, 0.0)

    def tick(
        self,
        dt: float,
        robot: Array,
        item: Array | None,
        others: Array = _NO_CIRCLES,
        age: float = 0.0,
    ) -> Tick:
        """One control tick.

        Parameters
        ----------
        dt: [s] since the previous tick.
        robot: last measured pose ``(3,)``, ``age`` [s] before this frame: 0 when it is seen in it.
        item: pose ``(3,)`` of the pushed object in this frame, None when it is not seen in it.
        others: ``(n, 3)`` moving obstacles where they are now, beside the task's circles.
        """
        task = self._task
        if task is None:
            raise RuntimeError("tick without a task")
        if len(others):
            task = replace(task, circles=np.vstack([task.circles, others]))
        self._reckoning.record(dt, *self._in_force)
        at_frame = self._reckoning.at_frame(robot, age)
        robot = self._reckoning.now(at_frame)
        self._reckoning.forget(age)
        seen = None if item is None else se2.between(at_frame, item)
        grasp, contact = self._grasp, None
        if grasp is not None:
            grasp.update(dt, seen)
            item = se2.compose(robot, grasp.pose if seen is None else seen)
        if task.push is not None and grasp is not None:
            contact = self._contact(task.push, grasp)
        limits = None if contact is None else contact.limits
        self._clock.advance(dt, self._lag)
        reference = self._clock.reference(
            self.controller.horizon,
            self.controller.step,
            np.zeros(3) if grasp is None or self.settings.tracked == "robot" else grasp.shift,
            dt,
        )
        error = self._error(robot, reference)
        self._lag = -float(error[0])
        gap, turn = self._final_errors(task, robot, item)
        room = self._room(task, robot)
        code, message = self._failure.verdict(
            dt, robot, (self.v, self.omega), error, grasp, self._clock.halted
        )
        slip_in, alarm = math.nan, ""
        if limits is not None and self._changed:
            slip_in, alarm = self._slip_ahead(limits)
        if alarm and code is TrackError.NONE and self.settings.stop_before_slip:
            code, message = TrackError.SLIP_EXPECTED, alarm
        solve: MpcResult | None = None
        finished = code is not TrackError.NONE
        if (
            not finished
            and self._clock.ended
            and self._end.reached(dt, self.v, self.omega, self._lag, gap, turn)
        ):
            finished = True
            code, message = self._end.verdict(gap, turn)
        if finished:
            self.stop()
        else:
            solve = self._solve(error, reference, contact, self._nearest(task, room))
            self._command.apply(solve, dt, limits)
            if self._command.given_up:
                finished, code, message = True, TrackError.SOLVER_FAILED, solve.reason
                self.stop()
        self._in_force = (self.v, self.omega)
        curvature_margin, margin, push = math.inf, math.nan, task.push
        if grasp is not None and push is not None and push.uncertain and self.v > _PUSHING:
            margin = stick_margin(push.certified, self.v, self.omega, grasp.offset)
        if limits is not None and self.v > _MOVING:
            kappa = self.omega / self.v
            curvature_margin = min(limits.maximum - kappa, kappa - limits.minimum)
        return Tick(
            self.v,
            self.omega,
            finished,
            code,
            message,
            error,
            self._clock.progress,
            gap,
            turn,
            solve,
            curvature_margin,
            float(room.min(initial=math.inf)),
            0.0 if grasp is None else grasp.offset,
            margin,
            slip_in,
            alarm,
        )

    def _slip_ahead(self, limits: CurvatureLimits) -> tuple[float, str]:
        """In how many seconds the object would slip on the path ahead, and why; nan and empty if it
        sticks, as far as is believed.

        limits: curvatures that the controller may use, which it will not exceed.
        """
        times = self._clock.time + np.arange(0.0, self.settings.slip_warning + 1e-9, _LOOK)
        _, twist = self._clock.trajectory.sample(times)
        v, omega = twist.T
        excess = np.maximum(omega - limits.maximum * v, limits.minimum * v - omega)
        slips = np.flatnonzero((v > _PUSHING) & (excess > _EXCESS * np.abs(omega)))
        if not len(slips):
            return math.nan, ""
        first = slips[0]
        kappa = omega[first] / v[first]
        limit = limits.maximum if kappa > 0.0 else limits.minimum
        return first * _LOOK, (
            f"the object may slip in {first * _LOOK:.1f} s: the path has a curvature of "
            f"{kappa:.2f} 1/m there, and for what is believed now at most {limit:.2f} 1/m is safe"
        )

    def _contact(self, push: Push, grasp: GraspEstimate) -> Contact:
        """The contact at the object's actual place, with the trusted part of its friction."""
        trust = self.settings.friction_trust
        trusted = trusted_limits(push.limits, trust, push.certified)
        limits = shifted_limits(trusted, grasp.offset)
        if push.line is None:
            return Contact(limits)
        return Contact(limits, push.line.trusted(trust).moved(*grasp.away))

    def _solve(
        self,
        error: Array,
        reference: Reference,
        contact: Contact | None,
        circles: Array,
    ) -> MpcResult:
        """Solve; an answer after the deadline does not count."""
        started = time.perf_counter()
        solve = self.controller.solve(error, reference, contact, circles)
        late = time.perf_counter() - started
        if solve.solved and 0.0 < self.settings.deadline < late:
            return replace(solve, solved=False, late=True, reason=f"late: {1e3 * late:.1f} ms")
        return solve

    def _error(self, robot: Array, reference: Reference) -> Array:
        """(2.37)."""
        x, y, theta = reference.pose[0]
        local = se2.between(np.array([x, y, se2.wrap(float(theta))]), robot)
        return np.array(
            [*local, self.v - reference.twist[0, 0], self.omega - reference.twist[0, 2]]
        )

    def _final_errors(self, task: Task, robot: Array, item: Array | None) -> tuple[float, float]:
        """Distance [m] and angle [rad] of the tracked body to its end pose."""
        end = task.trajectory.pose[-1].copy()
        end[2] = se2.wrap(end[2])
        place = robot
        if task.push is not None and item is not None:
            end, place = se2.compose(end, task.push.grasp), item
        return distance(end, place)

    def _room(self, task: Task, robot: Array) -> Array:
        """``(m,)`` [m] distances of the robot to the obstacles' boundaries."""
        c = task.circles
        room: Array = np.hypot(c[:, 0] - robot[0], c[:, 1] - robot[1]) - c[:, 2]
        return room

    def _nearest(self, task: Task, room: Array) -> Array:
        """The obstacles ``(n, 3)`` within reach, at most as many as the controller takes."""
        controller = self.controller
        count = controller.max_obstacles
        reach = _REACH * controller.drive.max_speed * controller.step * controller.horizon
        close = np.flatnonzero(room < reach)
        if len(close) > count:
            close = close[np.argpartition(room[close], count)[:count]]
        return np.ascontiguousarray(task.circles[close])
