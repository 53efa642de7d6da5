"""The wrenches that a grasp can apply, and whether they hold those that a task asks for: 3.1.2.

A wrench is (fx, fy, torque / c) here, c being a length: with that of the limit surface its
ellipsoid is a sphere, and angles between wrenches mean what a pusher feels. The thesis adds newtons
to newton metres: c = 1 m.

The cone of a grasp is that of the 2 n edges of its friction cones; the bisectors of the third step
lie between them and change no facet. In three dimensions a facet lies on two edges with all others
on one side: a few dozen cross products decide containment exactly, and say by how much.
"""

from typing import Any

import numba
import numpy as np

from grasp_opt.contact_outline import Contacts
from push_model.arrays import Array
from push_model.coulomb import cone_angle
from push_model.limit_surface import EllipsoidLimitSurface

_TOL = 1e-9


def wrench_rays(
    points: Array, normals: Array, friction: float, length: float, bisectors: bool = False
) -> Array:
    """Unit wrenches of the edges of friction cones, steps 1-3 of 3.1.2.

    Parameters
    ----------
    points, normals: ``(..., n, 2)`` [m] about the centre of mass; unit, inward.
    length: [m] c.
    bisectors: add those of forces along the normals, after all edges.

    Returns
    -------
    ``(..., 2n, 3)``, right and left edge of each contact, or ``(..., 3n, 3)``.
    """
    angle = cone_angle(friction)
    c, s = np.cos(angle), np.sin(angle)
    x, y = normals[..., 0], normals[..., 1]
    right = np.stack([c * x + s * y, c * y - s * x], axis=-1)
    left = np.stack([c * x - s * y, c * y + s * x], axis=-1)
    edges = np.stack([right, left], axis=-2)
    forces = edges.reshape(*points.shape[:-2], -1, 2)
    arms = np.repeat(points, 2, axis=-2)
    if bisectors:
        forces = np.concatenate([forces, normals], axis=-2)
        arms = np.concatenate([arms, points], axis=-2)
    torque = (arms[..., 0] * forces[..., 1] - arms[..., 1] * forces[..., 0]) / length
    rays = np.concatenate([forces, torque[..., None]], axis=-1)
    unit: Array = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
    return unit


def task_wrenches(twists: Array, surface: EllipsoidLimitSurface, length: float) -> Array:
    """(3.4): unit wrenches ``(m, 3)`` that sustain twists ``(m, 3)`` of the centre of mass.

    Twists in the object's frame [m/s, m/s, rad/s]; those at rest are left out.
    """
    wrenches = np.array([surface.wrench(v) for v in np.asarray(twists, dtype=np.float64)])
    wrenches = wrenches.reshape(-1, 3) / np.array([1.0, 1.0, length])
    size = np.linalg.norm(wrenches, axis=1)
    moving = size > 0.0
    unit: Array = wrenches[moving] / size[moving, None]
    return unit


@numba.njit(cache=True)
def _facets(rays: Any, facets: Any) -> Any:
    """Fill ``facets`` with inward unit normals of the cone of rays (m, 3); number, rank."""
    m = rays.shape[0]
    count, rank = 0, 1
    for a in range(m):
        for b in range(a + 1, m):
            nx = rays[a, 1] * rays[b, 2] - rays[a, 2] * rays[b, 1]
            ny = rays[a, 2] * rays[b, 0] - rays[a, 0] * rays[b, 2]
            nz = rays[a, 0] * rays[b, 1] - rays[a, 1] * rays[b, 0]
            size = np.sqrt(nx * nx + ny * ny + nz * nz)
            if size < _TOL:
                continue
            nx, ny, nz = nx / size, ny / size, nz / size
            low, high = 0.0, 0.0
            for k in range(m):
                d = nx * rays[k, 0] + ny * rays[k, 1] + nz * rays[k, 2]
                low, high = min(low, d), max(high, d)
            rank = max(rank, 3 if max(high, -low) > _TOL else 2)
            for sign in (1.0, -1.0):
                if (low if sign > 0.0 else -high) >= -_TOL:
                    known = False
                    for k in range(count):
                        gap = abs(facets[k, 0] - sign * nx) + abs(facets[k, 1] - sign * ny)
                        known |= gap + abs(facets[k, 2] - sign * nz) < _TOL
                    if not known:
                        facets[count] = sign * nx, sign * ny, sign * nz
                        count += 1
    return count, rank


