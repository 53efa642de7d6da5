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

import numba
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
            places, room = robots[:, :2].copy(), np.array(self._arena.size)
            mates = _neighbours(places, corners, self._goal)
            before = self._drawn.copy()
            for i in range(len(robots)):
                tried = before[i] + self._random.normal(0.0, _DEVIATION, (_SAMPLES, 2))
                tried = np.vstack([before[i], _saturated(tried, _LARGEST)])
                U = _mates(places[i], places[mates[i]], before[mates[i]], tried)
                _add_walls(U, robots[i], tried, room, self._goal, self._arena.target, self._extent)
                _add_object(U, robots[i], tried, corners, self._arena.target)
                accept = self._random.random(_SAMPLES)
                self._drawn[i] = _saturated(_mean_of_walk(tried, U, accept)[None], _LARGEST)[0]

    def _steered(self, robots: Array) -> tuple[Array, Array]:
        """``(n,)`` speeds ahead [m/s] and ``(n,)`` turn rates [rad/s]."""
        size = np.hypot(*self._drawn.T)
        turn = np.arctan2(self._drawn[:, 1], self._drawn[:, 0]) - robots[:, 2]
        off = (turn + math.pi) % (2.0 * math.pi) - math.pi
        far = np.abs(off) > _AHEAD
        speed = np.minimum(_GAIN * size, np.where(far, _TURNING, _STRAIGHT))
        return self._pace * speed, self._pace * np.where(far, _TURN, _STEER) * off


# Kernels. Potentials U ``(m,)`` are of velocities ``tried (m, 2)`` of one robot; corners, goal are
# outlines ``(k, 2)`` of the object, here and at the goal.


@numba.njit(cache=True)
def _reach(x: float, y: float, way_x: float, way_y: float, corners: Array) -> float:
    """Part of a way from a point at which it first meets an outline; inf where it does not."""
    first = math.inf
    n = len(corners)
    for k in range(n):
        after = k + 1 if k + 1 < n else 0
        edge_x, edge_y = corners[after, 0] - corners[k, 0], corners[after, 1] - corners[k, 1]
        dx, dy = corners[k, 0] - x, corners[k, 1] - y
        cross = way_x * edge_y - way_y * edge_x
        if abs(cross) < 1e-12:
            continue
        t = (dx * edge_y - dy * edge_x) / cross
        u = (dx * way_y - dy * way_x) / cross
        if 0.0 <= t <= 1.0 and 0.0 <= u <= 1.0 and t < first:
            first = t
    return first


@numba.njit(cache=True)
def _neighbours(places: Array, corners: Array, goal: Array) -> Mask:
    """``(n, n)`` who senses whom: near, and neither the object nor its outline at the goal is
    between."""
    n = len(places)
    near = np.zeros((n, n), dtype=np.bool_)
    for i in range(n):
        for k in range(i + 1, n):
            dx, dy = places[k, 0] - places[i, 0], places[k, 1] - places[i, 1]
            if math.hypot(dx, dy) > _SENSING:
                continue
            x, y = places[i, 0], places[i, 1]
            hidden = _reach(x, y, dx, dy, corners) < math.inf or (
                _reach(x, y, dx, dy, goal) < math.inf
            )
            near[i, k] = near[k, i] = not hidden
    return near


@numba.njit(cache=True)
def _potential(r: float, charge: float) -> float:
    """Coulomb and Buckingham's, with the constants of their code: depth and permittivity 0.04,
    radius 0.8, steepness 1."""
    r = max(r, 1e-3)
    value = 0.04 * (6.0 / -5.0 * math.e * (1.0 - r / 0.8) + 1.0 / 5.0 * (0.8 / r) ** 6)
    return value + charge / (4.0 * math.pi * 0.04 * r)


@numba.njit(cache=True)
def _kinetic(pull_x: float, pull_y: float, own_x: float, own_y: float, mass: float) -> float:
    """pull: of which neither component counts for more than 1."""
    scale = min(1.0, 1.0 / max(abs(pull_x), abs(pull_y), 1e-12))
    relative = (pull_x * scale) ** 2 + (pull_y * scale) ** 2
    return 0.5 * mass * (relative + _LARGEST - (own_x**2 + own_y**2))


@numba.njit(cache=True)
def _mates(place: Array, places: Array, moving: Array, tried: Array) -> Array:
    """Of a robot at ``(2,)`` among neighbours at ``(k, 2)`` that move ``(k, 2)`` [m/s]."""
    U = np.zeros(len(tried))
    for s in range(len(tried)):
        x, y = place[0] + _STEP * tried[s, 0], place[1] + _STEP * tried[s, 1]
        count, pull_x, pull_y, lost = 0, 0.0, 0.0, False
        for k in range(len(places)):
            dx = x - (places[k, 0] + _STEP * moving[k, 0])
            dy = y - (places[k, 1] + _STEP * moving[k, 1])
            gap = math.hypot(dx, dy) + 1e-9
            U[s] += _potential(_MATE * gap, -_CHARGE)
            if _SAFE < gap < _SENSING:
                count += 1
                pull_x += moving[k, 0] - tried[s, 0]
                pull_y += moving[k, 1] - tried[s, 1]
            lost |= gap > _SENSING
        U[s] += _kinetic(pull_x, pull_y, tried[s, 0], tried[s, 1], _MASS * (1.0 + count))
        if lost:
            U[s] = _LOST
    return U


