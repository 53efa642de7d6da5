"""Shapes of pushed objects: outline, area, centre of mass, inertia, and sides to push on.

The outline is a counter-clockwise polygon whose origin is the centre of mass. Curved shapes are
polygons with many vertices and have no sides to push on with a flat bumper.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from push_model.arrays import Array
from push_model.settings import SettingsError


@dataclass(frozen=True)
class Side:
    """A flat side of an object, in the object frame.

    index: number of the side, which starts at that vertex; plus n for a side that spans a recess
        of a concave outline of n vertices.
    start, end: ``(2,)`` [m] its ends, counter-clockwise.
    supports: [m] intervals along it where the object can be pushed, e.g. the two tips of a U;
        everywhere if empty.
    room: [m] interval along it for the middle of the bumper; everywhere if None.
    depth: [m] by which the object extends back beside the pusher, which must back out that far.
    """

    index: int
    start: Array
    end: Array
    supports: tuple[tuple[float, float], ...] = ()
    room: tuple[float, float] | None = None
    depth: float = 0.0

    @property
    def length(self) -> float:
        """[m]."""
        return float(np.hypot(*(self.end - self.start)))

    @property
    def tangent(self) -> Array:
        """``(2,)`` unit vector from start to end."""
        direction: Array = (self.end - self.start) / self.length
        return direction

    @property
    def inward_normal(self) -> Array:
        """``(2,)`` unit vector along which a pusher on this side pushes."""
        t = self.tangent
        return np.array([-t[1], t[0]])

    @property
    def heading(self) -> float:
        """[rad] direction of the inward normal in the object frame."""
        n = self.inward_normal
        return math.atan2(n[1], n[0])

    @property
    def distance(self) -> float:
        """[m] from the side to the centre of mass."""
        return float(-self.start @ self.inward_normal)

    def touched(self, low: float, high: float) -> tuple[float, float] | None:
        """[m] interval along the side that a bumper from ``low`` to ``high`` touches."""
        supports = self.supports or ((0.0, self.length),)
        parts = [(max(a, low), min(b, high)) for a, b in supports if a <= high and b >= low]
        return (parts[0][0], parts[-1][1]) if parts else None


@dataclass(frozen=True)
class Shape:
    """A planar shape with its centre of mass at the origin.

    kind: name of the constructor.
    outline: ``(n, 2)`` [m] vertices, counter-clockwise.
    sides: flat sides that a bumper can push on; empty for curved shapes.
    """

    kind: str
    outline: Array
    sides: tuple[Side, ...]

    @property
    def area(self) -> float:
        """[m^2]."""
        return _area(self.outline)

    @property
    def inertia_per_mass(self) -> float:
        """[m^2] polar moment of inertia about the centre of mass, divided by the mass."""
        x, y = self.outline.T
        x1, y1 = np.roll(x, -1), np.roll(y, -1)
        cross = x * y1 - x1 * y
        second = (x * x + x * x1 + x1 * x1 + y * y + y * y1 + y1 * y1) @ cross / 12.0
        return float(second / self.area)

    @property
    def circumradius(self) -> float:
        """[m] greatest distance of the outline from the centre of mass."""
        return float(np.hypot(*self.outline.T).max())

    @property
    def inradius(self) -> float:
        """[m] least distance of the outline from the centre of mass."""
        a = self.outline
        edge = np.roll(a, -1, axis=0) - a
        t = np.clip(-(a * edge).sum(1) / (edge * edge).sum(1), 0.0, 1.0)
        return float(np.hypot(*(a + t[:, None] * edge).T).min())

    @property
    def convex(self) -> bool:
        """Whether the outline is convex."""
        edge = np.roll(self.outline, -1, axis=0) - self.outline
        following = np.roll(edge, -1, axis=0)
        turn = edge[:, 0] * following[:, 1] - edge[:, 1] * following[:, 0]
        return bool((turn >= -1e-12).all())

    def about(self, point: tuple[float, float]) -> "Shape":
        """The same shape with its origin, the centre of mass, at a point [m] of this frame."""
        outline = self.outline - np.array(point)
        shape = Shape(self.kind, outline, ())
        return replace(shape, sides=_sides(outline)) if self.sides else shape

    def dense_outline(self, spacing: float) -> Array:
        """``(m, 2)`` [m] points of the outline, vertices included, at most ``spacing`` apart."""
        return densified(self.outline, spacing)


def densified(outline: Array, spacing: float) -> Array:
    """``(m, 2)`` [m] points of a closed outline ``(n, 2)``, vertices included, at this spacing."""
    points = []
    for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        n = max(1, math.ceil(float(np.hypot(*(b - a))) / spacing))
        points.append(a + np.arange(n)[:, None] / n * (b - a))
    return np.vstack(points)


def polygon(vertices: Array, kind: str = "polygon", moved: bool = True) -> Shape:
    """A polygon from its vertices ``(n, 2)`` [m], either orientation.

    moved: whether the origin is moved to the centroid of the area. If not, the centre of mass is
    taken to be at the origin of the vertices.

    Raises
    ------
    SettingsError: fewer than three vertices, non-finite, repeated, zero area or self-crossing.
    """
    points = np.array(vertices, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 3:
        raise SettingsError(f"a polygon needs at least three (x, y) vertices, got {vertices!r}")
    if not np.isfinite(points).all():
        raise SettingsError("a polygon's vertices must be finite")
    size = float(np.ptp(points, axis=0).max())
    gaps = np.hypot(*(points - np.roll(points, 1, axis=0)).T)
    if gaps.min() <= 1e-9 * max(size, 1e-300):
        raise SettingsError("a polygon must not repeat a vertex")
    if abs(_area(points)) <= 1e-9 * size**2:
        raise SettingsError("a polygon must have an area")
    if _area(points) < 0.0:
        points = points[::-1].copy()
    if kind == "polygon" and _crosses_itself(points):
        raise SettingsError("a polygon's sides must not cross each other")
    outline = points - _centroid(points) if moved else points
    return Shape(kind, outline, _sides(outline))


def rectangle(length: float, width: float) -> Shape:
    """A rectangle, ``length`` [m] along x and ``width`` [m] along y. Side 0 is its -x side."""
    a, b = length / 2.0, width / 2.0
    return polygon(np.array([[-a, b], [-a, -b], [a, -b], [a, b]]), "rectangle")


def ellipse(semi_axis_x: float, semi_axis_y: float, vertices: int = 96) -> Shape:
    """An ellipse as a polygon of equal area."""
    angle = np.arange(vertices) * 2.0 * np.pi / vertices
    scale = math.sqrt(2.0 * math.pi / (vertices * math.sin(2.0 * math.pi / vertices)))
    outline = scale * np.column_stack([semi_axis_x * np.cos(angle), semi_axis_y * np.sin(angle)])
    return Shape("ellipse", outline, ())


def flower(radius: float, amplitude: float, petals: int, vertices: int = 180) -> Shape:
    """A flower, r(phi) = radius + amplitude cos(petals phi) [m]."""
    if not 0.0 <= amplitude < radius:
        raise SettingsError(f"flower: amplitude must be in [0, radius), got {amplitude}")
    if petals < 2:
        raise SettingsError(f"flower: at least two petals are needed, got {petals}")
    angle = np.arange(vertices) * 2.0 * np.pi / vertices
    r = radius + amplitude * np.cos(petals * angle)
    outline = np.column_stack([r * np.cos(angle), r * np.sin(angle)])
    return Shape("flower", outline - _centroid(outline), ())


def _sides(outline: Array) -> tuple[Side, ...]:
    ends = np.roll(outline, -1, axis=0)
    return tuple(Side(i, a, b) for i, (a, b) in enumerate(zip(outline, ends, strict=True)))


def _area(points: Array) -> float:
    x, y = points.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0


def _centroid(points: Array) -> Array:
    x, y = points.T
    x1, y1 = np.roll(x, -1), np.roll(y, -1)
    cross = x * y1 - x1 * y
    return np.array([(x + x1) @ cross, (y + y1) @ cross]) / (6.0 * _area(points))


def _crosses_itself(points: Array) -> bool:
    """Whether two sides that are not neighbours meet."""
    n = len(points)
    ends = np.roll(points, -1, axis=0)
    a, b, c, d = points[:, None], ends[:, None], points[None], ends[None]

    def turn(p: Array, q: Array, r: Array) -> Array:
        left: Array = (q[..., 0] - p[..., 0]) * (r[..., 1] - p[..., 1])
        return left - (q[..., 1] - p[..., 1]) * (r[..., 0] - p[..., 0])

    meet = (turn(a, b, c) * turn(a, b, d) <= 0.0) & (turn(c, d, a) * turn(c, d, b) <= 0.0)
    low, high = np.minimum(points, ends), np.maximum(points, ends)
    meet &= (low[:, None] <= high[None]).all(axis=2) & (low[None] <= high[:, None]).all(axis=2)
    i, j = np.nonzero(meet)
    apart = (j - i) % n
    return bool(((apart > 1) & (apart < n - 1)).any())
