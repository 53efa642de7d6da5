"""Sides of concave outlines that a flat bumper reaches, against brute force with points."""

import math

import numpy as np
import pytest

from push_model import SettingsError, contact_on_side, ellipse, flower, polygon, rectangle, se2
from push_model.bumpers import FlatBumper, RingBumper
from push_model.drives import SpeedDrive
from push_model.outlines import convex_hull, distance, inside, inside_convex
from push_model.pushable_sides import pushable_sides
from push_model.specs import RobotSpec

DRIVE = SpeedDrive(0.0205, 0.0265, 6.28, 0.008, 0.05)


def robot(width=0.07, d=0.05, body=0.037):
    return RobotSpec(DRIVE, FlatBumper(width, d), body, 0.045, 0.2)


def u_shape(gap, depth=0.2, tip=0.06):
    """A U open to the top, with its recess in the middle."""
    a = gap / 2.0
    b = a + tip
    return polygon(
        np.array([[-b, 0], [b, 0], [b, depth + tip], [a, depth + tip]]).tolist()
        + [[a, tip], [-a, tip], [-a, depth + tip], [-b, depth + tip]]
    )


def l_shape(arm=0.3, wide=0.1):
    return polygon([[0, 0], [arm, 0], [arm, wide], [wide, wide], [wide, arm], [0, arm]])


def t_shape(bar=0.3, stem=0.2, wide=0.1):
    a, b = bar / 2.0, wide / 2.0
    return polygon(
        [[-b, 0], [b, 0], [b, stem], [a, stem], [a, stem + wide], [-a, stem + wide], [-a, stem]]
        + [[-b, stem]]
    )


def robot_pose(side, width, d):
    """Axle midpoint in the object's frame when the bumper is on the side."""
    contact = contact_on_side(side, width)
    grasp = contact.object_pose + [d, 0.0, 0.0]
    return se2.inverse(grasp), contact


def indices(shape, machine):
    return [s.index for s in pushable_sides(shape, machine)]


def test_convex_and_curved_shapes_keep_their_sides():
    for shape in (rectangle(0.2, 0.1), polygon([[0, 0], [0.2, 0], [0.1, 0.2]])):
        assert pushable_sides(shape, robot()) is shape.sides
    assert pushable_sides(ellipse(0.2, 0.1), robot()) == ()
    assert pushable_sides(flower(0.2, 0.05, 5), robot()) == ()
    ring = RobotSpec(DRIVE, RingBumper(0.05), 0.037, 0.045, 0.2)
    with pytest.raises(SettingsError, match="flat bumper"):
        pushable_sides(rectangle(0.2, 0.1), ring)


def test_u_is_pushed_on_its_tips_across_its_gap_or_in_it():
    """Bottom 0, right 1, right tip 2, inner right 3, floor 4, inner left 5, left tip 6, left 7."""
    narrow = u_shape(0.05)
    assert indices(narrow, robot()) == [0, 1, 10, 7]  # the gap is spanned: 8 + vertex 2
    spanning = pushable_sides(narrow, robot())[2]
    assert np.allclose(spanning.supports, [[0.0, 0.06], [0.11, 0.17]])
    _, contact = robot_pose(spanning, 0.07, 0.05)
    assert (contact.right, contact.left) == pytest.approx((-0.035, 0.035))
    # too wide to be spanned, too narrow for the robot: each tip for itself
    assert indices(u_shape(0.078), robot()) == [0, 1, 2, 6, 7]
    # the robot fits, body and bumper: on the floor too, but not on the inner sides
    wide = u_shape(0.12)
    assert indices(wide, robot()) == [0, 1, 2, 4, 6, 7]
    floor = pushable_sides(wide, robot())[3]
    assert floor.depth == pytest.approx(0.2)
    assert floor.room == pytest.approx((0.037 + 0.005, 0.12 - 0.037 - 0.005), abs=1e-3)
    # there is room to turn, but no straight way from outside to the inner sides
    assert indices(u_shape(0.6, tip=0.1), robot()) == [0, 1, 2, 4, 6, 7]


def test_l_is_pushed_inside_where_the_bumper_has_room():
    shape = l_shape()
    sides = pushable_sides(shape, robot())
    assert [s.index for s in sides] == [0, 1, 2, 3, 4, 5]
    room = {s.index: s.room for s in sides}
    assert room[0] is room[1] is room[4] is room[5] is None
    assert room[2][1] == pytest.approx(0.2 - 0.037 - 0.005, abs=1e-3)  # the wall at its end
    assert room[3][0] == pytest.approx(0.037 + 0.005, abs=1e-3)  # and at its beginning
    # a wide face spans from tip to tip too, and sticks out where the inner sides end
    wide = pushable_sides(shape, robot(0.4, 0.06, 0.05))
    assert [s.index for s in wide] == [0, 1, 2, 8, 3, 4, 5]
    assert np.allclose(wide[3].supports, [[0.0, 0.0], [0.2 * math.sqrt(2)] * 2])
    assert wide[3].heading == pytest.approx(-0.75 * math.pi)


