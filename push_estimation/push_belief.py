"""Friction of the contact and centre of mass of an object, jointly, from how it is pushed.

A grid over friction and centre of mass holds their probability. Each window of a push is compared
with what ``line_push_model`` predicts for each cell. A window that sticks rules out the cells that
would have slipped; one that slides or pivots tells the values themselves.
"""

import math
from dataclasses import replace

import numpy as np

from push_estimation.evidence import Contradiction, Verdict, log_mean, log_total
from push_estimation.line_push_model import Bumper, Candidates, followed
from push_estimation.push_windows import Window
from push_estimation.pushed_side import Facing
from push_model.arrays import Array, Mask
from push_model.belief import Interval
from push_model.limit_surface import uniform_pressure_radius
from push_model.outlines import convex_hull
from push_model.settings import SettingsError, bounded, settings
from push_model.specs import ObjectSpec

_FRICTIONS, _PLACES = 30, 21  # cells
_FLUSH = 0.012  # [rad] up to which a contact is taken as flush
_OUTLIER = 0.02  # share of windows that anything may have happened in
_OUTLYING = (0.03, 0.3)  # [m/s], [rad/s] of such windows
_STRANGE = 25.0  # squared deviation of the best cell above which a window is not a push
_BESIDE = 1.5  # friction of the file, and what may be true beside it
_INSIDE = 0.8  # of the distance to the nearest side: where the centre of mass may be
_EVERY = 7  # cell of the prior that a window is always compared with
_FORGOTTEN = 20.0  # log of the probability below the best cell's at which a cell is left out
_UNSTEADY = 0.1  # of a change of the robot's turn rate within a window: error of its mean


@settings
class PushPriorSettings:
    """What is assumed of an object before it is pushed, and how much a window counts."""

    friction_low: float = bounded(
        0.05,
        low=0.01,
        high=1.0,
        doc="Lowest friction coefficient of bumper and object that the estimator considers "
        "(dimensionless).",
    )
    friction_high: float = bounded(
        0.6,
        low=0.02,
        high=2.0,
        doc="Highest friction coefficient of bumper and object that the estimator considers "
        "(dimensionless).",
    )
    com_radius: float = bounded(
        0.02,
        low=1e-3,
        high=1.0,
        doc="Greatest distance of the object's centre of mass from its position in the file of the "
        "object that the estimator considers (m).",
    )
    weight: float = bounded(
        0.3,
        low=0.01,
        high=1.0,
        doc="Exponent of the likelihood of one window of a push in the estimate of friction and "
        "centre of mass (dimensionless). It is below 1 because the errors of the model are alike "
        "in successive windows.",
    )
    model_error: float = bounded(
        0.005,
        low=0.0,
        high=1.0,
        doc="Standard deviation of the slip predicted by the estimator, as a fraction of the speed "
        "of the push (dimensionless).",
    )
    slope_error: float = bounded(
        0.03,
        low=0.0,
        high=1.0,
        doc="Standard deviation of the slip and the rotation predicted by the estimator, as a "
        "fraction of the predicted values (dimensionless).",
    )
    friction_error: float = bounded(
        0.1,
        low=0.0,
        high=1.0,
        doc="Half width that is added to the interval of the estimated friction, as a fraction of "
        "the friction (dimensionless). It allows for a pressure under the object that differs "
        "from the pressure of the model.",
    )
    com_error: float = bounded(
        1e-3,
        low=0.0,
        high=0.1,
        doc="Half width that is added to the intervals of the estimated centre of mass (m). It "
        "allows for a pressure under the object that differs from the pressure of the model.",
    )

    def __post_init__(self) -> None:
        if self.friction_low >= self.friction_high:
            raise SettingsError(
                f"friction_low {self.friction_low} must be below friction_high {self.friction_high}"
            )


