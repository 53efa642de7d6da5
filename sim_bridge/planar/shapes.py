"""Bodies of a planar world as arrays: convex parts, discs and polygons, moving and fixed."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from push_model.arrays import Array, Rows
from push_model.convex_parts import convex_parts
from push_model.occupancy import MapSpec
from push_model.outlines import convex_hull
from push_model.se2 import pose, transform
from push_model.specs import EnvironmentSpec

_BUCKET = 0.25  # [m] of the grid that fixed parts are found by
_BORDER = 0.5  # [m] thickness of the arena's walls


@dataclass(frozen=True)
class Part:
    """A convex part: a disc about ``centre`` (no outline), or a polygon.

    centre: ``(2,)`` [m]; radius: [m] of the disc, or of the circle about centre that holds the
    outline ``(n, 2)``, which is counter-clockwise. friction: of its surface; that of a contact is
    the product of both. robot_friction: of a contact between two robots that are alike; 0 for what
    is no robot. Of two that differ it is the geometric mean.
    """

    centre: Array
    radius: float
    outline: Array | None
    friction: float
    robot_friction: float = 0.0

    @classmethod
    def polygon(cls, outline: Array, friction: float) -> "Part":
        """A convex polygon ``(n, 2)``."""
        centre = 0.5 * (outline.min(axis=0) + outline.max(axis=0))
        radius = float(np.hypot(*(outline - centre).T).max())
        return cls(centre, radius, outline, friction)

    @classmethod
    def disc(cls, centre: Array, radius: float, friction: float) -> "Part":
        """A disc."""
        return cls(np.asarray(centre, dtype=np.float64), radius, None, friction)


@dataclass(frozen=True)
class PartTable:
    """Parts of all bodies; fixed ones have body -1.

    body, first, count ``(p,)``: whose it is; its vertices in ``vertices (v, 2)``, none for a disc.
    local ``(p, 2)``, radius ``(p,)`` [m]: the circle that holds it. friction ``(p,
    2)``: its own, and the root of that on its like, -1 for what is no robot.
    """

    body: Rows
    first: Rows
    count: Rows
    local: Array
    radius: Array
    friction: Array
    vertices: Array

    @classmethod
    def of(cls, parts: Sequence[tuple[int, Part]]) -> "PartTable":
        """From parts with the number of their body."""
        count = np.array([0 if p.outline is None else len(p.outline) for _, p in parts], dtype=int)
        outlines = [p.outline for _, p in parts if p.outline is not None]
        return cls(
            np.array([b for b, _ in parts], dtype=np.int64),
            np.concatenate([[0], np.cumsum(count)])[:-1].astype(np.int64),
            count.astype(np.int64),
            np.array([p.centre for _, p in parts]).reshape(-1, 2),
            np.array([p.radius for _, p in parts], dtype=np.float64),
            np.array(
                [(p.friction, np.sqrt(p.robot_friction) or -1.0) for _, p in parts],
                dtype=np.float64,
            ).reshape(-1, 2),
            np.vstack(outlines) if outlines else np.zeros((1, 2)),
        )


@dataclass(frozen=True)
class Buckets:
    """Fixed parts by the cells of a grid that their bounding boxes overlap.

    low ``(2,)`` [m], size ``(2,)`` cells; start ``(cells + 1,)``, items: part numbers in turn.
    box ``(parts, 4)``: x and y, least and most.
    """

    low: Array
    size: Rows
    start: Rows
    items: Rows
    box: Array
    spacing: float

    @classmethod
    def of(cls, table: PartTable, spacing: float = _BUCKET) -> "Buckets":
        """Of a table of fixed parts."""
        boxes = []
        for k in range(len(table.body)):
            if table.count[k]:
                outline = table.vertices[table.first[k] : table.first[k] + table.count[k]]
                boxes.append([*outline.min(axis=0), *outline.max(axis=0)])
            else:
                c, r = table.local[k], table.radius[k]
                boxes.append([c[0] - r, c[1] - r, c[0] + r, c[1] + r])
        box = np.array(boxes, dtype=np.float64).reshape(-1, 4)
        low = box[:, :2].min(axis=0) if len(box) else np.zeros(2)
        high = box[:, 2:].max(axis=0) if len(box) else np.ones(2)
        size = np.maximum(1, np.ceil((high - low) / spacing)).astype(np.int64)
        cells: list[list[int]] = [[] for _ in range(int(size[0] * size[1]))]
        for k, (x0, y0, x1, y1) in enumerate(box):
            first = np.clip(((np.array([x0, y0]) - low) // spacing), 0, size - 1).astype(int)
            last = np.clip(((np.array([x1, y1]) - low) // spacing), 0, size - 1).astype(int)
            for row in range(first[1], last[1] + 1):
                for column in range(first[0], last[0] + 1):
                    cells[row * size[0] + column].append(k)
        start = np.concatenate([[0], np.cumsum([len(c) for c in cells])]).astype(np.int64)
        items = np.array([k for c in cells for k in c], dtype=np.int64)
        return cls(low, size, start, items, box, spacing)


def body_parts(outline: Array, friction: float) -> list[Part]:
    """Parts of a body from its outline ``(n, 2)`` about the centre of mass, convex or not."""
    return [Part.polygon(np.asarray(p), friction) for p in convex_parts(outline)]


def fixed_parts(environment: EnvironmentSpec | MapSpec) -> list[tuple[str, Part]]:
    """Walls and obstacles with their names, as PyBullet's world calls them."""
    mu = environment.wall_friction
    if isinstance(environment, MapSpec):
        found = _boxes(
            ((x0 + x1) / 2, (y0 + y1) / 2, x1 - x0, y1 - y0, 0.0)
            for x0, x1, y0, y1 in environment.grid.rectangles()
        )
        return [(f"wall{i}", Part.polygon(o, mu)) for i, o in enumerate(found)]
    (sx, sy), t = environment.size, _BORDER
    border = [
        (0.0, (sy + t) / 2, sx + 2 * t, t, 0.0),
        (0.0, -(sy + t) / 2, sx + 2 * t, t, 0.0),
        ((sx + t) / 2, 0.0, t, sy, 0.0),
        (-(sx + t) / 2, 0.0, t, sy, 0.0),
    ]
    boxes = _boxes(border + [(*b.centre, *b.size, b.yaw) for b in environment.boxes])
    result = [(f"wall{i}", Part.polygon(o, mu)) for i, o in enumerate(boxes)]
    for i, c in enumerate(environment.circles):
        result.append((f"circle{i}", Part.disc(np.array(c.centre), c.radius, mu)))
    for i, p in enumerate(environment.polygons):
        hull = convex_hull(np.array(p.vertices))  # as PyBullet makes it of a mesh
        result.append((f"polygon{i}", Part.polygon(hull, mu)))
    return result


def _boxes(rows: Iterable[tuple[float, ...]]) -> list[Array]:
    """Outlines of boxes of x, y, length, width, yaw."""
    outlines = []
    for x, y, length, width, yaw in rows:
        a, b = 0.5 * length, 0.5 * width
        corners = np.array([[-a, -b], [a, -b], [a, b], [-a, b]])
        outlines.append(transform(pose(x, y, yaw), corners))
    return outlines
