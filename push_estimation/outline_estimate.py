"""The outline of an object, from where robots have been and where the object has stopped them.

A round robot of radius R whose centre is at c in the object's frame shows that no part of the
object is within R of c. A robot that the object stops shows that its outline is at R from c. The
line on which the centres of touching robots lie is the zero level of

    phi(x) = phi_0(x) + delta(x),

where phi_0 is the distance of x from that line of the first outline, positive outside, and delta is
the function of least norm in the reproducing kernel Hilbert space of a Matern kernel (nu = 3/2)
with

    phi(c) >= 0 where a robot has been,    phi(c) = 0 where one was stopped,
    phi(c) <= -h / 2 at a distance h ahead of one that was stopped and did not even slide.

This is the mean of a Gaussian process implicit surface (Williams and Fitzgibbon 2006) with
inequalities. Its coefficients solve a quadratic programme over the places where these hold with
equality.
"""

import math

import numpy as np
from contourpy import LineType, contour_generator
from scipy.optimize import lsq_linear
from scipy.spatial import cKDTree

from push_estimation.sightings import BLOCKED, Sightings
from push_model.arrays import Array
from push_model.outlines import distance, inside
from push_model.settings import bounded, settings
from push_model.shapes import densified

_LEVEL = 6e-3  # [m] of the grid on which the level is looked for
_ADDED, _ROUNDS = 10, 6  # violated places that are added at a time, and how often
_SPACED = 0.012  # [m] between places that are added at a time
_MOST = 250  # places that hold with equality
_SCALE = 0.03  # [m] of the errors that a first outline has
_THIN = 1e-4  # [m^2] of an outline, at least
_OFF = 8e-4  # [m] by which a corner that is left out lies beside the line of the others
_DENSE = 2e-3  # [m] between points of a line whose distance is computed
_SEEN = 0.015  # [m] from where a robot was, within which the line of contact counts as explored


@settings
class OutlineSettings:
    """How smooth an outline is taken to be, and how exact sightings are."""

    smooth: float = bounded(
        0.08,
        low=5e-3,
        high=1.0,
        doc="Length scale of the Gaussian process of the outline estimate: the distance along "
        "which the error of the first outline changes noticeably (m)",
    )
    slack: float = bounded(
        1e-3,
        low=0.0,
        high=0.05,
        doc="Depth by which the centre of a robot may have been inside the estimated line of "
        "contact (the line of the centres of touching robots) before the outline estimate is "
        "changed (m)",
    )
    error: float = bounded(
        1.5e-3,
        low=1e-5,
        high=0.05,
        doc="Standard deviation of a robot's position in the frame of the object that the outline "
        "estimate assumes (m)",
    )
    contradicted: int = bounded(
        5,
        low=1,
        high=1000,
        doc="Number of contradictions at which the outline estimate starts anew: places where one "
        "robot was stopped and another has been, in excess of the places without a contradiction",
    )


