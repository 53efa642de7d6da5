"""A Gibbs random field: Rezeck, Assuncao and Chaimowicz 2021 (rezeck/grf_transport, Apache-2.0).

Every robot draws its next velocity by a hundred steps of Metropolis and Hastings from a field of
potentials: towards the object's outline where it hides the target, along it elsewhere, with its
neighbours, away from walls and from the outline that the object is to have at the goal. It drives
ahead, and turns towards that velocity. Constants are those of the code of July 2021, with which the
recordings were made that the authors published beside it; later versions have others.

Reconstructed: the outline is scanned from where a robot is, not anew from where each sample would
take it (3 mm on), and so is whether the object hides the target. A robot that goes in any direction
moves along the velocity, and is slowed as theirs is, by how far it would have to turn. Robots that
are slower than theirs do everything slower, in proportion.
"""

import math

import numpy as np

from push_job.open_room import OpenRoom, open_room_method
from push_model import se2
from push_model.arrays import Array, Mask

_SENSING, _SAFE, _MASS, _LARGEST = 0.5, 0.15, 5.0, 0.3
_STEP, _PERIOD = 0.01, 1.0 / 15.0  # [s] by which samples look ahead; between decisions
_STRAIGHT, _TURNING, _AHEAD = 0.12, 0.06, math.pi / 36.0  # [m/s], [m/s], [rad]
_GAIN = 2.0  # of a drawn velocity
_STEER, _TURN = 0.8, 1.8  # [1/s] turn rates by how far it has to turn: ahead, and otherwise
_SAMPLES, _DEVIATION = 100, 0.05
_BURNT = int(0.6 * (_SAMPLES + 1))
_RAY, _WALL_RAY = 0.1, 0.2  # [rad] between the rays of a scan
_HIDING, _BESIDE, _WALL, _MATE = 5.0, 2.2, 0.5, 1.1  # factors of distances in the potential
_STRONG, _PULL, _CHARGE = -8e6, -32.0, 16.0
_ALONG = 8.8  # masses of a piece of outline
_SHARE = 0.4  # of points on the thinner side of the line to the target, from which it is hidden
_LOST = 1e4


