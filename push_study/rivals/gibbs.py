"""A Gibbs random field: Rezeck, Assuncao and Chaimowicz 2021 (rezeck/grf_transport, Apache-2.0).

Every robot draws its next velocity by sixty steps of Metropolis and Hastings from a field of
potentials: towards the object's outline where it hides the target, along it elsewhere, with its
neighbours, away from walls.

Reconstructed from paper and parameters: their time is ours times the ratio of speeds, so that
robots are as fast as ours; they see the outline as points 4 cm apart that face them; whether the
object hides the target is judged where a robot is, not at every sample.
"""

import math

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_study.rivals.rival import RivalArena, rival_spec

_SENSING, _SAFE, _MASS, _SPEED, _STEP = 0.5, 0.15, 8000.0, 0.06, 0.5
_SAMPLES, _BURNT, _DEVIATION = 60, 36, 0.05
_POINTS = 0.04  # [m] between points of the outline
_FAR = 1e3


class Gibbs:
    """See the module."""

    def __init__(self, arena: RivalArena) -> None:
        self._arena = arena
        self._random = np.random.default_rng(arena.seed)
        outline = arena.item.geometry.outline
        ring = np.vstack([outline, outline[:1]])
        way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(ring, axis=0).T))])
        at = np.arange(0.0, way[-1], _POINTS)
        self._points = np.column_stack([np.interp(at, way, c) for c in ring.T])
        k = np.clip(np.searchsorted(way, at, side="right") - 1, 0, len(outline) - 1)
        edge = np.diff(ring, axis=0)[k]
        self._normals = np.column_stack([edge[:, 1], -edge[:, 0]])
        self._next = -math.inf
        self._chosen = np.zeros((0, 2))  # in their units

    def velocities(self, time: float, pose: Array, robots: Array) -> Array:
        """See Rival."""
        faster = self._arena.speed / _SPEED
        if len(self._chosen) != len(robots):
            self._chosen = np.zeros((len(robots), 2))
            self._next = -math.inf
        if time >= self._next:
            self._next = time + _STEP / faster
            outline = se2.transform(pose, self._points)
            normals = self._normals @ se2.rotation_matrix(float(pose[2])).T
            before = self._chosen.copy()
            for i in range(len(robots)):
                self._chosen[i] = self._draw(i, robots, before, outline, normals)
        return self._chosen * faster

    def _draw(self, i: int, robots: Array, before: Array, outline: Array, normals: Array) -> Array:
        here = robots[i, :2]
        tried = before[i] + self._random.normal(0.0, _DEVIATION, (_SAMPLES, 2))
        tried = np.vstack([before[i], _saturated(tried, _SPEED)])
        there = here + _STEP * tried
        U = self._walls(there) + self._mates(i, robots, before, tried, there)
        away = np.hypot(*(outline - here).T)
        seen = (((here - outline) * normals).sum(axis=1) > 0.0) & (away < _SENSING)
        if seen.sum() >= 2:
            points = outline[seen]
            # The visible stretch in one piece, in the order of the outline.
            gaps = np.hypot(*(points - np.roll(points, 1, axis=0)).T)
            points = np.roll(points, -int(gaps.argmax()), axis=0)
            U = U + self._object(robots[i], tried, there, points)
        accept = self._random.random(_SAMPLES)
        last, kept = 0, []
        for k in range(1, _SAMPLES + 1):
            drop = U[k] - U[last]
            if drop < 0.0 or accept[k - 1] < math.exp(-drop):
                last = k
            if k >= _BURNT:
                kept.append(tried[last])
        drawn: Array = _saturated(np.mean(kept, axis=0)[None], _SPEED)[0]
        return drawn

    def _object(self, robot: Array, tried: Array, there: Array, points: Array) -> Array:
        away = np.hypot(*(there[:, None] - points).transpose(2, 0, 1))
        lost = (away >= _SENSING).any(axis=1)
        if self._hides(robot[:2], points):
            nearest = int(np.hypot(*(points - robot[:2]).T).argmin())
            return np.where(lost, _FAR, _potential(away[:, nearest], 0.2, -8e6))
        U = _potential(away[:, :-1], 0.2, -100.0).sum(axis=1)
        ahead = np.array([math.cos(robot[2]), math.sin(robot[2])])
        d = points - robot[:2]
        left = ahead[0] * d[:, 1] - ahead[1] * d[:, 0] > 0.0
        along = np.diff(points, axis=0) * (1.0 if (~left).sum() >= left.sum() else -1.0)
        pull = (along[None] - tried[:, None]).sum(axis=1)
        mass = _MASS * (1.0 + 0.01 * len(along))
        U = U + _kinetic(_saturated(pull, 1.0), tried, mass)
        return np.where(lost, _FAR, U)

    def _hides(self, here: Array, points: Array) -> bool:
        """Whether the object is between a robot and the target: points on both sides of the line,
        not much fewer on one of them."""
        d, p = self._arena.target - here, points - here
        nearer = np.hypot(*(points - self._arena.target).T) <= np.hypot(*d)
        side = (d[0] * p[:, 1] - d[1] * p[:, 0])[nearer]
        left, right = int((side > 0.0).sum()), int((side < 0.0).sum())
        return left > 0 and right > 0 and min(left / right, right / left) > 0.4

    def _mates(self, i: int, robots: Array, before: Array, tried: Array, there: Array) -> Array:
        away = np.hypot(*(robots[:, :2] - robots[i, :2]).T)
        near = (away < _SENSING) & (np.arange(len(robots)) != i)
        if not near.any():
            return _kinetic(np.zeros_like(tried), tried, _MASS)
        moved = robots[near, :2] + _STEP * before[near]
        gap = np.hypot(*(there[:, None] - moved).transpose(2, 0, 1))
        U = _potential(gap, 0.65, -50.0).sum(axis=1)
        count = (gap > _SAFE) & (gap < _SENSING)
        pull = ((before[near] - tried[:, None]) * count[..., None]).sum(axis=1)
        mass = _MASS * (1.0 + count.sum(axis=1))
        U = U + _kinetic(_saturated(pull, _SPEED), tried, mass)
        return np.where((gap > _SENSING).any(axis=1), _FAR, U)

    def _walls(self, there: Array) -> Array:
        half = 0.5 * np.array(self._arena.size)
        away = np.maximum(np.concatenate([half - there, half + there], axis=1), 1e-3)
        U: Array = np.where(away < _SAFE, _potential(away, 0.05, 1.0), 0.0).sum(axis=1)
        return U


def _potential(r: Array, alpha: float, charge: float) -> Array:
    """Coulomb and Buckingham's, with the constants of their machine."""
    r = np.maximum(r, 1e-3)
    steep = 6.0 / (alpha - 6.0) * math.exp(alpha) * (1.0 - r / 0.8)
    value: Array = 0.04 * (steep - alpha / (alpha - 6.0) * (0.8 / r) ** 6)
    value += charge / (4.0 * math.pi * 0.04 * r)
    return value


def _kinetic(relative: Array, own: Array, mass: Array | float) -> Array:
    energy: Array = 0.5 * mass * ((relative**2).sum(axis=1) + _SPEED - (own**2).sum(axis=1))
    return energy


def _saturated(v: Array, most: float) -> Array:
    size = np.hypot(*v.T)
    slowed: Array = v * np.minimum(1.0, most / np.maximum(size, 1e-12))[:, None]
    return slowed


METHOD = rival_spec("gibbs", Gibbs)
