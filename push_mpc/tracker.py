"""Follow a trajectory: reference, LTV-MPC, end and failure conditions. No ROS, no clock of its own.

In a push the object is what counts. The reference for the robot is the trajectory moved by the
difference between the nominal and the measured place of the object in the robot frame, so that the
error is zero when the object, not the robot, is on its way.
"""

import math
import time
from collections import deque
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.kinematics import unicycle_step
from push_model.stable_push import CurvatureLimits, shifted_limits
from push_model.trajectory import Trajectory
from push_mpc.ltv_mpc import LtvMpc, MpcResult, Reference
from push_mpc.settings import TrackerSettings


class TrackError(IntEnum):
    """Why a trajectory ended early; the codes of the FollowTrajectory action."""

    NONE = 0
    INVALID_GOAL = 201
    POSES_STALE = 202
    STUCK = 203
    CONTACT_LOST = 204
    OFF_COURSE = 205
    SOLVER_FAILED = 206
    TIMEOUT = 207


@dataclass(frozen=True)
class Push:
    """What a push needs beside its trajectory.

    grasp: ``(3,)`` nominal pose of the object in the robot frame; limits: stable curvatures for it.
    """

    grasp: Array
    limits: CurvatureLimits


@dataclass(frozen=True)
class Task:
    """A trajectory to follow. circles: ``(m, 3)`` x, y, least distance of the axle midpoint [m]."""

    trajectory: Trajectory
    push: Push | None
    circles: Array
    position_tolerance: float
    orientation_tolerance: float


@dataclass(frozen=True)
class Tick:
    """Outcome of one tick: command, and whether the task has ended, and how."""

    v: float
    omega: float
    finished: bool
    code: TrackError
    message: str
    error: Array
    progress: float
    position_error: float
    orientation_error: float
    solve: MpcResult | None
    curvature_margin: float
    obstacle_margin: float
    object_offset: float


_NO_CIRCLES = np.zeros((0, 3))
_SOLVER_PATIENCE = 10  # failed solves in a row until the task is given up
_FADE = 0.1  # [s] in which the last command fades to zero while solves are late
_HALTED = 0.02  # of the nominal pace: slower than that, the reference stands still


