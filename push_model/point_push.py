"""A disc pushes an object that comes to rest as soon as nothing pushes it. Compiled.

The contact has no friction, so a push acts along its normal. Under an ellipsoidal limit surface
the object's twist is then that of equation (3.4): f / F^2 along the force and tau / T^2 about the
centre of mass. A rigid body of mass m and inertia I that loses all its speed at every step, as in
engines with full damping, has the limit surface of F^2 : T^2 = m : I; what follows holds for both.

The disc is driven by a PD law towards a target and nothing stops it. Where it gets into the object,
the object recedes as fast as the disc comes, and a part of the overlap is made good at each step,
as sequential-impulse engines do. Poses and places are in one fixed frame.
"""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numba
import numpy as np

from push_model.arrays import Array
from push_model.convex_parts import convex_parts

_TURNS = 4  # over the parts of an object in a step


class Body(NamedTuple):
    """An object about its centre of mass: corners ``(v, 2)`` [m] of its convex parts in turn,
    first, count ``(p,)``: whose they are. mobility: translation per impulse; spin: turn per moment
    of one; only their ratio [1/m^2] matters."""

    corners: Any
    first: Any
    count: Any
    mobility: float
    spin: float


class Disc(NamedTuple):
    """A pusher: radius [m]; gains of its PD law [1/s^2], [1/s]; step [s]; recovery: part of an
    overlap that is made good in a step, but for ``slop`` [m]."""

    radius: float
    stiffness: float
    damping: float
    step: float
    recovery: float
    slop: float


@dataclass(frozen=True)
class Pushed:
    """Where objects and discs are after their pushes: poses ``(n, 6)`` x, y [m], heading [rad] and
    their rates, discs ``(n, 4)`` x, y [m] and their rates; touched ``(n,)``."""

    poses: Array
    discs: Array
    touched: Array


def body(outline: Array, gyration: float) -> Body:
    """A body from its outline ``(n, 2)`` [m] about the centre of mass, and its radius of gyration
    [m], which for a limit surface is T / F."""
    parts = [np.asarray(p, dtype=np.float64) for p in convex_parts(outline)]
    count = np.array([len(p) for p in parts], dtype=np.int64)
    first = np.concatenate([[0], np.cumsum(count)[:-1]]).astype(np.int64)
    return Body(np.vstack(parts), first, count, 1.0, 1.0 / gyration**2)


def push(item: Body, disc: Disc, poses: Array, discs: Array, targets: Array, steps: int) -> Pushed:
    """Every disc ``(n, 4)`` towards its target ``(n, 2)``, against its own copy of the object at
    poses ``(n, 6)``, for so many steps. What is given is not changed."""
    after, moved = np.array(poses, dtype=np.float64), np.array(discs, dtype=np.float64)
    touched = _push_all(item, disc, after, moved, np.asarray(targets, dtype=np.float64), steps)
    return Pushed(after, moved, touched)


def driven(disc: Disc, at: Array, target: Array, steps: int) -> Array:
    """Place and velocity ``(4,)`` of a disc after so many steps towards a target ``(2,)``."""
    after = np.array(at, dtype=np.float64)
    for _ in range(steps):
        _drive(disc, after, target)
    return after


def placed(item: Body, pose: Array) -> Array:
    """Corners ``(v, 2)`` of a body at a pose."""
    corners: Array = np.empty_like(item.corners)
    _place(item.corners, pose, corners)
    return corners


@numba.njit(cache=True, error_model="numpy")
def _place(local: Any, pose: Any, world: Any) -> None:
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for i in range(local.shape[0]):
        world[i, 0] = pose[0] + c * local[i, 0] - s * local[i, 1]
        world[i, 1] = pose[1] + s * local[i, 0] + c * local[i, 1]