@numba.njit(cache=True)
def _in_plane(rays: Any, facets: Any, count: int) -> int:
    """Add the ends of a flat cone, whose plane is among the facets; their number."""
    plane = facets[0].copy()
    for k in range(rays.shape[0]):
        edge = np.cross(plane, rays[k])
        for sign in (1.0, -1.0):
            if (sign * (rays @ edge)).min() >= -_TOL:
                facets[count] = sign * edge
                count += 1
    return count


@numba.njit(cache=True)
def _each(rays: Any, wrenches: Any, result: Any) -> None:
    """The margin of each wrench."""
    m = rays.shape[0]
    facets = np.empty((m * m + 2 * m + 2, 3))
    count, rank = _facets(rays, facets)
    result[:] = 1.0
    if rank == 1:  # a single ray, or a line
        for i in range(wrenches.shape[0]):
            best = -1.0
            for k in range(m):
                best = max(best, (wrenches[i] * rays[k]).sum())
            off = min(0.0, -np.sqrt(max(0.0, 1.0 - best * best))) if best >= 0.0 else -1.0
            result[i] = 0.0 if off > -1e-7 else off
        return
    if rank == 2:
        count = _in_plane(rays, facets, count)
    for i in range(wrenches.shape[0]):
        for k in range(count):
            d = facets[k, 0] * wrenches[i, 0] + facets[k, 1] * wrenches[i, 1]
            result[i] = min(result[i], d + facets[k, 2] * wrenches[i, 2])


@numba.njit(cache=True)
def _margin(rays: Any, wrenches: Any) -> float:
    result = np.empty(len(wrenches))
    _each(rays, wrenches, result)
    worst = 1.0
    for i in range(len(result)):
        worst = min(worst, result[i])
    return worst


@numba.njit(cache=True)
def _margins(rays: Any, wrenches: Any, result: Any) -> None:
    for i in range(rays.shape[0]):
        result[i] = _margin(rays[i], wrenches)


def margin(rays: Array, wrenches: Array) -> float:
    """Margin by which the cone of rays ``(m, 3)`` contains wrenches ``(q, 3)``, all of unit size.

    Returns
    -------
    The sine of the angle from the worst of them to the nearest facet, 1 where the cone is all of
    space; negative outside, where the angle to the cone is at least that. They are held when it is
    not below ``-HELD``.
    """
    return float(_margin(np.ascontiguousarray(rays), np.ascontiguousarray(wrenches)))


def wrench_margins(rays: Array, wrenches: Array) -> Array:
    """``margin`` of each of the wrenches ``(q, 3)`` alone; ``(q,)``."""
    result = np.empty(len(wrenches))
    _each(np.ascontiguousarray(rays), np.ascontiguousarray(wrenches), result)
    return result


HELD = 1e-9
"""What ``margin`` may be below 0 by rounding."""


def margins(rays: Array, wrenches: Array) -> Array:
    """``margin`` of many grasps: rays ``(k, m, 3)``, wrenches ``(q, 3)``; ``(k,)``."""
    result = np.empty(len(rays))
    _margins(np.ascontiguousarray(rays), np.ascontiguousarray(wrenches), result)
    return result


def compatible(
    contacts: Contacts,
    friction: float,
    twists: Array,
    surface: EllipsoidLimitSurface,
) -> bool:
    """The grasp-task compatibility test of 3.1.2; twists ``(m, 3)`` in the object's frame."""
    length = surface.radius
    rays = wrench_rays(contacts.points, contacts.normals, friction, length)
    return margin(rays, task_wrenches(twists, surface, length)) >= -HELD
