"""The age of a pose when the command that answers it takes effect, from commands and motion.

A command carries the stamp of the poses that it answers. The robot is seen to obey it in poses
whose stamps are later by the latency, and by the time that the robot takes to reach a speed. No
clock is compared with another. Within a window, what the commands amount to for a delay d is
compared with the turn and the travel that were seen. Offset and drift are left free, since they say
nothing about the delay; slip of the wheels that is steady goes into the drift.
"""

import math
from bisect import bisect_left

import numpy as np

from push_estimation.evidence import Contradiction, Verdict, log_mean, log_total
from push_model.arrays import Array
from push_model.belief import Interval
from push_model.settings import SettingsError, bounded, settings

_WINDOW = 2.0  # [s]
_HOLE = 0.15  # [s] between frames or commands that ends a window
_FEWEST = 14  # frames of a window
_UNEXPLAINED = 0.06  # share of the square of a commanded motion that may be missing
_SMALL = (1e-3, 6e-3)  # [m], [rad] root mean square that may be missing beside it
_MODEL = 0.02  # share of a commanded motion by which the model of it errs, as slip that varies does
_EXACT = (5e-5, 3e-4)  # [m], [rad] root mean square by which it errs beside that
_PLAIN = 0.05  # of the scatter's square: that of the motion below which a window tells nothing
_STALE = 2000  # commands that are kept at least
_OUTLIER = 0.01  # share of windows that anything may have happened in


@settings
class LatencySettings:
    """What is assumed of the latency of the poses, and how much a window counts."""

    low: float = bounded(
        0.0, low=0.0, high=1.0, doc="Lowest latency of the poses that the estimator considers (s)."
    )
    high: float = bounded(
        0.15,
        low=1e-3,
        high=1.0,
        doc="Highest latency of the poses that the estimator considers (s).",
    )
    step: float = bounded(
        1e-3, low=1e-4, high=0.1, doc="Resolution of the estimated latency of the poses (s)."
    )
    actuation_lag: float = bounded(
        0.0,
        low=0.0,
        high=1.0,
        doc="Time that the robot takes to reach a commanded speed, from its data sheet (s). It is "
        "subtracted from the measured delay.",
    )
    weight: float = bounded(
        0.8,
        low=0.01,
        high=1.0,
        doc="Exponent of the likelihood of one time window in the estimate of the latency "
        "(dimensionless). It is below 1 because the errors of the motion model are alike in "
        "successive windows.",
    )
    floor: float = bounded(
        3e-3,
        low=0.0,
        high=0.1,
        doc="Half width that is added to the interval of the estimated latency, for errors that "
        "all windows have in common (s).",
    )

    def __post_init__(self) -> None:
        if self.low + 2.0 * self.step > self.high:
            raise SettingsError(f"low {self.low} must be below high {self.high} by two steps")


