"""Where a round robot can touch an object: points on its outline, with the normal there."""

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from push_model.arrays import Array
from push_model.outlines import convex_hull
from push_model.shape_specs import PolygonShape
from push_model.shapes import Shape
from push_model.specs import ObjectSpec

_CORNER = 0.25  # [rad] between edges from which on a vertex is a corner and not part of a curve


@lru_cache(maxsize=32)
def convex(item: ObjectSpec) -> ObjectSpec:
    """An object with the convex hull of its outline: groups push convex objects, and an outline
    that is estimated has dents."""
    if item.geometry.convex:
        return item
    hull = tuple((float(x), float(y)) for x, y in convex_hull(item.outline))
    return replace(item, shape=PolygonShape(vertices=hull, frame="given"))


@dataclass(frozen=True)
class Contacts:
    """Contacts of one grasp, in the object's frame about its centre of mass.

    points: ``(n, 2)`` [m] on the outline. normals: ``(n, 2)`` unit, inward.
    """

    points: Array
    normals: Array

    def centres(self, radius: float) -> Array:
        """``(n, 2)`` [m] centres of discs that touch there."""
        centres: Array = self.points - radius * self.normals
        return centres


class ContactOutline:
    """An outline, counter-clockwise, by the way along it.

    At corners nothing can push; along curves, which are polygons of many vertices, the normal
    turns evenly from vertex to vertex, as that of the curve does.
    """

    def __init__(self, shape: Shape) -> None:
        self.shape = shape
        a = shape.outline
        edge = np.roll(a, -1, axis=0) - a
        self._lengths = np.hypot(*edge.T)
        self._starts, self._edges = a, edge
        self._way = np.concatenate([[0.0], np.cumsum(self._lengths)])
        normals = np.column_stack([-edge[:, 1], edge[:, 0]]) / self._lengths[:, None]
        before = np.roll(normals, 1, axis=0)
        turn = np.arctan2(
            before[:, 0] * normals[:, 1] - before[:, 1] * normals[:, 0], (before * normals).sum(1)
        )
        self.corner = np.abs(turn) > _CORNER
        """``(m,)`` whether a vertex is a corner."""
        heading = np.arctan2(normals[:, 1], normals[:, 0])
        half = 0.5 * turn
        smooth, following = ~self.corner, np.roll(~self.corner, -1)
        self._first = heading - np.where(smooth, half, 0.0)
        self._last = heading + np.where(following, np.roll(half, -1), 0.0)

    @property
    def arrays(self) -> tuple[Array, Array, Array, Array, Array]:
        """Starts and edges ``(m, 2)`` [m], ways to them ``(m + 1,)`` [m], headings of the normal
        [rad] at their beginnings and ends ``(m,)``: for compiled code."""
        return self._starts, self._edges, self._way, self._first, self._last

    @property
    def length(self) -> float:
        """[m] of the whole outline."""
        return float(self._way[-1])

    @cached_property
    def corners(self) -> Array:
        """``(k,)`` [m] where along the outline the corners are."""
        where: Array = self._way[:-1][self.corner]
        return where

    def at(self, way: Array) -> Contacts:
        """Contacts at so many metres ``(n,)`` along the outline, from its first vertex on."""
        way = np.mod(np.asarray(way, dtype=np.float64), self.length)
        k = np.clip(np.searchsorted(self._way, way, side="right") - 1, 0, len(self._edges) - 1)
        part = ((way - self._way[k]) / self._lengths[k])[:, None]
        heading = self._first[k] + part[:, 0] * (self._last[k] - self._first[k])
        points = self._starts[k] + part * self._edges[k]
        return Contacts(points, np.column_stack([np.cos(heading), np.sin(heading)]))

    def from_corner(self, way: Array) -> Array:
        """``(n,)`` [m] along the outline to the nearest corner; inf on a curve without corners."""
        if not len(self.corners):
            return np.full(np.shape(way), np.inf, dtype=np.float64)
        gap = np.abs(np.mod(np.asarray(way), self.length)[..., None] - self.corners)
        nearest: Array = np.minimum(gap, self.length - gap).min(axis=-1)
        return nearest

    def nearest(self, points: Array) -> tuple[Array, Array]:
        """Ways ``(n,)`` [m] along the outline to what is nearest to points ``(n, 2)``, and how far
        [m] that is."""
        to = np.asarray(points, dtype=np.float64)[:, None] - self._starts
        part = np.clip((to * self._edges).sum(axis=2) / self._lengths**2, 0.0, 1.0)
        away = np.linalg.norm(to - part[:, :, None] * self._edges, axis=2)
        k = np.argmin(away, axis=1)
        rows = np.arange(len(k))
        return self._way[k] + part[rows, k] * self._lengths[k], away[rows, k]

    def same_places(self, other: "ContactOutline", way: Array, moved: Array) -> Array:
        """Ways ``(n,)`` [m] along this outline to where ways along another one lead, whose origin
        is at ``moved (2,)`` [m] less; ``way`` itself if both are the same."""
        old, new = other.shape.outline - moved, self.shape.outline
        if old.shape == new.shape and np.allclose(old, new, rtol=0.0, atol=1e-9):
            return way
        return self.nearest(other.at(way).points - moved)[0]

    def way_of_angle(self, theta: Array) -> Array:
        """``(n,)`` [m] along the outline of the points at polar angles theta ``(n,)`` [rad].

        Raises
        ------
        ValueError: the outline is not convex, so that an angle may not tell one point.
        """
        if not self.shape.convex:
            raise ValueError("only a convex outline has one point at each angle")
        direction = np.column_stack([np.cos(theta), np.sin(theta)])
        a, e = self._starts, self._edges
        # a + t e = r d with r > 0: t = (d x a) / (e x d)
        cross = direction[:, :1] * a[:, 1] - direction[:, 1:] * a[:, 0]
        slope = e[:, 0] * direction[:, 1:] - e[:, 1] * direction[:, :1]
        with np.errstate(divide="ignore", invalid="ignore"):
            t = cross / slope
        ahead = ((a + np.clip(t, 0.0, 1.0)[:, :, None] * e) * direction[:, None]).sum(axis=2) > 0.0
        miss = np.where(ahead & np.isfinite(t), np.maximum(-t, t - 1.0), np.inf)
        k = np.argmin(miss, axis=1)
        part = np.clip(t[np.arange(len(k)), k], 0.0, 1.0)
        way: Array = self._way[k] + part * self._lengths[k]
        return way

    def angle_of_way(self, way: Array) -> Array:
        """``(n,)`` [rad] polar angle in [0, 2 pi) of the points so many metres along."""
        points = self.at(way).points
        return np.mod(np.arctan2(points[:, 1], points[:, 0]), 2.0 * math.pi)
