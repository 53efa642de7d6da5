"""Clearance of a body with any outline, at a pose and along a motion: a lower bound.

The clearance is the distance of the body, as a filled shape, from the map's obstacles and from
others. It is zero if an obstacle lies inside the outline without touching it.

Along a motion with a constant twist, no point of the body is faster than its fastest corner. The
clearance falls no faster than that. The next pose to check follows from the present clearance
(sphere tracing), so that no part of the motion is missed.
"""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numba
import numpy as np

from push_model.arrays import Array
from push_model.distance_field import DistanceField, holds_obstacle, lookup, points_clearance
from push_model.obstacles import (
    Obstacles,
    inside_outlines,
    inside_polygon,
    point_gap,
    segment_gap,
)
from push_model.outlines import distance, inside
from push_model.shapes import densified

_OUTLINE = 0.02  # [m] between points of the outline; what lies between them counts as well
_COVER = 3000  # points about, of a body's inside, that discs are chosen among
_SURE = 0.05  # [m] of more room than is asked for, from which on it need not be known how much
STEP = 1e-3
"""[m] by which the clearance between two poses that are checked may be less than at both."""
_SOON = 0.04  # [m] of a motion on which a body leaves what it touches
LEAST = 5e-3
"""[m] of room that a body keeps on a motion even where it starts with less than it should have."""


class Surroundings(NamedTuple):
    """Map, body and obstacles for compiled functions; world frame, [m].

    field, ox, oy, scale: as of ``DistanceField``. outline ``(n, 2)``, dense; corners ``(m, 2)``;
    cover ``(k, 3)`` x, y, radius of discs inside it, in which all of it lies that is ``depth`` from
    its edge: of the body, about its origin; reach: of its farthest corner. capsules, others and
    last: of ``Obstacles``.
    """

    field: Any
    ox: float
    oy: float
    scale: float
    outline: Any
    corners: Any
    cover: Any
    depth: float
    reach: float
    capsules: Any
    others: Any
    last: Any


@dataclass(frozen=True)
class Body:
    """A body's outline ``(n, 2)`` [m] about its origin, and what follows from it.

    dense: the outline with more points. cover, depth: see ``Surroundings``.
    """

    outline: Array
    dense: Array
    cover: Array
    depth: float

    @classmethod
    def of(cls, outline: Array) -> "Body":
        """Of a simple polygon."""
        outline = np.ascontiguousarray(outline, dtype=np.float64)
        dense = np.ascontiguousarray(densified(outline, _OUTLINE))
        pitch = math.sqrt(float(np.prod(np.ptp(outline, axis=0))) / _COVER)
        return cls(outline, dense, _cover(outline, pitch), 2.0 * _DIAGONAL * pitch)

    @property
    def reach(self) -> float:
        """[m] of the farthest corner."""
        return float(np.hypot(*self.outline.T).max())

    @property
    def core(self) -> float:
        """[m] which, added to the body's clearance, gives a lower bound of its origin's.

        Negative if obstacles can come closer to the origin than to the body, as in a notch.
        """
        return float((self.cover[:, 2] - np.hypot(*self.cover[:, :2].T)).max())

    def among(self, field: DistanceField, obstacles: Obstacles) -> Surroundings:
        """The arguments of the compiled functions for this body, a map and other obstacles."""
        return Surroundings(
            field.values,
            *field.args,
            self.dense,
            self.outline,
            self.cover,
            self.depth,
            self.reach,
            obstacles.capsules,
            obstacles.corners,
            obstacles.last,
        )


_DIAGONAL = 0.71  # half of a square's, and a little more


def _cover(outline: Array, pitch: float) -> Array:
    """Discs inside an outline, of which some one holds each point that is 1.42 pitches or more from
    its edge; the largest first.

    The nearest point of a lattice is 0.71 pitches from it at most, and at least as far from the
    edge: it is the middle of such a disc, or a larger one holds all that is so near to it.
    """
    low, high = outline.min(axis=0), outline.max(axis=0)
    sides = [np.arange(a, b + pitch, pitch) for a, b in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 2)
    points = points[inside(outline, points)]
    deep = distance(outline, points)
    enough = deep >= _DIAGONAL * pitch
    points, deep = points[enough], deep[enough]
    chosen, left = [], np.ones(len(points), dtype=np.bool_)
    for k in np.argsort(-deep, kind="stable"):
        if left[k]:
            chosen.append([*points[k], deep[k]])
            left &= np.hypot(*(points - points[k]).T) > deep[k] - _DIAGONAL * pitch
            left[k] = False
    return np.array(chosen).reshape(-1, 3)


@numba.njit(cache=True)
def room_at_pose(s: Any, x: float, y: float, theta: float, enough: float) -> float:
    """Lower bound [m] of the body's clearance at a pose; 0 if it overlaps anything.

    The bound is tight only below ``enough``.
    """
    around = lookup(s.field, x, y, s.ox, s.oy, s.scale)
    room = around - s.reach
    if room < enough:
        room = points_clearance(s.field, s.outline, x, y, theta, s.ox, s.oy, s.scale)
        if room <= 0.0:
            return 0.0
    c, si = math.cos(theta), math.sin(theta)
    if around <= s.reach:
        # Of a cell inside the outline, the middle is half a cell farther from the edge.
        within = room + 1.0 / s.scale < s.depth
        for k in range(s.cover.shape[0]):
            if within:
                break
            px, py, radius = s.cover[k, 0], s.cover[k, 1], s.cover[k, 2]
            there = lookup(s.field, x + c * px - si * py, y + si * px + c * py, s.ox, s.oy, s.scale)
            within = there < radius
        if within:
            pose = np.array([x, y, theta])
            if holds_obstacle(s.field, s.corners, pose, s.ox, s.oy, s.scale):
                return 0.0
    if s.capsules.shape[0] > 0:
        room = min(room, _among_capsules(s, x, y, c, si, room))
    return float(max(0.0, room))


