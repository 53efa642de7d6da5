"""Where a robot with a flat bumper can push an object, convex or not.

A flat face touches an outline along a line of its convex hull, or inside a recess into which the
robot fits. On a line of the hull the face may span a narrower recess. It then pushes on both sides
of the recess, at least on two vertices. Into a recess the robot drives straight from behind, so the
area that it sweeps must be free.
"""

import math

import numpy as np

from push_model.arrays import Array
from push_model.outlines import convex_hull
from push_model.shapes import Shape, Side
from push_model.specs import RobotSpec

_SPAN = 0.9  # of the face's width: widest gap that the face spans
_CONTACT = 0.25  # of the shorter of face and side: least length in contact
_TOUCH = 1e-6  # [m] of overlap that counts as touching
_STRAIGHT = 1e-9  # of the object's size: distance up to which a vertex lies on a line


def pushable_sides(shape: Shape, robot: RobotSpec, clearance: float = 0.005) -> tuple[Side, ...]:
    """The sides that a robot can reach with its flat bumper.

    Parameters
    ----------
    shape: of the object; curved ones have no sides.
    robot: with a flat bumper; its outline is what must fit into a recess.
    clearance: [m] to be left on either side of the robot in a recess.

    Returns
    -------
    All sides of a convex outline. Of another, in the order of the outline: the sides on its hull;
    those that span a recess (``supports`` says what they touch); those in a recess (``room`` says
    where the bumper's middle may be, ``depth`` how far to back out).

    Raises
    ------
    SettingsError: the robot's bumper is not flat.
    """
    width = robot.flat_bumper.width
    if shape.convex or not shape.sides:
        return shape.sides
    found = _hull_sides(shape, width)
    for side in shape.sides:
        if not _on_hull(shape, side):
            room = _room(shape, side, robot, clearance)
            if room is not None:
                behind = float((-(shape.outline - side.start) @ side.inward_normal).max())
                found.append(Side(side.index, side.start, side.end, room=room, depth=behind))
    return tuple(sorted(found, key=lambda s: (s.index % len(shape.outline), s.index)))


def _on_hull(shape: Shape, side: Side) -> bool:
    behind = -(shape.outline - side.start) @ side.inward_normal
    return bool(behind.max() <= _STRAIGHT * shape.circumradius)


def _hull_sides(shape: Shape, width: float) -> list[Side]:
    """The parts that a face of this width can touch on each line of the convex hull."""
    outline, n = shape.outline, len(shape.outline)
    tolerance = _STRAIGHT * shape.circumradius
    hull = convex_hull(outline)
    sides: list[Side] = []
    for a, b in zip(hull, np.roll(hull, -1, axis=0), strict=True):
        tangent = (b - a) / np.hypot(*(b - a))
        offset = outline - a
        on_line = np.abs(offset @ np.array([-tangent[1], tangent[0]])) <= tolerance
        order = [int(i) for i in np.flatnonzero(on_line)]
        order.sort(key=lambda i: float(offset[i] @ tangent))
        group = [order[0]]
        for before, after in zip(order, order[1:], strict=False):
            joined = after == (before + 1) % n
            gap = 0.0 if joined else float((offset[after] - offset[before]) @ tangent)
            if gap > _SPAN * width:
                sides += _of_group(shape, group, width)
                group = []
            group.append(after)
        sides += _of_group(shape, group, width)
    return sides


def _of_group(shape: Shape, group: list[int], width: float) -> list[Side]:
    """The side over vertices on one line whose gaps are at most a bumper's width."""
    outline, n = shape.outline, len(shape.outline)
    if len(group) < 2:
        return []  # a single vertex
    first, last = group[0], group[-1]
    if len(group) == 2 and last == (first + 1) % n:
        return [shape.sides[first]]
    start, end = outline[first], outline[last]
    tangent = (end - start) / np.hypot(*(end - start))
    at = [float((outline[i] - start) @ tangent) for i in group]
    supports = [(at[0], at[0])]
    for k in range(1, len(group)):
        if group[k] == (group[k - 1] + 1) % n:
            supports[-1] = (supports[-1][0], at[k])
        else:
            supports.append((at[k], at[k]))
    if len(supports) == 1:
        return [Side(first, start, end)]
    side = Side(n + first, start, end, tuple(supports))
    return [Side(side.index, start, end, side.supports, _best_place(side, width))]


