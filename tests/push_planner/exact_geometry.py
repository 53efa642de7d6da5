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


def _edges(polygons):
    """Both ends (..., n, 2) of the sides of polygons."""
    return polygons, np.roll(polygons, -1, axis=-2)


def _point_segments(points, a, b):
    """(..., n, m) distances of points (..., n, 2) from segments (..., m, 2)."""
    along = b - a
    offset = points[..., :, None, :] - a[..., None, :, :]
    along = along[..., None, :, :]
    t = (offset * along).sum(-1) / (along * along).sum(-1)
    apart = offset - np.clip(t, 0.0, 1.0)[..., None] * along
    return np.hypot(apart[..., 0], apart[..., 1])


def _inside(points, polygon):
    """Whether points (..., n, 2) lie in a convex polygon (..., m, 2)."""
    a, b = _edges(polygon)
    side = _cross((b - a)[..., None, :, :], points[..., :, None, :] - a[..., None, :, :])
    return (side >= 0.0).all(axis=-1) | (side <= 0.0).all(axis=-1)


def _cross(u, v):
    return u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]


def _sides_cross(p, q):
    """Whether any sides of closed polygons (..., n, 2) and (..., m, 2) cross."""
    (a, b), (c, d) = _edges(p), _edges(q)
    a, b, c, d = a[..., :, None, :], b[..., :, None, :], c[..., None, :, :], d[..., None, :, :]

    def turn(u, v, w):
        return _cross(v - u, w - u)

    apart = (turn(a, b, c) * turn(a, b, d) < 0) & (turn(c, d, a) * turn(c, d, b) < 0)
    return apart.any(axis=(-2, -1))


def convex_distance(p, q):
    """Exact distance of convex polygons (..., n, 2) and (m, 2), 0 on overlap."""
    q = np.broadcast_to(q, (*p.shape[:-2], *q.shape))
    met = _inside(p, q).any(axis=-1) | _inside(q, p).any(axis=-1) | _sides_cross(p, q)
    there = _point_segments(p, *_edges(q)).min(axis=(-2, -1))
    back = _point_segments(q, *_edges(p)).min(axis=(-2, -1))
    return np.where(met, 0.0, np.minimum(there, back))


def _solid(world):
    """Convex polygons of boxes and polygons."""
    return [corners_of(b) for b in world.boxes] + [np.array(p.vertices) for p in world.polygons]


def points_distance(world, points):
    """Exact distances of points ``(n, 2)`` from all that is solid in a world, walls included."""
    points = np.asarray(points, dtype=float).reshape(-1, 2)
    least = (np.array(world.size) / 2.0 - np.abs(points)).min(axis=1)
    for shape in _solid(world):
        gap = _point_segments(points, *_edges(shape)).min(axis=1)
        least = np.minimum(least, np.where(_inside(points, shape), 0.0, gap))
    for circle in world.circles:
        least = np.minimum(least, np.hypot(*(points - circle.centre).T) - circle.radius)
    return np.maximum(least, 0.0)


def body_distance(world, body):
    """Exact distances of convex bodies ``(..., n, 2)`` from all that is solid in a world."""
    least = (np.array(world.size) / 2.0 - np.abs(body)).min(axis=(-2, -1))
    for shape in _solid(world):
        least = np.minimum(least, convex_distance(body, shape))
    for circle in world.circles:
        centre = np.broadcast_to(np.array([circle.centre]), (*body.shape[:-2], 1, 2))
        gap = _point_segments(centre, *_edges(body)).min(axis=(-2, -1)) - circle.radius
        least = np.minimum(least, np.where(_inside(centre, body).any(axis=-1), 0.0, gap))
    return np.maximum(least, 0.0)


def placed(poses, body):
    """A body (n, 2) at poses (k, 3): (k, n, 2)."""
    c, s = np.cos(poses[:, 2])[:, None], np.sin(poses[:, 2])[:, None]
    x, y = body.T
    turned = np.stack([c * x - s * y, s * x + c * y], axis=-1)
    return turned + poses[:, None, :2]
