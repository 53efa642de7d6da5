"""The rim of an object: the line on which the centres of round robots in contact with it lie."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from push_model.arrays import Array
from push_model.outlines import convex_hull, distance, inside
from push_model.screws import point_velocities

_DIRECTIONS = 720
_TURN = np.array([[0.0, 1.0], [-1.0, 0.0]])  # a quarter, of row vectors
_STEP = 2e-3  # [m] between points of the line at notches
_FLAT = 1e-9  # of an area: what an outline lacks of its hull's without having a notch

Nearest = tuple[NDArray[np.int64], Array]
"""Index ``(n,)`` of the rim point that is nearest to each given point, and depth ``(n,)`` [m] of
the given point inside of it, negative outside."""


class Rim:
    """Points at even distances along that line, in the object's frame.

    points ``(m, 2)`` [m], counter-clockwise; normals ``(m, 2)`` unit, inward; length [m] of it all.
    """

    def __init__(self, outline: Array, radius: float, spacing: float) -> None:
        """outline: ``(k, 2)`` [m] of the object about its centre of mass. radius: [m] of the
        robots. spacing: [m] between points, at most."""
        line = _line_of_contact(np.ascontiguousarray(outline).tobytes(), radius)
        ring = np.vstack([line, line[:1]])
        way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(ring, axis=0).T))])
        self.length = float(way[-1])
        count = max(8, int(np.ceil(self.length / spacing)))
        at = np.arange(count) / count * self.length
        self.points = np.column_stack([np.interp(at, way, column) for column in ring.T])
        # A step of the line is along an edge of the hull or round a corner: its middle direction
        # is the normal there.
        k = np.clip(np.searchsorted(way, at, side="right") - 1, 0, len(line) - 1)
        step = np.diff(ring, axis=0)[k]
        normal = np.column_stack([-step[:, 1], step[:, 0]])
        self.normals = normal / np.hypot(*normal.T)[:, None]

    def nearest(self, points: Array) -> Nearest:
        """The rim's points nearest to ``(n, 2)`` [m], by number, and how far inside these are."""
        k = np.hypot(*(points[:, None] - self.points[None]).transpose(2, 0, 1)).argmin(axis=1)
        depth: Array = ((points - self.points[k]) * self.normals[k]).sum(axis=1)
        return k, depth

    def approach(self, twist: Array) -> Array:
        """``(m,)`` [m/s] speed of the rim along its inward normal when the object moves with a
        twist ``(3,)`` in its frame. Robots push the object with that twist where it is positive."""
        moved = point_velocities(twist, self.points)
        speed: Array = (moved * self.normals).sum(axis=1)
        return speed

    def drive(self, twist: Array, friction: float) -> Array:
        """``(m,)`` [m/s] how well a robot at each point drives a twist: its normal speed; where
        that is everywhere less than what friction can drive along the rim, as for a disc that
        turns, the sum of both."""
        approach = self.approach(twist)
        slip = friction * np.abs(
            (point_velocities(twist, self.points) @ _TURN * self.normals).sum(1)
        )
        if approach.max() >= slip.max():
            return approach
        both: Array = np.maximum(approach, 0.0) + slip
        return both


@lru_cache(maxsize=4)
def _line_of_contact(outline: bytes, radius: float) -> Array:
    """Of an outline ``(k, 2)`` float64. Several rims of one object differ in their spacing only."""
    corners = np.frombuffer(outline).reshape(-1, 2)
    hull = convex_hull(corners)
    if _area(corners) < (1.0 - _FLAT) * _area(hull):
        return _line_with_notches(corners, radius)
    return _support_line(hull, radius)


def _support_line(hull: Array, radius: float) -> Array:
    """About a convex outline: by its outermost corner in every direction."""
    angle = np.arange(_DIRECTIONS) / _DIRECTIONS * 2.0 * np.pi
    out = np.column_stack([np.cos(angle), np.sin(angle)])
    line: Array = hull[np.argmax(out @ hull.T, axis=1)] + radius * out
    return line


def _line_with_notches(outline: Array, radius: float) -> Array:
    """About any outline: its edges moved out and arcs round its corners, without what is closer
    to another part of it. A notch with a mouth too narrow for a robot must be too narrow inside."""
    parts = []
    edge = np.roll(outline, -1, axis=0) - outline
    length = np.hypot(*edge.T)
    normal = np.column_stack([edge[:, 1], -edge[:, 0]]) / length[:, None]  # outward
    angle = np.arctan2(normal[:, 1], normal[:, 0])
    for k in range(len(outline)):
        turn = float(np.remainder(angle[k] - angle[k - 1] + np.pi, 2.0 * np.pi) - np.pi)
        steps = np.linspace(0.0, 1.0, max(2, int(np.ceil(max(turn, 0.0) * radius / _STEP))))
        a = angle[k - 1] + turn * steps
        if turn > 0.0:
            parts.append(outline[k] + radius * np.column_stack([np.cos(a), np.sin(a)]))
        along = np.linspace(0.0, 1.0, max(2, int(np.ceil(length[k] / _STEP))))[:, None]
        parts.append(outline[k] + radius * normal[k] + along * edge[k])
    line = np.vstack(parts)
    line = line[(distance(outline, line) > radius - 1e-6) & ~inside(outline, line)]
    kept: Array = line[np.hypot(*(line - np.roll(line, 1, axis=0)).T) > 1e-9]
    return kept


def _area(outline: Array) -> float:
    x, y = outline.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