class Gibbs:
    """See the module."""

    def __init__(self, arena: OpenRoom) -> None:
        self._arena = arena
        self._random = np.random.default_rng(arena.seed)
        self._next = -math.inf
        self._drawn = np.zeros((0, 2))  # in their units, as long as all that follows
        outline = arena.item.geometry.outline
        self._goal, self._extent = outline + arena.target, float(np.hypot(*outline.T).max())
        self._pace = min(1.0, arena.speed / _STRAIGHT)

    def velocities(self, time: float, pose: Array, robots: Array) -> Array:
        """See VelocityLaw."""
        self._decide(time, pose, robots)
        speed, _ = self._steered(robots)
        size = np.hypot(*self._drawn.T)
        told: Array = self._drawn * (speed / np.maximum(size, 1e-12))[:, None]
        return told

    def twists(self, time: float, pose: Array, robots: Array) -> Array:
        """See TwistLaw."""
        self._decide(time, pose, robots)
        return np.column_stack(self._steered(robots))

    def _decide(self, time: float, pose: Array, robots: Array) -> None:
        if len(self._drawn) != len(robots):
            self._drawn = np.full((len(robots), 2), _LARGEST)  # as their robots begin
            self._next = -math.inf
        if time >= self._next:
            period = _PERIOD / self._pace
            self._next = (time if self._next < time - period else self._next) + period
            corners = se2.transform(pose, self._arena.item.geometry.outline)
            seen = self._neighbours(robots, corners)
            before = self._drawn.copy()
            for i in range(len(robots)):
                self._drawn[i] = self._draw(i, robots, before, seen[i], corners)

    def _steered(self, robots: Array) -> tuple[Array, Array]:
        """``(n,)`` speeds ahead [m/s] and ``(n,)`` turn rates [rad/s]."""
        size = np.hypot(*self._drawn.T)
        turn = np.arctan2(self._drawn[:, 1], self._drawn[:, 0]) - robots[:, 2]
        off = (turn + math.pi) % (2.0 * math.pi) - math.pi
        far = np.abs(off) > _AHEAD
        speed = np.minimum(_GAIN * size, np.where(far, _TURNING, _STRAIGHT))
        return self._pace * speed, self._pace * np.where(far, _TURN, _STEER) * off

    def _neighbours(self, robots: Array, corners: Array) -> Mask:
        """``(n, n)`` who senses whom: near, and neither the object nor its outline at the goal is
        between."""
        places = robots[:, :2]
        near = np.hypot(*(places[:, None] - places).transpose(2, 0, 1)) <= _SENSING
        np.fill_diagonal(near, False)
        for i, k in zip(*np.nonzero(np.triu(near)), strict=True):
            way = (places[k] - places[i])[None]
            if any(np.isfinite(_reach(places[i], way, c)[0]) for c in (corners, self._goal)):
                near[i, k] = near[k, i] = False
        found: Mask = near
        return found

    def _draw(self, i: int, robots: Array, before: Array, mates: Mask, corners: Array) -> Array:
        tried = before[i] + self._random.normal(0.0, _DEVIATION, (_SAMPLES, 2))
        tried = np.vstack([before[i], _saturated(tried, _LARGEST)])
        there = robots[i, :2] + _STEP * tried
        U = self._walls(robots[i], there)
        U = U + self._mates(robots[mates, :2], before[mates], tried, there)
        U = U + self._object(robots[i], tried, there, corners)
        accept = self._random.random(_SAMPLES)
        last, kept = 0, []
        for k in range(_SAMPLES + 1):
            if k > 0 and (U[k] < U[last] or accept[k - 1] < math.exp(min(0.0, U[last] - U[k]))):
                last = k
            if k >= _BURNT:
                kept.append(tried[last])
        drawn: Array = _saturated(np.mean(kept, axis=0)[None], _LARGEST)[0]
        return drawn

    def _object(self, robot: Array, tried: Array, there: Array, corners: Array) -> Array:
        angles = robot[2] + np.arange(0.0, 2.0 * math.pi, _RAY)
        rays = _SENSING * np.column_stack([np.cos(angles), np.sin(angles)])
        reach = _reach(robot[:2], rays, corners)
        hit = np.isfinite(reach)
        if not hit.any():
            return np.zeros(len(tried))
        points = robot[:2] + np.where(hit, reach, 1.0)[:, None] * rays
        away = np.hypot(*(there[:, None] - points).transpose(2, 0, 1)) + 1e-9
        within = hit & (away < _SENSING)
        if self._hides(robot[:2], points[hit]):
            # The first point of the scan that is near enough decides.
            first = within.argmax(axis=1)
            nearest = away[np.arange(len(tried)), first]
            pull = _potential(_HIDING * nearest, _STRONG)
            return np.where(within.any(axis=1), pull, 0.0)
        U = np.where(within, _potential(_BESIDE * away, _PULL), 0.0).sum(axis=1)
        following = np.roll(points, -1, axis=0)
        both = within & np.roll(within, -1, axis=1)
        c, s = math.cos(robot[2]), math.sin(robot[2])
        d = points[hit] - robot[:2]
        left = c * d[:, 1] - s * d[:, 0] > 0.0
        way = (following - points) * (1.0 if (~left).sum() >= left.sum() else -1.0)
        count = both.sum(axis=1)
        pull_along = (both[..., None] * way).sum(axis=1) - count[:, None] * tried
        mass = _ALONG * _MASS * count
        value: Array = U + _kinetic(_saturated(pull_along, 1.0), tried, mass)
        return value

    def _hides(self, here: Array, points: Array) -> bool:
        """Whether the object is between a robot and the target: points on both sides of the line,
        not much fewer on one of them."""
        d, p = self._arena.target - here, points - here
        nearer = np.hypot(*(points - self._arena.target).T) <= np.hypot(*d)
        side = (d[0] * p[:, 1] - d[1] * p[:, 0])[nearer]
        left, right = int((side > 0.0).sum()), int((side < 0.0).sum())
        return left > 0 and right > 0 and min(left / right, right / left) > _SHARE

    def _mates(self, places: Array, moving: Array, tried: Array, there: Array) -> Array:
        if not len(places):
            return _kinetic(np.zeros_like(tried), tried, _MASS)
        moved = places + _STEP * moving
        gap = np.hypot(*(there[:, None] - moved).transpose(2, 0, 1)) + 1e-9
        U = _potential(_MATE * gap, -_CHARGE).sum(axis=1)
        count = (gap > _SAFE) & (gap < _SENSING)
        pull = ((moving - tried[:, None]) * count[..., None]).sum(axis=1)
        mass = _MASS * (1.0 + count.sum(axis=1))
        U = U + _kinetic(_saturated(pull, 1.0), tried, mass)
        return np.where((gap > _SENSING).any(axis=1), _LOST, U)

    def _walls(self, robot: Array, there: Array) -> Array:
        half = 0.5 * np.array(self._arena.size)
        from_goal = float(np.hypot(*(robot[:2] - self._arena.target)))
        if (half - np.abs(robot[:2]) > _SENSING).all() and from_goal > _SENSING + self._extent:
            return np.zeros(len(there))
        angles = robot[2] + np.arange(0.0, 2.0 * math.pi, _WALL_RAY)
        rays = _SENSING * np.column_stack([np.cos(angles), np.sin(angles)])
        with np.errstate(divide="ignore"):
            reach = ((np.copysign(half, rays) - robot[:2]) / rays).min(axis=1)
        reach = np.minimum(reach, _reach(robot[:2], rays, self._goal))
        points = robot[:2] + np.clip(reach, 0.0, 1.0)[:, None] * rays
        away = np.hypot(*(there[:, None] - points).transpose(2, 0, 1)) + 1e-9
        near = away <= 0.9 * _SAFE
        U: Array = np.where(near, _potential(_WALL * away, _CHARGE), 0.0).sum(axis=1)
        return U


