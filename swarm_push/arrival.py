"""When an object is at its target: with a margin, and in spite of noise. No ROS, no clock.

A target is not reached the moment that one noisy pose lies within the tolerance: the true pose may
lie outside. The pose is estimated by a line that is fitted to the last poses, which also tells how
noisy they are. The object is pushed on until the estimate is within the tolerances less a margin.
Where it cannot be brought that close, the target is reached at the best pose within the tolerances:
when the error grows again, or no longer becomes less.
"""

import math
from collections import deque

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.settings import bounded, settings

_WINDOW = 0.2  # [s] of poses that the line is fitted to
_JUMP = 0.1  # [m] between frames from which on the object was moved by hand
_SURE = 2.0  # standard deviations of the estimate that must fit within a tolerance
_MOST = 0.5  # of a tolerance that noise or a margin takes away at most
_BETTER, _WORSE = 0.05, 0.1  # of a tolerance: changes of the error that count
_MEMORY = 0.05  # weight of a new variance in the mean


@settings
class ArrivalSettings:
    """When a target is reached."""

    position_tolerance: float = bounded(
        0.02,
        low=1e-3,
        high=10.0,
        doc="Distance of the object's centre of mass from a target within which it is reached (m)",
    )
    orientation_tolerance: float = bounded(
        0.05,
        low=1e-3,
        high=4.0,
        doc="Heading error of the object within which a target is reached (rad)",
    )
    position_margin: float = bounded(
        0.01,
        low=0.0,
        high=1.0,
        doc="Margin by which the position error must stay below its tolerance for the push to end "
        "at once, at most half of the tolerance (m)",
    )
    orientation_margin: float = bounded(
        0.02,
        low=0.0,
        high=1.0,
        doc="Margin by which the heading error must stay below its tolerance for the push to end "
        "at once, at most half of the tolerance (rad)",
    )
    settle: float = bounded(
        3.0,
        low=0.0,
        high=60.0,
        doc="Time without a smaller error after which an object within the tolerances, but not "
        "within the margins, is taken to be at its target (s)",
    )


def pose_errors(pose: Array, target: Array) -> tuple[float, float]:
    """[m], [rad] between poses ``(3,)``; a target whose heading is nan has no heading error."""
    turn = 0.0 if math.isnan(target[2]) else abs(se2.wrap(float(pose[2] - target[2])))
    return math.hypot(pose[0] - target[0], pose[1] - target[1]), turn


class Arrival:
    """Decides whether an object has arrived.

    estimate: its pose ``(3,)`` [m, m, rad], with the noise filtered. deviation: ``(2,)`` [m],
    [rad], standard deviation of the estimate in one coordinate."""

    def __init__(self, settings: ArrivalSettings) -> None:
        self.settings = settings
        self.estimate, self.deviation = np.zeros(3), np.zeros(2)
        self._seen: deque[tuple[float, Array]] = deque()
        self._variance: Array | None = None  # of a pose: [m^2] of a coordinate, [rad^2]
        self.restart()

    def restart(self) -> None:
        """Another target, or the same elsewhere."""
        self._best, self._since = math.inf, 0.0

    def see(self, now: float, pose: Array) -> None:
        """Take a measured pose ``(3,)`` at a time [s]."""
        seen = self._seen
        if seen and now == seen[-1][0]:  # the same frame once more
            return
        if seen and (now < seen[-1][0] or np.hypot(*(pose - seen[-1][1])[:2]) > _JUMP):
            seen.clear()
        heading = float(pose[2]) if not seen else float(seen[-1][1][2])
        seen.append((now, np.array([*pose[:2], heading + se2.wrap(float(pose[2]) - heading)])))
        while now - seen[0][0] > _WINDOW + 1e-9:
            seen.popleft()
        count = len(seen)
        if count < 4:
            self.estimate = np.array(pose)
            return
        times = np.array([t for t, _ in seen]) - now
        poses = np.array([p for _, p in seen])
        middle, mean = float(times.mean()), poses.mean(axis=0)
        spread = times - middle
        total = float(spread @ spread)
        slope = spread @ poses / total
        squares = ((poses - mean - np.outer(spread, slope)) ** 2).sum(axis=0) / (count - 2)
        new = np.array([0.5 * (squares[0] + squares[1]), squares[2]])
        old = self._variance
        self._variance = new if old is None else old + _MEMORY * (new - old)
        end = 1.0 / count + middle**2 / total  # variance of the line's end over that of a pose
        self.deviation = np.sqrt(end * self._variance)
        self.estimate = mean - middle * slope
        self.estimate[2] = se2.wrap(float(self.estimate[2]))

    def reached(self, now: float, target: Array) -> bool:
        """Whether the job with a target ``(3,)``, heading nan where any will do, may end."""
        s = self.settings
        away, turned = pose_errors(self.estimate, target)
        limits = (s.position_tolerance, s.orientation_tolerance)
        margins = (s.position_margin, s.orientation_margin)
        rows = list(zip((away, turned), limits, margins, self.deviation, strict=True))
        if any(e > t - min(_SURE * d, _MOST * t) for e, t, _, d in rows):
            self.restart()
            return False
        if all(e <= t - min(m, _MOST * t) for e, t, m, _ in rows):
            return True
        part = max(e / t for e, t, _, _ in rows)
        if part < self._best - _BETTER:
            self._best, self._since = part, now
        return part > self._best + _WORSE or now - self._since > s.settle
