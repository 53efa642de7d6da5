"""Checks for the end and for the failure of a task."""

from collections import deque

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_mpc.grasp_estimate import GraspEstimate
from push_mpc.settings import TrackerSettings
from push_mpc.task import Task, TrackError

Verdict = tuple[TrackError, str]
FINE: Verdict = (TrackError.NONE, "")

_ALONG = 0.5  # of the tolerance: a push continues until this much is left along its path
_NEARLY = 3.0  # times the tolerances: a smaller error is left to the next plan and is no failure
_MOVED = 0.1  # of the commanded distance: even slipping wheels achieve more


class EndCheck:
    """Whether the tracked body has come to rest at its end, or the wait for it is over."""

    def __init__(self, settings: TrackerSettings, task: Task) -> None:
        self._settings = settings
        self._task = task
        self._overtime = 0.0

    def reached(
        self, dt: float, v: float, omega: float, along: float, gap: float, turn: float
    ) -> bool:
        """Whether to end, after dt [s] more without a reference.

        along: [m] that the robot is behind its end. gap, turn: [m], [rad] of the tracked body.
        """
        self._overtime += dt
        s = self._settings
        slow = abs(v) < s.rest_speed and abs(omega) < s.rest_turn_rate
        late = self._overtime > s.settle_time
        if self._task.push is not None:
            # A push cannot be undone: a lateral error stays.
            return (slow and along < _ALONG * self._task.position_tolerance) or late
        return (slow and self._within(gap, turn, 1.0)) or late

    def verdict(self, gap: float, turn: float) -> Verdict:
        """Verdict on a task that has ended."""
        late = self._overtime > self._settings.settle_time
        if late and not self._within(gap, turn, _NEARLY):
            return (
                TrackError.TIMEOUT,
                f"the trajectory ended with an error of {1e3 * gap:.1f} mm and {turn:.3f} rad",
            )
        return FINE

    def _within(self, gap: float, turn: float, factor: float) -> bool:
        t = self._task
        return gap <= factor * t.position_tolerance and turn <= factor * t.orientation_tolerance


class FailureCheck:
    """Checks for off course, contact lost, blocked and stuck, in this order.

    lever: [m] by which a turn is converted into a distance; that of the wheels.
    """

    def __init__(self, settings: TrackerSettings, lever: float) -> None:
        self._settings = settings
        self._lever = lever
        self._lost = 0.0
        self._history: deque[tuple[float, Array]] = deque()
        self._commanded = 0.0

    def verdict(
        self,
        dt: float,
        robot: Array,
        command: tuple[float, float],
        error: Array,
        grasp: GraspEstimate | None,
        halted: float,
    ) -> Verdict:
        """One tick.

        Parameters
        ----------
        robot: ``(3,)`` pose. command: v, omega of the last dt [s]. error: ``(5,)`` of (2.37).
        grasp: in a push. halted: [s] that the reference has waited.
        """
        for code, message in (
            self._off_course(error),
            FINE if grasp is None else self._contact(dt, grasp),
            self._blocked(halted),
        ):
            if code is not TrackError.NONE:
                return code, message
        return self._stuck(dt, robot, command)

    def _off_course(self, error: Array) -> Verdict:
        off = float(np.hypot(error[0], error[1]))
        if off > self._settings.off_course:
            return TrackError.OFF_COURSE, f"the robot is {1e3 * off:.0f} mm from its reference"
        return FINE

    def _contact(self, dt: float, grasp: GraspEstimate) -> Verdict:
        s = self._settings
        gap, aside, turn = grasp.apart
        apart = gap > s.contact_gap or turn > s.contact_turn or aside > s.contact_aside
        self._lost = self._lost + dt if apart else 0.0
        if self._lost > s.contact_time:
            return TrackError.CONTACT_LOST, (
                f"the object is {1e3 * gap:.0f} mm ahead, {1e3 * aside:.0f} mm aside and "
                f"{turn:.2f} rad turned from its place at the bumper"
            )
        return FINE

    def _blocked(self, halted: float) -> Verdict:
        limit = self._settings.blocked_time
        if halted > limit:
            return TrackError.STUCK, (
                f"the reference waited {limit:.1f} s for the robot, which seems blocked"
            )
        return FINE

    def _stuck(self, dt: float, robot: Array, command: tuple[float, float]) -> Verdict:
        s = self._settings
        self._history.append((dt, robot))
        self._commanded += abs(command[0]) * dt + abs(command[1]) * self._lever * dt
        span = sum(step for step, _ in self._history)
        if span >= s.stuck_time:
            moved = se2.between(self._history[0][1], robot)
            way = float(np.hypot(moved[0], moved[1])) + self._lever * abs(float(moved[2]))
            if self._commanded > s.stuck_way and way < _MOVED * self._commanded:
                return TrackError.STUCK, (
                    f"the robot was commanded {1e3 * self._commanded:.0f} mm in {span:.1f} s "
                    "but moved "
                    f"{1e3 * way:.1f} mm"
                )
            self._history.clear()
            self._commanded = 0.0
        return FINE
