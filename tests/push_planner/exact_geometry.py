"""Random worlds and exact distances in them, for tests: no grid, no code of the planner."""

import math

import numpy as np

from push_model.specs import BoxSpec, CircleSpec, EnvironmentSpec, PolygonSpec


def random_world(random, count, resolution=0.01, size=(3.0, 2.0), largest=0.5):
    """Boxes of any yaw, circles and triangles at random places."""

    def place():
        return tuple(float(v) for v in random.uniform(-0.5, 0.5, 2) * size)

    boxes, circles, polygons = [], [], []
    for _ in range(count):
        kind = random.integers(3)
        if kind == 0:
            sides = tuple(float(v) for v in random.uniform(0.02, largest, 2))
            boxes.append(BoxSpec(place(), sides, float(random.uniform(-np.pi, np.pi))))
        elif kind == 1:
            circles.append(CircleSpec(place(), float(random.uniform(0.01, largest / 2))))
        else:
            angle = np.sort(random.uniform(0.0, 2.0 * np.pi, 3))
            if min(*np.diff(angle), angle[0] + 2.0 * np.pi - angle[2]) < 0.3:
                continue
            corners = random.uniform(0.03, largest / 2) * np.column_stack(
                [np.cos(angle), np.sin(angle)]
            )
            polygons.append(PolygonSpec(tuple((float(x), float(y)) for x, y in corners + place())))
    return EnvironmentSpec(size, tuple(boxes), tuple(circles), tuple(polygons), resolution)


def corners_of(box):
    c, s = math.cos(box.yaw), math.sin(box.yaw)
    half = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * np.array(box.size) / 2.0
    return half @ np.array([[c, s], [-s, c]]) + box.centre


def _point_segments(points, a, b):
    """(n, m) distances of points from segments."""
    along = b - a
    t = ((points[:, None] - a) * along).sum(-1) / (along * along).sum(-1)
    nearest = a + np.clip(t, 0.0, 1.0)[..., None] * along
    return np.hypot(*np.moveaxis(points[:, None] - nearest, -1, 0))


def _inside(points, polygon):
    """Whether points lie in a convex polygon."""
    a, b = polygon, np.roll(polygon, -1, axis=0)
    side = _cross(b - a, points[:, None] - a)
    return (side >= 0.0).all(axis=1) | (side <= 0.0).all(axis=1)


def _cross(u, v):
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def _sides_cross(p, q):
    """Whether any sides of two closed polygons cross."""
    a, b, c, d = p, np.roll(p, -1, axis=0), q, np.roll(q, -1, axis=0)

    def turn(u, v, w):
        return _cross(v - u, w - u)

    a, b, c, d = a[:, None], b[:, None], c[None], d[None]
    return bool(((turn(a, b, c) * turn(a, b, d) < 0) & (turn(c, d, a) * turn(c, d, b) < 0)).any())


def convex_distance(p, q):
    """Exact distance of two convex polygons, 0 on overlap."""
    if _inside(p, q).any() or _inside(q, p).any() or _sides_cross(p, q):
        return 0.0
    return min(
        _point_segments(p, q, np.roll(q, -1, axis=0)).min(),
        _point_segments(q, p, np.roll(p, -1, axis=0)).min(),
    )


def points_distance(world, points):
    """Exact distances of points ``(n, 2)`` from all that is solid in a world, walls included."""
    points = np.asarray(points, dtype=float).reshape(-1, 2)
    least = (np.array(world.size) / 2.0 - np.abs(points)).min(axis=1)
    shapes = [corners_of(b) for b in world.boxes] + [np.array(p.vertices) for p in world.polygons]
    for shape in shapes:
        gap = _point_segments(points, shape, np.roll(shape, -1, axis=0)).min(axis=1)
        least = np.minimum(least, np.where(_inside(points, shape), 0.0, gap))
    for circle in world.circles:
        least = np.minimum(least, np.hypot(*(points - circle.centre).T) - circle.radius)
    return np.maximum(least, 0.0)


def body_distance(world, body):
    """Exact distance of a convex body ``(n, 2)`` from all that is solid in a world."""
    least = float((np.array(world.size) / 2.0 - np.abs(body)).min())
    shapes = [corners_of(b) for b in world.boxes] + [np.array(p.vertices) for p in world.polygons]
    least = min([least, *(convex_distance(body, shape) for shape in shapes)])
    for circle in world.circles:
        centre = np.array([circle.centre])
        if _inside(centre, body).any():
            return 0.0
        gap = float(_point_segments(centre, body, np.roll(body, -1, axis=0)).min())
        least = min(least, gap - circle.radius)
    return max(least, 0.0)