class PushBelief:
    """The joint probability of contact friction and centre of mass of one object.

    windows: number that counted. strange: number that no friction and no centre of mass explains.
    widened: number of times that new data contradicted the interval.
    """

    def __init__(
        self, item: ObjectSpec, bumper: Bumper, prior: PushPriorSettings | None = None
    ) -> None:
        """The range of friction is put out so that it holds what the file of the object says. The
        centre of mass stays well inside the object."""
        self._prior = s = prior or PushPriorSettings()
        self._bumper = bumper
        low = max(min(s.friction_low, item.contact_friction / _BESIDE), 1e-3)
        high = max(s.friction_high, item.contact_friction * _BESIDE)
        # A friction at an end of the range may act as one beyond it, by the error of the model.
        least, most = low * (1.0 - s.friction_error), high * (1.0 + s.friction_error)
        reach = min(s.com_radius, _INSIDE * _depth(item))
        mu = np.geomspace(least, most, _FRICTIONS + 1)
        place = np.linspace(-reach, reach, _PLACES + 1)
        self._edges = (mu, item.com[0] + place, item.com[1] + place)
        middles = [(e[1:] + e[:-1]) / 2.0 for e in self._edges]
        cells = np.stack(np.meshgrid(*middles, indexing="ij"), axis=-1).reshape(-1, 3)
        away = np.hypot(cells[:, 1] - item.com[0], cells[:, 2] - item.com[1])
        self._there = np.flatnonzero(away <= reach)
        self._cells = cells[self._there]
        widths = np.repeat(np.diff(mu), _PLACES**2)[self._there]
        self._start = np.log(widths / widths.sum())
        self._radius = _radii(item, reach, self._cells[:, 1:])
        self._sides: dict[Facing, Candidates] = {}
        self._sample = np.zeros(len(self._cells), dtype=np.bool_)
        self._sample[::_EVERY] = True
        self.windows = self.strange = self.widened = 0
        self.way = 0.0
        """[m] of push that was seen, whether it counted or not."""
        self.prior = self._intervals(self._start)
        self.reset()

    def reset(self) -> None:
        """Know the prior only."""
        self._log = self._start.copy()
        self._contradiction = Contradiction()

    def take(self, window: Window) -> Verdict:
        """Use a window."""
        self.way += window.way
        if self._closes(window):
            return Verdict(False)
        chosen = self._sample | (self._log > float(self._log.max()) - _FORGOTTEN)
        density, best = self._density(window, chosen)
        if best > _STRANGE:
            self.strange += 1
            return Verdict(
                False,
                sentence="the object moves in a way that no friction and no centre of mass in the "
                "range explains; something else touches it, or its poses are wrong",
            )
        every = self._sample
        by_prior = log_mean(self._start[every], density[every])
        self.windows += 1
        if self._contradiction.add(by_prior, log_mean(self._log, density)):
            self.reset()
            self.widened += 1
            return Verdict(
                True,
                True,
                "the latest motion contradicts what was believed of friction and centre of mass; "
                "the intervals are those of the prior again",
            )
        self._multiply(density)
        return Verdict(True)

    def intervals(self) -> tuple[Interval, Interval, Interval]:
        """Contact friction, and x and y [m] of the centre of mass in the object's frame, 95 %."""
        return self._intervals(self._log)

    def _multiply(self, density: Array) -> None:
        log = self._log + self._prior.weight * density
        self._log = log - log_total(log)

    def _flush(self, window: Window) -> bool:
        """Whether the contact is flush at the beginning, as far as the noise allows to say."""
        lasted = len(window.drives) * window.step
        least = max(_FLUSH, 1.5 * float(window.noise[1]) * lasted)
        return bool(abs(window.start[1]) < least)

    def _closes(self, window: Window) -> bool:
        """Whether an object that is not flush becomes flush in the window. When it does so within
        the window is not known, so that the slopes say little."""
        lasted = len(window.drives) * window.step
        first, last = window.start[1], window.start[1] + lasted * float(window.slopes[1])
        return not self._flush(window) and (abs(last) < _FLUSH or first * last < 0.0)

    def _density(self, window: Window, chosen: Mask) -> tuple[Array, float]:
        """Log density ``(n,)`` of a window's slopes in each cell; the smallest squared deviation.

        chosen: the cells that are reckoned; the others get the density of an outlier.
        """
        s = self._prior
        side = self._sides.get(window.facing)
        if side is None:
            side = self._sides[window.facing] = self._in_frame(window.facing)
        lasted, flush = len(window.drives) * window.step, self._flush(window)
        start = (window.start[0], 0.0 if flush else window.start[1])
        part = Candidates(
            *(v[chosen] for v in (side.friction, side.depth, side.aside, side.radius))
        )
        q, phi = followed(
            part, self._bumper, window.facing.length, start, window.drives, window.step
        )
        slip, turn = q @ window.weights, phi @ window.weights
        unsteady = _UNSTEADY * float(np.ptp(window.drives[:, 1]))
        sigma_q = math.sqrt(
            window.noise[0] ** 2
            + (s.model_error * window.speed) ** 2
            + (s.slope_error * float(window.slopes[0])) ** 2
            + (unsteady * 2.0 * self._bumper.distance) ** 2
        )
        sigma_phi = math.sqrt(
            window.noise[1] ** 2
            + (s.slope_error * float(window.slopes[1])) ** 2
            + (0.5 * _FLUSH / lasted) ** 2 * flush
            + (s.model_error * window.speed / self._bumper.distance) ** 2
            + unsteady**2
        )
        square = ((window.slopes[0] - slip) / sigma_q) ** 2
        square = square + ((window.slopes[1] - turn) / sigma_phi) ** 2
        # Against a broad density, so that a single window cannot rule anything out for good.
        inlier = math.log1p(-_OUTLIER) - square / 2.0 - math.log(sigma_q * sigma_phi)
        outlier = math.log(_OUTLIER) - math.log(_OUTLYING[0] * _OUTLYING[1])
        density = np.full(len(self._cells), outlier)
        density[chosen] = np.logaddexp(inlier, outlier)
        return density, float(square.min())

    def _in_frame(self, facing: Facing) -> Candidates:
        place = facing.seen_from(self._cells[:, 1:])
        return Candidates(self._cells[:, 0], place[:, 0], place[:, 1], self._radius)

    def _intervals(self, log: Array) -> tuple[Interval, Interval, Interval]:
        whole = np.zeros(_FRICTIONS * _PLACES**2)
        whole[self._there] = np.exp(log)
        cube = whole.reshape(_FRICTIONS, _PLACES, _PLACES)
        found = []
        for axis, edges in enumerate(self._edges):
            others = tuple(k for k in range(3) if k != axis)
            s, cell = self._prior, cube.sum(axis=others)
            wide = (s.friction_error, 0.0) if axis == 0 else (0.0, s.com_error)
            found.append(_interval(edges, cell, *wide))
        return found[0], found[1], found[2]