@numba.njit(cache=True)
def _add_walls(
    U: Array, robot: Array, tried: Array, room: Array, goal: Array, target: Array, extent: float
) -> None:
    """Of the walls of a room of this size [m] with the origin in its middle, and of the object's
    outline at the goal, whose corners are within extent [m] of the target."""
    x, y = robot[0], robot[1]
    half_x, half_y = 0.5 * room[0], 0.5 * room[1]
    inner = half_x - abs(x) > _SENSING and half_y - abs(y) > _SENSING
    if inner and math.hypot(x - target[0], y - target[1]) > _SENSING + extent:
        return
    for k in range(int(math.ceil(2.0 * math.pi / _WALL_RAY))):
        angle = robot[2] + k * _WALL_RAY
        ray_x, ray_y = _SENSING * math.cos(angle), _SENSING * math.sin(angle)
        reach = _reach(x, y, ray_x, ray_y, goal)
        if ray_x != 0.0:
            reach = min(reach, (math.copysign(half_x, ray_x) - x) / ray_x)
        if ray_y != 0.0:
            reach = min(reach, (math.copysign(half_y, ray_y) - y) / ray_y)
        reach = min(max(reach, 0.0), 1.0)
        point_x, point_y = x + reach * ray_x, y + reach * ray_y
        for s in range(len(tried)):
            dx, dy = x + _STEP * tried[s, 0] - point_x, y + _STEP * tried[s, 1] - point_y
            away = math.hypot(dx, dy) + 1e-9
            if away <= 0.9 * _SAFE:
                U[s] += _potential(_WALL * away, _CHARGE)


@numba.njit(cache=True)
def _scan(robot: Array, corners: Array) -> tuple[Array, Mask]:
    """``(m, 2)`` where the rays of a robot's scan end, ``(m,)`` whether at the object."""
    m = int(math.ceil(2.0 * math.pi / _RAY))
    points, hit = np.empty((m, 2)), np.zeros(m, dtype=np.bool_)
    for k in range(m):
        angle = robot[2] + k * _RAY
        ray_x, ray_y = _SENSING * math.cos(angle), _SENSING * math.sin(angle)
        reach = _reach(robot[0], robot[1], ray_x, ray_y, corners)
        hit[k] = reach < math.inf
        if not hit[k]:
            reach = 1.0
        points[k, 0], points[k, 1] = robot[0] + reach * ray_x, robot[1] + reach * ray_y
    return points, hit


@numba.njit(cache=True)
def _hides(robot: Array, points: Array, hit: Mask, target: Array) -> bool:
    """Whether the object is between a robot and the target: points on both sides of the line,
    not much fewer on one of them."""
    dx, dy = target[0] - robot[0], target[1] - robot[1]
    left = right = 0
    for k in range(len(points)):
        px, py = points[k, 0], points[k, 1]
        if not hit[k] or math.hypot(px - target[0], py - target[1]) > math.hypot(dx, dy):
            continue
        side = dx * (py - robot[1]) - dy * (px - robot[0])
        left += side > 0.0
        right += side < 0.0
    return left > 0 and right > 0 and min(left, right) / max(left, right) > _SHARE


@numba.njit(cache=True)
def _add_object(U: Array, robot: Array, tried: Array, corners: Array, target: Array) -> None:
    """Of the object, as a robot scans it."""
    points, hit = _scan(robot, corners)
    if not hit.any():
        return
    hidden = _hides(robot, points, hit, target)
    m = len(points)
    c, s = math.cos(robot[2]), math.sin(robot[2])
    left = right = 0
    for k in range(m):
        if hit[k]:
            aside = c * (points[k, 1] - robot[1]) - s * (points[k, 0] - robot[0])
            left += aside > 0.0
            right += aside <= 0.0
    sign = 1.0 if right >= left else -1.0
    away = np.empty(m)
    for j in range(len(tried)):
        x, y = robot[0] + _STEP * tried[j, 0], robot[1] + _STEP * tried[j, 1]
        for k in range(m):
            away[k] = math.hypot(x - points[k, 0], y - points[k, 1]) + 1e-9
        if hidden:  # the first point of the scan that is near enough decides
            for k in range(m):
                if hit[k] and away[k] < _SENSING:
                    U[j] += _potential(_HIDING * away[k], _STRONG)
                    break
            continue
        count, pull_x, pull_y = 0, 0.0, 0.0
        for k in range(m):
            if not (hit[k] and away[k] < _SENSING):
                continue
            U[j] += _potential(_BESIDE * away[k], _PULL)
            after = k + 1 if k + 1 < m else 0
            if hit[after] and away[after] < _SENSING:
                count += 1
                pull_x += sign * (points[after, 0] - points[k, 0])
                pull_y += sign * (points[after, 1] - points[k, 1])
        pull_x -= count * tried[j, 0]
        pull_y -= count * tried[j, 1]
        mass = _ALONG * _MASS * count
        U[j] += _kinetic(pull_x, pull_y, tried[j, 0], tried[j, 1], mass)


@numba.njit(cache=True)
def _mean_of_walk(tried: Array, U: Array, accept: Array) -> Array:
    """``(2,)`` mean of the later samples of Metropolis and Hastings."""
    last, total = 0, np.zeros(2)
    for k in range(len(U)):
        if k > 0 and (U[k] < U[last] or accept[k - 1] < math.exp(min(0.0, U[last] - U[k]))):
            last = k
        if k >= _BURNT:
            total += tried[last]
    return total / (len(U) - _BURNT)


def _saturated(v: Array, most: float) -> Array:
    """Scaled so that neither component exceeds a limit."""
    size = np.abs(v).max(axis=1)
    slowed: Array = v * np.minimum(1.0, most / np.maximum(size, 1e-12))[:, None]
    return slowed


METHOD = open_room_method("gibbs", Gibbs)