class TrajectoryTracker:
    """Follows one task at a time."""

    def __init__(self, settings: TrackerSettings, mpc: LtvMpc) -> None:
        self.settings = settings
        self.mpc = mpc
        self.v = 0.0
        self.omega = 0.0
        self.failures = 0
        self.solves = 0
        self._task: Task | None = None

    @property
    def active(self) -> bool:
        """Whether there is a task."""
        return self._task is not None

    def warm_up(self) -> None:
        """Compile and solve once, so that the first command does not wait."""
        p = self.mpc.settings.horizon
        still = Reference(np.zeros((p + 1, 3)), np.zeros((p + 1, 3)))
        circles = np.array([[1.0, 0.0, 0.5]])[: self.mpc.settings.max_obstacles]
        self.mpc.solve(np.full(5, 1e-3), still, CurvatureLimits(-1.0, 1.0), circles)
        self.mpc.solve(np.full(5, 1e-3), still, None, _NO_CIRCLES)
        self.mpc.reset()

    def start(self, task: Task) -> None:
        """Begin a task; the reference starts with the next tick."""
        self._task = task
        self._time = 0.0
        self._overtime = 0.0
        self._lag = 0.0  # [m] behind the reference, at the tick before
        self._grasp = None if task.push is None else task.push.grasp.copy()
        self._grasp_seen = False
        self._lost = 0.0
        self._bad = 0
        self._faded = 1.0
        self._halted = 0.0
        self._history: deque[tuple[float, Array]] = deque()
        self._commanded = 0.0
        self._recent: deque[tuple[float, float, float]] = deque()
        self.mpc.reset()

    def stop(self) -> None:
        """Drop the task and the command."""
        self._task = None
        self.v = self.omega = 0.0

    def tick(
        self, dt: float, robot: Array, item: Array | None, others: Array = _NO_CIRCLES
    ) -> Tick:
        """One control tick.

        Parameters
        ----------
        dt: [s] since the previous tick.
        robot, item: measured poses ``(3,)``; item only matters in a push.
        others: ``(n, 3)`` moving obstacles where they are now, beside the task's circles.
        """
        task = self._task
        if task is None:
            raise RuntimeError("tick without a task")
        if len(others):
            task = replace(task, circles=np.vstack([task.circles, others]))
        robot = self._without_delay(robot, dt)
        shift = self._shift(task, dt, robot, item)
        reference = self._advance(task, dt, shift)
        error = self._error(robot, reference)
        self._lag = -float(error[0])
        gap, turn = self._final_errors(task, robot, item)
        room = self._room(task, robot)
        margin = float(room.min(initial=math.inf))
        offset = (
            0.0
            if task.push is None or self._grasp is None
            else float(self._grasp[1] - task.push.grasp[1])
        )
        limits = None
        if task.push is not None:
            trusted = task.push.limits.scaled(self.settings.friction_trust)
            limits = shifted_limits(trusted, offset)
        code, message = self._check(task, dt, robot, error)
        solve: MpcResult | None = None
        finished = code is not TrackError.NONE
        if not finished and self._reached(task, error, gap, turn, dt):
            finished = True
            if self._overtime > self.settings.settle_time and not self._good_enough(
                task, gap, turn, 3.0
            ):
                code = TrackError.TIMEOUT
                message = f"ended {1e3 * gap:.1f} mm and {turn:.3f} rad off"
        if finished:
            self.stop()
        else:
            solve = self._solve(error, reference, limits, self._nearest(task, room))
            self._apply(solve, dt, limits)
            if self._bad >= _SOLVER_PATIENCE:
                finished, code, message = True, TrackError.SOLVER_FAILED, solve.reason
                self.stop()
        curvature_margin = math.inf
        if limits is not None and self.v > 1e-3:
            kappa = self.omega / self.v
            curvature_margin = min(limits.maximum - kappa, kappa - limits.minimum)
        return Tick(
            self.v,
            self.omega,
            finished,
            code,
            message,
            error,
            min(1.0, self._time / task.trajectory.duration),
            gap,
            turn,
            solve,
            curvature_margin,
            margin,
            offset,
        )

    def _solve(
        self,
        error: Array,
        reference: Reference,
        limits: CurvatureLimits | None,
        circles: Array,
    ) -> MpcResult:
        """Solve; an answer after the deadline is as bad as none."""
        started = time.perf_counter()
        solve = self.mpc.solve(error, reference, limits, circles)
        late = time.perf_counter() - started
        if solve.solved and 0.0 < self.settings.deadline < late:
            return replace(solve, solved=False, late=True, reason=f"late: {1e3 * late:.1f} ms")
        return solve

    def _without_delay(self, robot: Array, dt: float) -> Array:
        """The robot's pose now, from the delayed one and the commands since."""
        self._recent.append((dt, self.v, self.omega))
        total = sum(step for step, _, _ in self._recent)
        while self._recent and total - self._recent[0][0] >= self.settings.pose_delay - 1e-9:
            total -= self._recent.popleft()[0]
        for step, v, omega in self._recent:
            robot = unicycle_step(robot, v, omega, step)
        return robot

    def _shift(self, task: Task, dt: float, robot: Array, item: Array | None) -> Array:
        """Place ``(3,)`` of the wanted robot frame in the trajectory's frame."""
        if task.push is None or item is None:
            return np.zeros(3)
        seen = se2.between(robot, item)
        if self._grasp is None or not self._grasp_seen:
            self._grasp, self._grasp_seen = seen, True
        else:
            gain = min(1.0, dt / max(self.settings.grasp_filter, dt))
            change = seen - self._grasp
            change[2] = se2.wrap(change[2])
            self._grasp = self._grasp + gain * change
        return se2.compose(task.push.grasp, se2.inverse(self._grasp))

    def _advance(self, task: Task, dt: float, shift: Array) -> Reference:
        """Move the reference on, slower when the robot lags behind."""
        s = self.settings
        rate = min(1.0, max(0.0, (s.lag_end - self._lag) / (s.lag_end - s.lag_begin)))
        ended = self._time >= task.trajectory.duration
        self._halted = self._halted + dt if rate < _HALTED and not ended else 0.0
        self._time = min(self._time + rate * dt, task.trajectory.duration)
        p, h = self.mpc.settings.horizon, self.mpc.settings.step
        pose, twist = task.trajectory.sample(self._time + rate * h * np.arange(p + 1))
        v, omega = rate * twist[:, 0], rate * twist[:, 1]
        c, sn = np.cos(pose[:, 2]), np.sin(pose[:, 2])
        moved = pose.copy()
        moved[:, 0] += c * shift[0] - sn * shift[1]
        moved[:, 1] += sn * shift[0] + c * shift[1]
        moved[:, 2] += shift[2]
        ahead, across = v - omega * shift[1], omega * shift[0]
        ct, st = math.cos(shift[2]), math.sin(shift[2])
        body = np.column_stack([ct * ahead + st * across, -st * ahead + ct * across, omega])
        return Reference(moved, body)

    def _error(self, robot: Array, reference: Reference) -> Array:
        """(2.37)."""
        x, y, theta = reference.pose[0]
        local = se2.between(np.array([x, y, se2.wrap(float(theta))]), robot)
        return np.array(
            [*local, self.v - reference.twist[0, 0], self.omega - reference.twist[0, 2]]
        )

    def _final_errors(self, task: Task, robot: Array, item: Array | None) -> tuple[float, float]:
        """Distance [m] and angle [rad] of what counts to where it shall end."""
        end = task.trajectory.pose[-1].copy()
        end[2] = se2.wrap(end[2])
        place = robot
        if task.push is not None and item is not None:
            end, place = se2.compose(end, task.push.grasp), item
        local = se2.between(end, place)
        return float(np.hypot(local[0], local[1])), abs(float(local[2]))

    def _reached(self, task: Task, error: Array, gap: float, turn: float, dt: float) -> bool:
        """Whether the reference has ended and the rest is settled or not worth waiting for."""
        if self._time < task.trajectory.duration:
            return False
        self._overtime += dt
        slow = abs(self.v) < 0.01 and abs(self.omega) < 0.1
        if task.push is not None:
            # A push cannot be undone: what is left across the way stays.
            along = -float(error[0])
            return (slow and along < 0.5 * task.position_tolerance) or (
                self._overtime > self.settings.settle_time
            )
        return (slow and self._good_enough(task, gap, turn, 1.0)) or (
            self._overtime > self.settings.settle_time
        )

    def _good_enough(self, task: Task, gap: float, turn: float, factor: float) -> bool:
        return (
            gap <= factor * task.position_tolerance and turn <= factor * task.orientation_tolerance
        )

    def _check(self, task: Task, dt: float, robot: Array, error: Array) -> tuple[TrackError, str]:
        s = self.settings
        off = float(np.hypot(error[0], error[1]))
        if off > s.off_course:
            return TrackError.OFF_COURSE, f"{1e3 * off:.0f} mm from the reference"
        if task.push is not None and self._grasp is not None:
            gap = float(self._grasp[0] - task.push.grasp[0])
            turn = abs(se2.wrap(float(self._grasp[2] - task.push.grasp[2])))
            aside = abs(float(self._grasp[1] - task.push.grasp[1]))
            apart = gap > s.contact_gap or turn > s.contact_turn or aside > 3.0 * s.contact_gap
            self._lost = self._lost + dt if apart else 0.0
            if self._lost > s.contact_time:
                return TrackError.CONTACT_LOST, (
                    f"the object is {1e3 * gap:.0f} mm ahead, {1e3 * aside:.0f} mm aside and "
                    f"{turn:.2f} rad turned from its place at the bumper"
                )
        if self._halted > s.blocked_time:
            return TrackError.STUCK, (
                f"the reference waited {s.blocked_time:.1f} s for the robot; is the way blocked?"
            )
        self._history.append((dt, robot))
        self._commanded += abs(self.v) * dt + abs(self.omega) * 0.03 * dt
        span = sum(step for step, _ in self._history)
        if span >= s.stuck_time:
            moved = se2.between(self._history[0][1], robot)
            way = float(np.hypot(moved[0], moved[1])) + 0.03 * abs(float(moved[2]))
            if self._commanded > s.stuck_way and way < 0.1 * self._commanded:
                return TrackError.STUCK, (
                    f"commanded {1e3 * self._commanded:.0f} mm in {span:.1f} s but moved "
                    f"{1e3 * way:.1f} mm"
                )
            self._history.clear()
            self._commanded = 0.0
        return TrackError.NONE, ""

    def _room(self, task: Task, robot: Array) -> Array:
        """``(m,)`` [m] of the robot to each obstacle's boundary."""
        c = task.circles
        room: Array = np.hypot(c[:, 0] - robot[0], c[:, 1] - robot[1]) - c[:, 2]
        return room

    def _nearest(self, task: Task, room: Array) -> Array:
        """The obstacles ``(n, 3)`` within reach, no more than the QP has rows for."""
        count = self.mpc.settings.max_obstacles
        reach = 1.5 * self.mpc.drive.max_speed * self.mpc.settings.step * self.mpc.settings.horizon
        close = np.flatnonzero(room < reach)
        if len(close) > count:
            close = close[np.argpartition(room[close], count)[:count]]
        return np.ascontiguousarray(task.circles[close])

    def _apply(self, solve: MpcResult, dt: float, limits: CurvatureLimits | None) -> None:
        """Algorithm 3: integrate the acceleration; without a solution stop, when late fade."""
        self.solves += 1
        if not solve.solved:
            self.failures += 1
            self._bad += 1
            left = max(0.0, self._faded - dt / _FADE) if solve.late else 0.0
            keep = left / self._faded if self._faded > 0.0 else 0.0
            self.v, self.omega, self._faded = self.v * keep, self.omega * keep, left
            return
        self._bad, self._faded = 0, 1.0
        v = self.v + dt * solve.acceleration[0]
        omega = self.omega + dt * solve.acceleration[1]
        if limits is not None:
            v = max(v, 0.0)
        self.v, self.omega = self.mpc.drive.saturate(v, omega)