def _interval(edges: Array, share: Array, share_more: float, more: float) -> Interval:
    """Median and 95 % of a distribution over cells, taken as uniform within each.

    Both ends are put out by half a cell, which is how far the grid can be wrong, by a fraction of
    themselves, and by ``more``.
    """
    total = np.concatenate([[0.0], np.cumsum(share)])
    ends = np.interp([0.025, 0.5, 0.975], total / total[-1], edges)
    low, value, high = (float(v) for v in ends)
    cell = np.diff(edges)
    first, last = (
        int(np.clip(np.searchsorted(edges, v) - 1, 0, len(cell) - 1)) for v in (low, high)
    )
    low = max(float(edges[0]), (low - float(cell[first]) / 2.0) * (1.0 - share_more) - more)
    high = min(float(edges[-1]), (high + float(cell[last]) / 2.0) * (1.0 + share_more) + more)
    return Interval(value, low, high)


def _depth(item: ObjectSpec) -> float:
    """[m] from the centre of mass of the file to the nearest side of the convex hull."""
    hull = convex_hull(item.outline)
    along = np.roll(hull, -1, axis=0) - hull
    normal = np.column_stack([-along[:, 1], along[:, 0]]) / np.hypot(*along.T)[:, None]
    return float((normal * (np.array(item.com) - hull)).sum(axis=1).min())


def _radii(item: ObjectSpec, reach: float, places: Array) -> Array:
    """``(n,)`` [m] c of the limit surface with the centre of mass at places ``(n, 2)``.

    c is computed at nine places and interpolated by a parabola.
    """
    x, y = (g.ravel() for g in np.meshgrid(*[np.linspace(-0.6, 0.6, 3)] * 2))
    known = []
    for dx, dy in zip(x, y, strict=True):
        com = (item.com[0] + reach * float(dx), item.com[1] + reach * float(dy))
        known.append(uniform_pressure_radius(replace(item, com=com).geometry))
    solved, *_ = np.linalg.lstsq(_parabola(x, y), np.array(known), rcond=None)
    u, v = ((places - np.array(item.com)) / reach).T
    result: Array = _parabola(u, v) @ solved
    return result


def _parabola(x: Array, y: Array) -> Array:
    return np.column_stack([np.ones_like(x), x, y, x * x, x * y, y * y])