@numba.njit(cache=True, error_model="numpy")
def nearest(x: float, y: float, corners: Any, first: int, count: int) -> Any:
    """Distance to the border of one convex part, and the point of it that is nearest."""
    best, bx, by = 1e300, 0.0, 0.0
    for i in range(count):
        ax, ay = corners[first + i, 0], corners[first + i, 1]
        k = first + (i + 1) % count
        ex, ey = corners[k, 0] - ax, corners[k, 1] - ay
        t = ((x - ax) * ex + (y - ay) * ey) / (ex * ex + ey * ey)
        t = min(1.0, max(0.0, t))
        px, py = ax + t * ex, ay + t * ey
        away = (x - px) ** 2 + (y - py) ** 2
        if away < best:
            best, bx, by = away, px, py
    return math.sqrt(best), bx, by


@numba.njit(cache=True, error_model="numpy")
def gap(x: float, y: float, corners: Any, first: Any, count: Any) -> Any:
    """Distance of a point outside from a body, and the point of it that is nearest."""
    best, bx, by = 1e300, 0.0, 0.0
    for k in range(count.shape[0]):
        away, px, py = nearest(x, y, corners, first[k], count[k])
        if away < best:
            best, bx, by = away, px, py
    return best, bx, by


@numba.njit(cache=True, error_model="numpy")
def _drive(disc: Disc, at: Any, target: Any) -> None:
    """One step of a disc, in place."""
    for j in range(2):
        pull = disc.stiffness * (target[j] - at[j]) - disc.damping * at[2 + j]
        at[2 + j] += disc.step * pull
        at[j] += disc.step * at[2 + j]


@numba.njit(cache=True, error_model="numpy")
def _step(item: Body, disc: Disc, pose: Any, at: Any, target: Any, corners: Any) -> bool:
    """One step of one disc and one object, in place; whether they touch."""
    dt = disc.step
    _drive(disc, at, target)
    for j in range(3):
        pose[j] += dt * pose[3 + j]
        pose[3 + j] = 0.0
    _place(item.corners, pose, corners)
    touched, bx, by, turn = False, 0.0, 0.0, 0.0
    for _ in range(_TURNS):
        overlap = False
        for k in range(item.count.shape[0]):
            away, px, py = nearest(at[0], at[1], corners, item.first[k], item.count[k])
            depth = disc.radius - away
            if depth <= 0.0 or away <= 0.0:
                continue
            overlap = True
            nx, ny = (px - at[0]) / away, (py - at[1]) / away
            # The contact is half-way between both surfaces.
            rx = px + 0.5 * depth * nx - pose[0]
            ry = py + 0.5 * depth * ny - pose[1]
            lever = rx * ny - ry * nx
            ease = item.mobility + item.spin * lever * lever
            closing = at[2] * nx + at[3] * ny
            closing -= (pose[3] - pose[5] * ry) * nx + (pose[4] + pose[5] * rx) * ny
            if closing > 0.0:
                impulse = closing / ease
                pose[3] += item.mobility * impulse * nx
                pose[4] += item.mobility * impulse * ny
                pose[5] += item.spin * impulse * lever
            short = disc.recovery * max(0.0, depth - disc.slop) / dt
            short -= (bx - turn * ry) * nx + (by + turn * rx) * ny
            if short > 0.0:
                impulse = short / ease
                bx += item.mobility * impulse * nx
                by += item.mobility * impulse * ny
                turn += item.spin * impulse * lever
        touched |= overlap
        if not overlap:
            break
    pose[3] += bx
    pose[4] += by
    pose[5] += turn
    return touched


@numba.njit(cache=True, error_model="numpy")
def _push_all(item: Body, disc: Disc, poses: Any, discs: Any, targets: Any, steps: int) -> Any:
    touched = np.zeros(poses.shape[0], dtype=np.bool_)
    corners = np.empty_like(item.corners)
    for k in range(poses.shape[0]):
        for _ in range(steps):
            touched[k] |= _step(item, disc, poses[k], discs[k], targets[k], corners)
    return touched