def test_t_has_two_inner_corners():
    assert indices(t_shape(), robot()) == [0, 1, 2, 3, 4, 5, 6, 7]
    # a body that is too large for the corners under the bar: only what the hull shows
    big = robot(0.08, 0.4, 0.39)
    assert indices(t_shape(), big) == [0, 3, 4, 5]


def random_outline(random):
    """A concave outline: a star with few rays, or squares grown side by side."""
    if random.random() < 0.5:
        n = int(random.integers(5, 12))
        angle = np.sort(random.uniform(0, 2 * math.pi, n))
        if np.diff(angle, append=angle[0] + 2 * math.pi).max() > 3.0:
            return random_outline(random)
        r = random.uniform(0.05, 0.3, n)
        return np.column_stack([r * np.cos(angle), r * np.sin(angle)])
    heights = random.choice([0.04, 0.1, 0.16, 0.3], int(random.integers(2, 6)))
    widths = random.choice([0.05, 0.08, 0.11, 0.2], len(heights))
    points, x = [], 0.0
    for h, w in zip(heights, widths, strict=True):
        points += [[x, h], [x + w, h]]
        x += w
    skyline = [p for i, p in enumerate(points) if i == 0 or p != points[i - 1]]
    return np.array([[0.0, 0.0], *skyline, [x, 0.0]])


def cases(count):
    random = np.random.default_rng(8)
    made = 0
    while made < count:
        try:
            shape = polygon(random_outline(random))
        except SettingsError:
            continue
        if shape.convex:
            continue
        made += 1
        width = float(random.choice([0.03, 0.07, 0.12, 0.25]))
        body = float(random.uniform(0.02, 0.08))
        yield shape, robot(width, body + float(random.uniform(0.005, 0.03)), body)


def filled(outline, spacing=0.004):
    """Points spread over a convex outline, its edges too."""
    low, high = outline.min(axis=0), outline.max(axis=0)
    axes = [
        np.linspace(a, b, max(2, int((b - a) / spacing))) for a, b in zip(low, high, strict=True)
    ]
    grid = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    share = np.linspace(0.0, 1.0, 20)[:, None, None]
    rim = outline + share * (np.roll(outline, -1, axis=0) - outline)
    return np.vstack([grid[inside_convex(outline, grid)], rim.reshape(-1, 2)]), outline


def buried(shape, rim, body, pose):
    """[m] how deep the deepest point of the robot lies in the object, or of the object in it.

    rim: points of the object's outline. body: points of the robot, and its hull.
    """
    points = se2.transform(pose, body[0])
    within = points[inside(shape.outline, points)]
    deepest = float(distance(shape.outline, within).max()) if len(within) else 0.0
    hull = se2.transform(pose, body[1])
    within = rim[inside_convex(hull, rim)]
    return max(deepest, float(distance(hull, within).max()) if len(within) else 0.0)


def test_no_robot_on_a_pushable_side_overlaps_the_outline():
    """200 random outlines and robots: in contact, and on the straight way to it."""
    recessed = spanning = 0
    for shape, machine in cases(200):
        width, d = machine.flat_bumper.width, machine.push_distance
        body, rim = filled(convex_hull(machine.outline), 0.015), shape.dense_outline(0.005)
        for side in pushable_sides(shape, machine):
            pose, contact = robot_pose(side, width, d)
            for back in (0.0, 0.02, 0.2):
                at = se2.compose(pose, np.array([-back, 0.0, 0.0]))
                assert buried(shape, rim, body, at) <= 2e-6
            ends = se2.transform(pose, np.array([[d, contact.right], [d, contact.left]]))
            assert distance(shape.outline, ends).max() < 1e-7  # it does touch at both ends
            assert contact.left - contact.right > 0.2 * min(width, side.length)
            recessed += side.room is not None and not side.supports
            spanning += bool(side.supports)
    assert recessed > 500 and spanning > 30


def test_every_recess_that_has_room_is_found():
    """Wherever points say that the robot fits with twice the clearance, the side is there."""
    checked = 0
    for shape, machine in cases(40):
        width, d = machine.flat_bumper.width, machine.push_distance
        found = {s.index for s in pushable_sides(shape, machine)}
        wide = convex_hull(machine.outline)
        wide = np.vstack([wide + [0.0, 0.011], wide - [0.0, 0.011], wide - [0.8, 0.0]])
        body, rim = filled(convex_hull(wide - [1e-5, 0.0]), 0.02), shape.dense_outline(0.005)
        for side in shape.sides:
            contact = 0.3 * min(width, side.length)
            for along in np.linspace(contact - width / 2, side.length + width / 2 - contact, 15):
                at = side.start + along * side.tangent - d * side.inward_normal
                pose = np.array([*at, side.heading])
                if buried(shape, rim, body, pose) == 0.0:
                    assert (
                        side.index in found
                        or side.index + len(shape.outline) in found
                        or _in_longer(shape, side, found)
                    )
                    checked += 1
                    break
    assert checked > 100


def _in_longer(shape, side, found):
    """Whether a side lies within one that was found over several vertices of its line."""
    n = len(shape.outline)
    before = side.index
    for _ in range(n):
        before = (before - 1) % n
        if before in found or before + n in found:
            offset = shape.outline[before] - side.start
            return abs(offset @ side.inward_normal) < 1e-9
    return False