@numba.njit(cache=True)
def _among_capsules(s: Any, x: float, y: float, c: float, si: float, enough: float) -> float:
    """Clearance [m] from obstacles that are not on the map, at most ``enough``."""
    least, n = enough, s.corners.shape[0]
    for k in range(s.capsules.shape[0]):
        if point_gap(s.capsules, k, x, y) - s.reach >= least:
            continue
        px, py = s.capsules[k, 0] - x, s.capsules[k, 1] - y
        if inside_polygon(s.corners, 0, n, c * px + si * py, -si * px + c * py):
            return 0.0
        bx, by = s.corners[n - 1, 0], s.corners[n - 1, 1]
        for m in range(n):
            ax, ay = bx, by
            bx, by = s.corners[m, 0], s.corners[m, 1]
            length = math.hypot(bx - ax, by - ay)
            du, dv = (bx - ax) / length, (by - ay) / length
            gap = segment_gap(
                s.capsules,
                k,
                x + c * ax - si * ay,
                y + si * ax + c * ay,
                c * du - si * dv,
                si * du + c * dv,
                0.0,
                length,
            )
            least = min(least, gap)
        if least <= 0.0:
            return 0.0
    if s.last.shape[0] > 0:
        px, py = s.corners[0, 0], s.corners[0, 1]
        if inside_outlines(s.others, s.last, x + c * px - si * py, y + si * px + c * py):
            return 0.0
    return least


@numba.njit(cache=True)
def rooms_at_poses(s: Any, poses: Any) -> Any:
    """Clearances ``(n,)`` [m] at poses ``(n, 3)``, see ``room_at_pose``."""
    found = np.empty(poses.shape[0])
    for k in range(poses.shape[0]):
        found[k] = room_at_pose(s, poses[k, 0], poses[k, 1], poses[k, 2], math.inf)
    return found


@numba.njit(cache=True)
def _room_after(s: Any, start: Any, motion: Any, part: float, enough: float) -> float:
    angle = motion[2] * part
    half = 0.5 * angle
    sine = math.sin(angle) / angle if abs(angle) > 1e-9 else 1.0
    rest = math.sin(half) * math.sin(half) / half if abs(half) > 1e-9 else half
    dx = part * (sine * motion[0] - rest * motion[1])
    dy = part * (rest * motion[0] + sine * motion[1])
    c, si = math.cos(start[2]), math.sin(start[2])
    x, y = start[0] + c * dx - si * dy, start[1] + si * dx + c * dy
    return float(room_at_pose(s, x, y, start[2] + angle, enough))


@numba.njit(cache=True)
def motion_keeps(s: Any, start: Any, motion: Any, need: float, leaves: bool) -> Any:
    """Whether a body keeps a clearance ``need`` [m] along a motion ``(3,)`` from a pose ``(3,)``.

    If an end has less clearance, the clearance must not fall on the way from this end, except by 1
    mm. leaves: the body may touch something at the start, if it has left it after 4 cm.

    Returns
    -------
    Whether it does, and the number of poses that were checked.
    """
    speed, n = 0.0, s.corners.shape[0]
    for k in range(n):
        vx, vy = motion[0] - motion[2] * s.corners[k, 1], motion[1] + motion[2] * s.corners[k, 0]
        speed = max(speed, math.hypot(vx, vy))
    asked = need + STEP
    sure = asked + _SURE
    part, room = 0.0, _room_after(s, start, motion, 0.0, sure)
    end = _room_after(s, start, motion, 1.0, sure)
    if leaves and room < LEAST and speed > 0.0:
        part = min(1.0, _SOON / speed)
        room = _room_after(s, start, motion, part, sure)
    if min(room, end) < LEAST:
        return False, 2
    rooms = np.empty(64)
    rooms[0], count = room, 1
    top = room
    while part < 1.0:
        step = max(room - need, 2.0 * STEP) / max(speed, 1e-12)
        part = min(1.0, part + step)
        room = end if part == 1.0 else _room_after(s, start, motion, part, sure)
        top = max(top, room)
        if room < LEAST or (end >= asked and room < min(asked, top - STEP)):
            return False, count + 2
        if count == rooms.shape[0]:
            longer = np.empty(2 * count)
            longer[:count] = rooms
            rooms = longer
        rooms[count] = room
        count += 1
    if end >= asked:
        return True, count + 2
    # From either end to the highest in between it only becomes more.
    ahead = np.empty(count)
    ahead[count - 1] = rooms[count - 1]
    for k in range(count - 2, -1, -1):
        ahead[k] = max(ahead[k + 1], rooms[k])
    top = 0.0
    for k in range(count):
        top = max(top, rooms[k])
        if rooms[k] < min(asked, min(top, ahead[k]) - STEP):
            return False, count + 2
    return True, count + 2
