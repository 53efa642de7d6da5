"""Ways of a disc round an object in an empty room: shortest in a visibility graph. No ROS."""

import math
from typing import Any

import numba
import numpy as np

from push_model.arrays import Array
from push_model.point_push import Body, gap, placed
from push_model.se2 import transform

_SAMPLE = 0.25  # radii of the disc between points of a line that are held against the object
_FAR = 1e18


@numba.njit(cache=True, error_model="numpy")
def _clear(
    ax: float, ay: float, bx: float, by: float, corners: Any, first: Any, count: Any, least: float,
    spacing: float,
) -> bool:  # fmt: skip
    """Whether a line keeps a distance from a body."""
    count_ = max(2, int(math.hypot(bx - ax, by - ay) / spacing) + 1)
    for i in range(count_ + 1):
        t = i / count_
        away, _, _ = gap(ax + t * (bx - ax), ay + t * (by - ay), corners, first, count)
        if away < least:
            return False
    return True


@numba.njit(cache=True, error_model="numpy")
def _lengths(
    points: Any, corners: Any, first: Any, count: Any, least: float, start: float, spacing: float
) -> Any:
    """``(n, n)`` lengths of the lines that are clear; those from the first point need ``start``."""
    n = points.shape[0]
    found = np.full((n, n), _FAR)
    for i in range(n):
        for j in range(i):
            keep = start if j == 0 else least
            if _clear(
                points[i, 0], points[i, 1], points[j, 0], points[j, 1], corners, first, count,
                keep, spacing,
            ):  # fmt: skip
                length = math.hypot(points[i, 0] - points[j, 0], points[i, 1] - points[j, 1])
                found[i, j] = found[j, i] = length
    return found


@numba.njit(cache=True, error_model="numpy")
def _dijkstra(lengths: Any) -> Any:
    """Predecessors ``(n,)`` on the shortest ways from point 0; the length of that to point 1."""
    n = lengths.shape[0]
    away, before = np.full(n, _FAR), np.full(n, -1)
    done = np.zeros(n, dtype=np.bool_)
    away[0] = 0.0
    for _ in range(n):
        here = -1
        for k in range(n):
            if not done[k] and (here < 0 or away[k] < away[here]):
                here = k
        if here == 1 or away[here] >= _FAR:
            break
        done[here] = True
        for k in range(n):
            if away[here] + lengths[here, k] < away[k]:
                away[k], before[k] = away[here] + lengths[here, k], here
    return before, away[1]


class Ways:
    """Round one body, for one disc."""

    def __init__(self, item: Body, outline: Array, radius: float, room: tuple[float, float]):
        """outline ``(n, 2)``: of the body, counter-clockwise. room: least and greatest x and y."""
        self._item, self._radius, self._room = item, radius, room
        self._keep = radius * 1.13  # of its centre from the body, along a way
        self._ring = self._corners(outline, 1.6 * radius)

    def _corners(self, outline: Array, away: float) -> Array:
        """Points round every corner, in the body's frame, that the disc can take."""
        edge = np.roll(outline, -1, axis=0) - outline
        normal = np.column_stack([edge[:, 1], -edge[:, 0]]) / np.hypot(*edge.T)[:, None]
        before = np.roll(normal, 1, axis=0)
        points = []
        for part in (0.0, 0.5, 1.0):
            mixed = (1.0 - part) * before + part * normal
            points.append(outline + away * mixed / np.hypot(*mixed.T)[:, None])
        i = self._item
        return np.array(
            [
                p
                for p in np.vstack(points)
                if gap(p[0], p[1], i.corners, i.first, i.count)[0] > 0.85 * away
            ]
        )

    def find(self, pose: Array, start: Array, goal: Array) -> tuple[Array, float]:
        """``(k, 2)`` from start to goal round the body at a pose, and its length; no points and an
        infinite length where there is none."""
        i, (low, high) = self._item, self._room
        corners = placed(i, pose)
        ring = transform(pose, self._ring)
        inside = (ring > low).all(axis=1) & (ring < high).all(axis=1)
        points = np.vstack([start, goal, ring[inside]])
        # From where it touches, a disc may go along or away, however near it is.
        near = gap(start[0], start[1], corners, i.first, i.count)[0]
        least = min(self._keep, near - 0.003 * self._radius)
        lengths = _lengths(
            points, corners, i.first, i.count, self._keep, least, _SAMPLE * self._radius
        )
        before, length = _dijkstra(lengths)
        if length >= _FAR:
            return np.zeros((0, 2)), math.inf
        chain = [1]
        while chain[-1] != 0:
            chain.append(int(before[chain[-1]]))
        return points[chain[::-1]], float(length)