def _reach(start: Array, ways: Array, corners: Array) -> Array:
    """``(m,)`` parts of ways ``(m, 2)`` at which they first meet an outline; inf where never."""
    edge = np.roll(corners, -1, axis=0) - corners
    d = corners - start
    x, y = ways[:, :1], ways[:, 1:]
    cross = x * edge[:, 1] - y * edge[:, 0]
    parallel = np.abs(cross) < 1e-12
    safe = np.where(parallel, 1.0, cross)
    t = (d[:, 0] * edge[:, 1] - d[:, 1] * edge[:, 0]) / safe
    u = (d[:, 0] * y - d[:, 1] * x) / safe
    met = ~parallel & (t >= 0.0) & (t <= 1.0) & (u >= 0.0) & (u <= 1.0)
    first: Array = np.where(met, t, math.inf).min(axis=1)
    return first


def _potential(r: Array, charge: float) -> Array:
    """Coulomb and Buckingham's, with the constants of their code: depth and permittivity 0.04,
    radius 0.8, steepness 1."""
    r = np.maximum(r, 1e-3)
    value: Array = 0.04 * (6.0 / -5.0 * math.e * (1.0 - r / 0.8) + 1.0 / 5.0 * (0.8 / r) ** 6)
    value += charge / (4.0 * math.pi * 0.04 * r)
    return value


def _kinetic(relative: Array, own: Array, mass: Array | float) -> Array:
    energy: Array = 0.5 * mass * ((relative**2).sum(axis=1) + _LARGEST - (own**2).sum(axis=1))
    return energy


def _saturated(v: Array, most: float) -> Array:
    """Scaled so that neither component exceeds a limit."""
    size = np.abs(v).max(axis=1)
    slowed: Array = v * np.minimum(1.0, most / np.maximum(size, 1e-12))[:, None]
    return slowed


METHOD = open_room_method("gibbs", Gibbs)