class StreamLatency:
    """The probability of the latency, on a grid.

    windows: number that counted. strange: number in which the robot did not do what it was told.
    widened: number of times that new data contradicted the interval.
    """

    def __init__(self, prior: LatencySettings | None = None) -> None:
        self._settings = s = prior or LatencySettings()
        self._grid = np.arange(s.low, s.high + s.step / 2.0, s.step)
        self.windows = self.strange = self.widened = 0
        self.reset()
        self.prior = self.interval()

    def reset(self) -> None:
        """Know the prior only, and forget commands and poses."""
        self._start_anew()
        self.forget()

    def _start_anew(self) -> None:
        self._log = np.zeros(len(self._grid))
        self._contradiction = Contradiction()

    def forget(self) -> None:
        """Forget commands and poses, not what was learned."""
        self._stamps: list[float] = []
        self._sums: list[Array] = []  # (2,) [m], [rad] commanded before the stamp
        self._last = np.zeros(2)
        self._frames: list[tuple[float, Array]] = []
        self._complete: list[tuple[float, Array]] = []

    def command(self, stamp: float, v: float, omega: float) -> None:
        """A command [m/s, rad/s] and the stamp [s] of the poses that it answers."""
        if not all(math.isfinite(x) for x in (stamp, v, omega)):
            return
        if self._stamps and stamp <= self._stamps[-1]:
            if self._stamps[-1] - stamp < _HOLE:
                return  # the same again
            self.forget()
        if self._stamps:
            gap = stamp - self._stamps[-1]
            if gap > _HOLE:
                self.forget()
                self._sums.append(np.zeros(2))
            else:
                self._sums.append(self._sums[-1] + gap * self._last)
        else:
            self._sums.append(np.zeros(2))
        self._stamps.append(stamp)
        self._last = np.array([v, omega])
        if len(self._stamps) > 2 * _STALE:
            del self._stamps[:_STALE], self._sums[:_STALE]

    def pose(self, stamp: float, pose: Array) -> Verdict | None:
        """A pose ``(3,)`` of the robot and its stamp [s]; a verdict when a window is complete."""
        if not (math.isfinite(stamp) and np.isfinite(pose).all()):
            self._frames.clear()
            return None
        if self._frames and not 0.0 < stamp - self._frames[-1][0] <= _HOLE:
            self._frames.clear()
        self._frames.append((stamp, np.array(pose)))
        if stamp - self._frames[0][0] >= _WINDOW and len(self._frames) >= _FEWEST:
            self._complete, self._frames = self._frames, []
        # The commands of the whole window have to be known, for the shortest delay too.
        done = self._complete
        if not done or (
            self._stamps and self._stamps[-1] < done[-1][0] <= stamp < done[-1][0] + _HOLE
        ):
            return None
        self._complete = []
        return self._use(done)

    def interval(self) -> Interval:
        """[s] 95 %."""
        share = np.exp(self._log - self._log.max())
        edges = np.concatenate([self._grid - 0.5 * self._settings.step, [self._grid[-1]]])
        edges[0], edges[-1] = self._settings.low, self._settings.high
        total = np.concatenate([[0.0], np.cumsum(share)])
        low, value, high = np.interp([0.025, 0.5, 0.975], total / total[-1], edges)
        s = self._settings
        low, high = max(s.low, float(low) - s.floor), min(s.high, float(high) + s.floor)
        return Interval(float(value), low, high)

    def _use(self, frames: list[tuple[float, Array]]) -> Verdict | None:
        t = np.array([f[0] for f in frames])
        s, newest = self._settings, self._stamps[-1] if self._stamps else -math.inf
        oldest = self._stamps[0] if self._stamps else math.inf
        if newest < t[-1] - s.low - _HOLE or oldest > t[0] - s.high - s.actuation_lag:
            return None
        seen = np.array([f[1] for f in frames])
        seen[:, 2] = np.unwrap(seen[:, 2])
        log = np.zeros(len(self._grid))
        told, strange = False, False
        rows = np.column_stack([np.ones_like(t), t - t.mean()])
        project, _ = np.linalg.qr(rows)
        commanded = self._commanded(t)  # (delays, n, 2)
        heading = float(seen[:, 2].mean())
        travel = seen[:, :2] @ np.array([math.cos(heading), math.sin(heading)])
        bent = np.cos(seen[:, 2] - heading)
        for column, values in ((0, travel), (1, seen[:, 2])):
            model = commanded[:, :, column]
            if column == 0:  # as much of it as lies along the mean heading
                steps = np.diff(model, axis=1) * (bent[1:] + bent[:-1]) / 2.0
                model = np.concatenate([np.zeros((len(model), 1)), np.cumsum(steps, axis=1)], 1)
            y = values - project @ (project.T @ values)
            left = values[None] - model
            left = left - (left @ project) @ project.T
            errors = (left**2).sum(axis=1)
            scatter = float(((y[2:] - 2.0 * y[1:-1] + y[:-2]) ** 2).mean()) / 6.0
            moved = float(y @ y) / len(y)
            wanted = model - (model @ project) @ project.T
            asked = float((wanted**2).sum(axis=1).max()) / len(y)
            rest = float(errors.min()) / len(y)
            if rest > _UNEXPLAINED * asked + 4.0 * scatter + _SMALL[column] ** 2:
                strange = True
                continue
            if asked <= _PLAIN * scatter:
                continue  # nothing was commanded that could be told from a steady motion
            if moved <= 0.0:
                strange = True
                continue
            told = True
            free = len(y) - 3
            # Without noise, what is left is the error of the model, which decides nothing.
            unknown = len(y) * (_MODEL**2 * asked + _EXACT[column] ** 2)
            log -= 0.5 * free * np.log(errors + unknown)
        if strange:
            self.strange += 1
            return Verdict(
                False,
                sentence="the robot does not move as it is commanded; it may be blocked, or "
                "its pose is wrong",
            )
        if not told:
            return None
        return self._multiply(log)

    def _multiply(self, log: Array) -> Verdict:
        log = log - log_total(log)  # of a uniform prior, each window is a distribution
        log = np.logaddexp(
            math.log1p(-_OUTLIER) + self._settings.weight * log, math.log(_OUTLIER / len(log))
        )
        by_prior = log_mean(np.zeros(len(log)), log)
        self.windows += 1
        if self._contradiction.add(by_prior, log_mean(self._log, log)):
            self._start_anew()
            self.widened += 1
            return Verdict(
                True,
                True,
                "the latest motion contradicts the latency that was believed; the interval is that "
                "of the prior again",
            )
        self._log = self._log + log
        self._log -= self._log.max()
        return Verdict(True)

    def _commanded(self, t: Array) -> Array:
        """``(delays, n, 2)`` what had been commanded [m], [rad] until times ``(n,)``, by delay."""
        first = max(0, bisect_left(self._stamps, float(t[0]) - self._settings.high - 1.0) - 1)
        stamps = np.array(self._stamps[first:])
        sums = np.array(self._sums[first:])
        end = stamps[-1] + 1.0  # the last command holds
        stamps, sums = np.append(stamps, end), np.vstack([sums, sums[-1] + self._last])
        at = t[None, :] - self._grid[:, None] - self._settings.actuation_lag
        columns = [np.interp(at.ravel(), stamps, sums[:, k]).reshape(at.shape) for k in (0, 1)]
        return np.stack(columns, axis=-1)