class OutlineEstimate:
    """The outline of one object, in its frame.

    outline ``(n, 2)`` [m], counter-clockwise: the estimate of the last ``fit``. forgotten: how
    often all was forgotten, because what was seen contradicts itself.
    """

    def __init__(
        self, first: Array, radius: float, settings: OutlineSettings | None = None
    ) -> None:
        """first: ``(n, 2)`` [m] what is believed before anything is seen. radius: [m] of robots."""
        self.settings = settings or OutlineSettings()
        self._first, self._radius = np.array(first), radius
        low, high = first.min(axis=0), first.max(axis=0)
        room = 2.0 * radius + 0.3 * float((high - low).max())
        self._xs = np.arange(low[0] - room, high[0] + room + _LEVEL, _LEVEL)
        self._ys = np.arange(low[1] - room, high[1] + room + _LEVEL, _LEVEL)
        self._grid = np.stack(np.meshgrid(self._xs, self._ys), axis=-1).reshape(-1, 2)
        self._level = self._before(self._grid)
        self.forgotten = 0
        self._forget()

    def _forget(self) -> None:
        self.outline = self._first
        self.sightings = Sightings(self._grid[0], self._grid[-1])
        self._stopped = self._blocked = self._passed = np.zeros((0, 2))
        self._weights = np.zeros(0)
        self._doubt = 0

    def been(self, points: Array) -> None:
        """Robots were at ``(n, 2)`` [m]."""
        self.sightings.been(points)

    def stopped(self, point: Array, way: Array | None = None) -> None:
        """The object stopped a robot at ``(2,)`` [m]; see ``Sightings.stopped``."""
        self.sightings.stopped(point, way)

    def depth(self, points: Array) -> Array:
        """``(n,)`` [m] by which ``(n, 2)`` lie inside the line of contact, negative outside."""
        depths: Array = -(self._before(points) + self._change(points))
        return depths

    def outward(self, point: Array) -> Array:
        """``(2,)`` unit normal of the line of contact near a point ``(2,)`` [m]."""
        step = 5e-3 * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
        depth = self.depth(point + step)
        slope = np.array([depth[1] - depth[0], depth[3] - depth[2]])
        unit: Array = slope / max(float(np.hypot(*slope)), 1e-12)
        return unit

    def explored(self) -> float:
        """Share of the line of contact along which robots have been."""
        been = self.sightings.places
        if not len(been):
            return 0.0
        line = _largest(self._xs, self._ys, self._levels())
        if line is None:
            return 0.0
        away, _ = cKDTree(been).query(densified(line, 5e-3))
        return float((away < _SEEN).mean())

    def fit(self) -> bool:
        """Estimate the outline from what was seen so far; whether there is a new one.

        A place where a robot was stopped is dropped when a robot has been there and deeper. If that
        happens again and again, all is forgotten: some of it must have been wrong.
        """
        agree, refuted = self.sightings.settle(self.outward)
        self._doubt = max(0, self._doubt + refuted - agree)
        if self._doubt >= self.settings.contradicted:
            self._forget()
            self.forgotten += 1
            return True
        self._stopped, self._blocked = self.sightings.contacts, self.sightings.blocked
        been, fixed = self.sightings.places, len(self._stopped) + len(self._blocked)
        before, passed = self._before(been), self._passed
        for _ in range(_ROUNDS):
            self._solve(passed)
            passed = passed[self._weights[fixed:] > 0.0]
            violated = -(before + self._change(been)) - self.settings.slack
            more = _spaced(been, violated)[: max(0, _MOST - fixed - len(passed))]
            if not len(more):
                break
            passed = np.vstack([passed, more])
        found = self._trace() if len(self._weights) else self._first
        if found is None:
            return False
        self.outline = found
        return True

    @property
    def _at(self) -> Array:
        """``(m, 2)`` [m] centres of the kernels."""
        return np.vstack([self._stopped, self._blocked, self._passed])

    def _solve(self, passed: Array) -> None:
        """Weights of the kernels: free where robots were stopped, not positive ahead of them, not
        negative where robots have been."""
        self._passed = passed
        at, counts = self._at, [len(self._stopped), len(self._blocked), len(passed)]
        if not len(at):
            self._weights = np.zeros(0)
            return
        noise = (self.settings.error / _SCALE) ** 2
        root = np.linalg.cholesky(self._kernel(at, at) + noise * np.eye(len(at)))
        low = np.repeat([-np.inf, -np.inf, 0.0], counts)
        high = np.repeat([np.inf, 0.0, np.inf], counts)
        levels = np.repeat([0.0, -0.5 * BLOCKED, 0.0], counts)
        wanted = np.linalg.solve(root, levels - self._before(at))
        self._weights = lsq_linear(root.T, wanted, (low, high), method="bvls").x

    def _kernel(self, points: Array, at: Array) -> Array:
        away = np.hypot(points[:, :1] - at[:, 0], points[:, 1:] - at[:, 1])
        away *= math.sqrt(3.0) / self.settings.smooth
        values: Array = (1.0 + away) * np.exp(-away)
        return values

    def _change(self, points: Array) -> Array:
        if not len(self._weights):
            return np.zeros(len(points))
        changed: Array = self._kernel(points, self._at) @ self._weights
        return changed

    def _before(self, points: Array) -> Array:
        """Distance ``(n,)`` [m] from the line of contact of the first outline."""
        away = distance(self._first, points)
        signed: Array = np.where(inside(self._first, points), -away, away) - self._radius
        return signed

    def _levels(self) -> Array:
        shape = (len(self._ys), len(self._xs))
        levels: Array = (self._level + self._change(self._grid)).reshape(shape)
        return levels

    def _trace(self) -> Array | None:
        """The outline whose line of contact is the zero level; None where there is none."""
        levels = self._levels()
        line = _largest(self._xs, self._ys, levels)
        if line is None:
            return None
        depth = np.full(len(self._grid), -2.0 * _LEVEL)
        near = np.flatnonzero(levels.ravel() < 2.0 * _LEVEL)
        points = self._grid[near]
        away, _ = cKDTree(densified(line, _DENSE)).query(points)
        depth[near] = np.where(inside(line, points), away, -away)
        return _largest(self._xs, self._ys, self._radius - depth.reshape(levels.shape))


def _spaced(points: Array, worth: Array) -> Array:
    """Some of the points ``(n, 2)`` with the greatest positive worth, not close to each other."""
    chosen: list[Array] = []
    for k in np.argsort(-worth):
        if worth[k] <= 0.0 or len(chosen) == _ADDED:
            break
        if all(np.hypot(*(points[k] - c)) > _SPACED for c in chosen):
            chosen.append(points[k])
    return np.array(chosen).reshape(-1, 2)


def _largest(xs: Array, ys: Array, values: Array) -> Array | None:
    """The closed line ``(n, 2)`` at level 0 with the greatest area, counter-clockwise, thinned."""
    lines = contour_generator(xs, ys, values, line_type=LineType.Separate).lines(0.0)
    best, most = None, _THIN
    for found in lines:
        line = np.asarray(found, dtype=np.float64)
        if len(line) < 8 or not np.allclose(line[0], line[-1]):
            continue
        x, y = line[:-1].T
        area = 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
        if abs(area) > most:
            best, most = (line[:-1] if area > 0.0 else line[-2::-1]), abs(area)
    return None if best is None else _thinned(best)


def _thinned(line: Array) -> Array:
    """A closed line without the corners that lie close to the line of the others (the algorithm of
    Douglas and Peucker 1973)."""
    half = int(np.hypot(*(line - line[0]).T).argmax())
    parts = (line[: half + 1], np.vstack([line[half:], line[:1]]))
    return np.vstack([_simplified(part)[:-1] for part in parts])


def _simplified(line: Array) -> Array:
    a, b = line[0], line[-1]
    along, to = b - a, line - a
    across = np.abs(to[:, 0] * along[1] - to[:, 1] * along[0])
    away = across / max(float(np.hypot(*along)), 1e-12)
    k = int(away.argmax())
    if len(line) < 3 or away[k] <= _OFF:
        return np.array([a, b])
    return np.vstack([_simplified(line[: k + 1])[:-1], _simplified(line[k:])])
