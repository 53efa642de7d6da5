"""Stretches of a push, cut from the poses of a robot and an object.

Contact is told from poses alone. A frame belongs to a push when the bumper is at a side of the
object and neither leaves it nor enters it: the gap is small, and it stays the same while the robot
drives forward. A stretch ends after a fixed distance of travel. Straight lines are fitted to what
was seen in it. The noise of the poses is the scatter about these lines.
"""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from push_estimation.line_push_model import Bumper
from push_estimation.pushed_side import FACING, REACH, Facing, PushedSides
from push_model import se2
from push_model.arrays import Array

_GAP = 0.005  # [m] between bumper and side that may still be contact
_SLOWEST = 0.01  # [m/s] of the robot in a push
_LEAVES = 0.12  # of the robot's speed: rate of the gap that is no contact
_WAY = 0.02  # [m] of travel in a stretch
_LONGEST = 1.2  # [s] of a stretch
_HOLE = 0.1  # [s] between frames that ends a stretch
_FEWEST = 8  # frames of a stretch
_KNOTS = 5  # instants at which the prediction is compared
_NOISES = 40  # stretches over which the scatter is averaged


@dataclass(frozen=True)
class Window:
    """A stretch of a push.

    facing: the side. start: q [m] and phi [rad] at the beginning. drives: ``(k, 2)`` v [m/s] and
    omega [rad/s] of the robot, each for ``step`` [s]. slopes: ``(2,)`` rates of q and phi. weights:
    ``(k + 1,)`` that make such a rate from the values at the knots. noise: ``(2,)`` standard
    deviations of the slopes. way: [m] of travel. time: [s] of its end. speed: [m/s].
    """

    facing: Facing
    start: tuple[float, float]
    drives: Array
    step: float
    slopes: Array
    weights: Array
    noise: Array
    way: float
    time: float
    speed: float


class PushWindows:
    """Cuts a stream of frames into windows.

    scatter: ``(5,)`` standard deviations of a single frame, from the residuals of the stream: q
    [m], phi [rad], gap [m], and the robot's position [m] and heading [rad]; nan before a window.
    """

    def __init__(self, outline: Array, bumper: Bumper) -> None:
        """outline: ``(n, 2)`` [m] of the object in its frame."""
        self._bumper, self._sides = bumper, PushedSides(outline, bumper)
        self.reset()

    def reset(self) -> None:
        """Forget the stretch under way, not the noise."""
        self._frames: list[tuple[float, Array, Array]] = []
        self._seen: list[Array] = []
        self._facing: Facing | None = None
        if not hasattr(self, "_noises"):
            self._noises: deque[Array] = deque(maxlen=_NOISES)

    @property
    def scatter(self) -> Array:
        """See the class."""
        if not self._noises:
            return np.full(5, np.nan)
        result: Array = np.sqrt(np.median(np.array(self._noises), axis=0))
        return result

    def add(self, time: float, robot: Array, item: Array) -> Window | None:
        """Take a frame: its time [s] and the poses ``(3,)``; a window when one is complete."""
        if not (math.isfinite(time) and np.isfinite(robot).all() and np.isfinite(item).all()):
            self.reset()
            return None
        if self._frames and not 0.0 < time - self._frames[-1][0] <= _HOLE:
            self.reset()
        rel = se2.between(item, robot)
        facing = self._facing or self._sides.near(rel)
        seen = None if facing is None else self._sides.place(rel, facing)
        if seen is None or abs(seen[1]) > FACING or abs(seen[2]) > REACH:
            self.reset()
            return None
        self._facing = facing
        self._frames.append((time, np.array(robot), np.array(item)))
        self._seen.append(seen)
        first = self._frames[0]
        lasted = time - first[0]
        way = math.hypot(*(robot - first[1])[:2])
        turned = abs(se2.wrap(float(robot[2] - first[1][2]))) * self._bumper.distance
        if len(self._frames) < _FEWEST or (max(way, turned) < _WAY and lasted < _LONGEST):
            return None
        window = self._cut()
        last = self._frames[-1]
        self._frames, self._seen = [last], [seen]
        return window

    def _cut(self) -> Window | None:
        """The stretch as a window; None when it is no steady push."""
        facing = self._facing
        assert facing is not None
        times = np.array([f[0] for f in self._frames])
        middle = float(times.mean())
        t = times - middle
        seen = np.array(self._seen)
        robot = np.array([f[1] for f in self._frames])
        if (robot == robot[0]).all():  # frozen poses say nothing of the noise
            return None
        robot[:, 2] = np.unwrap(robot[:, 2])
        spread = float(t @ t)
        lines, scatter = _fitted(t, seen, 1)
        # A change of slip within the stretch is no noise: only the scatter about a parabola is.
        _, scatter = _fitted(t, seen, 2)
        path, shake = _fitted(t, robot, 3)
        self._noises.append(np.array([*scatter, (shake[0] + shake[1]) / 2.0, shake[2]]))
        sigma = self.scatter
        knots = np.linspace(t[0], t[-1], _KNOTS)
        step = float(knots[1] - knots[0])
        at = (knots[1:] + knots[:-1]) / 2.0
        speeds = (at[:, None] ** [0, 1, 2]) @ (path[1:] * [[1.0], [2.0], [3.0]])
        headings = (at[:, None] ** [0, 1, 2, 3]) @ path[:, 2]
        v = speeds[:, 0] * np.cos(headings) + speeds[:, 1] * np.sin(headings)
        gap, closing = lines[0, 2], lines[1, 2]
        speed = float(v.mean())
        error = float(sigma[2]) / math.sqrt(spread)
        if speed < _SLOWEST or abs(gap) > _GAP + 2.0 * sigma[2] / math.sqrt(len(t)):
            return None
        if abs(closing) > _LEAVES * speed + 2.0 * error:
            return None
        weights = np.array([t @ np.interp(t, knots, row) for row in np.eye(_KNOTS)]) / spread
        start = lines[0, :2] + t[0] * lines[1, :2]
        return Window(
            facing,
            (float(start[0]), float(start[1])),
            np.column_stack([v, speeds[:, 2]]),
            step,
            lines[1, :2],
            weights,
            sigma[:2] / math.sqrt(spread),
            speed * float(times[-1] - times[0]),
            float(times[-1]),
            speed,
        )


def _fitted(t: Array, table: Array, degree: int) -> tuple[Array, Array]:
    """Coefficients ``(degree + 1, k)`` of polynomials fitted to columns, and variances ``(k,)``."""
    rows = t[:, None] ** np.arange(degree + 1)[None]
    found = np.asarray(np.linalg.lstsq(rows, table, rcond=None)[0], dtype=np.float64)
    left: Array = table - rows @ found
    scatter: Array = (left**2).sum(axis=0) / max(1, len(t) - degree - 1)
    return found, scatter