def _best_place(side: Side, width: float) -> tuple[float, float]:
    """[m] position of the bumper: of the widest contacts the nearest to the centre of mass."""
    rim = min(width / 2.0, side.length / 2.0)
    foot = float(-side.start @ side.tangent)
    wanted = min(max(foot, rim), side.length - rim)
    places = [wanted, *np.linspace(rim, side.length - rim, 101).tolist()]
    reach = []
    for place in places:
        low, high = side.touched(place - width / 2.0, place + width / 2.0) or (place, place)
        reach.append(high - low)
    good = [p for p, r in zip(places, reach, strict=True) if r >= 0.9 * max(reach)]
    best = min(good, key=lambda p: abs(p - wanted))
    return best, best


def _room(
    shape: Shape, side: Side, robot: RobotSpec, clearance: float
) -> tuple[float, float] | None:
    """[m] along a side in a recess, where the middle of the bumper may be."""
    width, length = robot.flat_bumper.width, side.length
    contact = _CONTACT * min(width, length)
    swept = _swept(robot, 2.0 * shape.circumradius + 2.0 * robot.footprint_radius)
    axes = np.column_stack([side.tangent, side.inward_normal])
    points = (shape.outline - side.start) @ axes
    ends = np.roll(points, -1, axis=0)
    free = [(contact - width / 2.0, length + width / 2.0 - contact)]
    for p, q in zip(points, ends, strict=True):
        blocked = _blocked(swept, p, q)
        if blocked is not None:
            low, high = blocked[0] - clearance, blocked[1] + clearance
            parts = [((a, min(b, low)), (max(a, high), b)) for a, b in free]
            free = [(a, b) for pair in parts for a, b in pair if b > a]
    if not free:
        return None
    rim = min(width / 2.0, length / 2.0)
    foot = float(-side.start @ side.tangent)
    wanted = min(max(foot, rim), length - rim)
    return min(free, key=lambda ab: (max(ab[0] - wanted, wanted - ab[1], 0.0), ab[0] - ab[1]))


def _swept(robot: RobotSpec, far: float) -> Array:
    """``(n, 2)`` [m] convex area that a robot sweeps, coming straight from ``far`` behind.

    Frame: along the side and into it, with the bumper's middle at the origin.
    """
    x, y = robot.outline.T
    placed = np.column_stack([-y, x - robot.push_distance - _TOUCH])
    return convex_hull(np.vstack([placed, placed - [0.0, far]]))


def _blocked(swept: Array, p: Array, q: Array) -> tuple[float, float] | None:
    """[m] interval of shifts along the first axis for which a convex outline meets a segment."""
    if p[1] > q[1]:
        p, q = q, p
    low, high = max(p[1], float(swept[:, 1].min())), min(q[1], float(swept[:, 1].max()))
    if low > high:
        return None
    levels = [low, high, *(float(v) for v in swept[:, 1] if low < v < high)]
    least, most = math.inf, -math.inf
    for level in levels:
        left, right = _across(swept, level)
        if q[1] - p[1] > 0.0:
            share = (level - p[1]) / (q[1] - p[1])
            at = [float(p[0] + share * (q[0] - p[0]))]
        else:
            at = [float(p[0]), float(q[0])]
        least = min(least, min(at) - right)
        most = max(most, max(at) - left)
    return least, most


def _across(outline: Array, level: float) -> tuple[float, float]:
    """[m] interval of a convex outline on a line of constant second coordinate."""
    cuts = []
    for p, q in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        if min(p[1], q[1]) <= level <= max(p[1], q[1]):
            if p[1] == q[1]:
                cuts += [float(p[0]), float(q[0])]
            else:
                cuts.append(float(p[0] + (level - p[1]) / (q[1] - p[1]) * (q[0] - p[0])))
    return min(cuts), max(cuts)
