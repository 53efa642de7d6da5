"""Grasp-task compatibility against closed forms and against linear programmes."""

import numpy as np
import pytest
from scipy.optimize import linprog, nnls

from grasp_opt.contact_outline import ContactOutline
from grasp_opt.wrench_cone import (
    HELD,
    compatible,
    margin,
    margins,
    task_wrenches,
    wrench_rays,
)
from push_model.limit_surface import EllipsoidLimitSurface
from push_model.shapes import ellipse, polygon, rectangle

SURFACE = EllipsoidLimitSurface(1.77, 0.2)
SHAPES = [
    rectangle(0.35, 0.35),
    ellipse(0.255, 0.175),
    polygon(np.array([[0.25, 0.0], [-0.125, 0.2165], [-0.125, -0.2165]])),
    polygon(0.22 * np.array([[np.cos(a), np.sin(a)] for a in np.arange(6) * np.pi / 3])),
]


def lp_holds(rays, wrench):
    """Whether a wrench is a conical combination of rays, by HiGHS."""
    answer = linprog(
        np.zeros(len(rays)), A_eq=rays.T, b_eq=wrench, bounds=(0, None), method="highs"
    )
    return answer.status == 0


def test_two_opposite_contacts_on_a_square():
    """Pushing along x on one whole side, at y = +-a: what they hold can be told by hand."""
    a, friction = 0.1, 0.5
    points = np.array([[-a, a], [-a, -a]])
    normals = np.array([[1.0, 0.0], [1.0, 0.0]])
    rays = wrench_rays(points, normals, friction, 1.0)
    t = np.arctan(friction)
    # The extreme forces are those of either contact; straight ahead lies between facets that are
    # spanned by both right and by both left edges: normal to (cos t, -+ sin t, torque).
    right = np.array([[np.cos(t), -np.sin(t), a * np.sin(t) + s * a * np.cos(t)] for s in (-1, 1)])
    facet = np.cross(*(r / np.linalg.norm(r) for r in right))
    facet /= np.linalg.norm(facet)
    ahead = np.array([[1.0, 0.0, 0.0]])
    assert margin(rays, ahead) == pytest.approx(min(abs(facet[0]), margin_of_ends(rays)), abs=1e-12)
    assert margin(rays, np.array([[-1.0, 0.0, 0.0]])) < -0.1
    # Sideways with the friction's slope: on the boundary where the torque is that of one line.
    edge = np.array([[np.cos(t), np.sin(t), -a * np.sin(t)]])
    assert margin(rays, edge / np.linalg.norm(edge)) == pytest.approx(0.0, abs=1e-12)


def margin_of_ends(rays):
    """The facets that are spanned by one contact's two edges."""
    values = []
    for k in (0, 2):
        facet = np.cross(rays[k], rays[k + 1])
        values.append(abs(facet[0]) / np.linalg.norm(facet))
    return min(values)


def test_one_contact_is_flat_and_none_holds_what_is_off_its_plane():
    points, normals = np.array([[-0.1, 0.02]]), np.array([[1.0, 0.0]])
    rays = wrench_rays(points, normals, 0.5, 0.1)
    middle = rays.sum(axis=0) / np.linalg.norm(rays.sum(axis=0))
    plane = np.cross(*rays) / np.linalg.norm(np.cross(*rays))
    assert margin(rays, middle[None]) == pytest.approx(0.0, abs=1e-12)
    off = middle + 0.1 * plane
    assert margin(rays, off[None] / np.linalg.norm(off)) == pytest.approx(
        -0.1 / np.hypot(1.0, 0.1), abs=1e-9
    )
    assert margin(rays, -middle[None]) < -0.5
    without = wrench_rays(points, normals, 0.0, 0.1)
    assert margin(without, without[:1]) >= -HELD
    assert margin(without, middle[None]) <= -HELD or np.allclose(middle, without[0])
    assert margin(without, -without[:1]) == -1.0


def test_contacts_all_round_hold_everything():
    angle = np.arange(4) * np.pi / 2 + 0.2
    points = 0.2 * np.column_stack([np.cos(angle), np.sin(angle)])
    turned = np.column_stack([np.cos(angle + np.pi + 0.3), np.sin(angle + np.pi + 0.3)])
    other = np.column_stack([np.cos(angle + np.pi - 0.3), np.sin(angle + np.pi - 0.3)])
    rays = wrench_rays(np.vstack([points, points]), np.vstack([turned, other]), 0.4, 0.2)
    random = np.random.default_rng(1).normal(size=(500, 3))
    assert margin(rays, random / np.linalg.norm(random, axis=1)[:, None]) == 1.0


def random_grasps(random, count):
    """Contacts anywhere on one of the shapes, 1 to 5 of them, one task wrench each."""
    for _ in range(count):
        outline = ContactOutline(SHAPES[random.integers(len(SHAPES))])
        contacts = outline.at(random.uniform(0.0, outline.length, random.integers(1, 6)))
        friction = random.choice([0.0, 0.2, 0.5, 1.0])
        rays = wrench_rays(contacts.points, contacts.normals, friction, SURFACE.radius)
        yield rays, random.normal(size=3)


@pytest.mark.long
def test_ten_thousand_random_grasps_agree_with_a_linear_programme():
    """One wrench each; half of them drawn within the cone or near its boundary."""
    random = np.random.default_rng(7)
    held = 0
    for number, (rays, wrench) in enumerate(random_grasps(random, 10_000)):
        if number % 2:
            weights = random.uniform(size=len(rays)) * (random.uniform(size=len(rays)) < 0.4)
            wrench = weights @ rays + 0.05 * random.normal(size=3)
        wrench = wrench / np.linalg.norm(wrench)
        found = margin(rays, wrench[None])
        _, away = nnls(rays.T, wrench)
        if found < -HELD:
            assert away >= -found - 1e-9  # the facet's distance is a bound of the cone's
        if min(away, abs(found)) > 1e-7 or found > 1e-7:
            assert (found > 0.0) == (away < 1e-7), (found, away)
        if number % 10 == 0 and abs(found) > 1e-6:
            assert lp_holds(rays, wrench) == (found > 0.0)
        held += found > 0.0
    assert 2000 < held < 8000


def test_the_margin_is_the_distance_to_the_boundary():
    """Turned by a little less than the margin in any direction a wrench stays, by more in one it
    does not: 300 grasps that hold a wrench, 200 directions each."""
    random = np.random.default_rng(3)
    seen = 0
    for rays, wrench in random_grasps(random, 4000):
        wrench = wrench / np.linalg.norm(wrench)
        found = margin(rays, wrench[None])
        if not 0.01 < found < 0.999:
            continue
        seen += 1
        side = random.normal(size=(200, 3))
        side -= (side @ wrench)[:, None] * wrench
        side /= np.linalg.norm(side, axis=1)[:, None]
        angle = np.arcsin(found)
        for turn, all_in in ((angle - 1e-6, True), (angle + 0.02, False)):
            turned = np.cos(turn) * wrench + np.sin(turn) * side
            inside = np.array([margin(rays, w[None]) >= -HELD for w in turned])
            assert inside.all() == all_in
        if seen == 300:
            break
    assert seen == 300


def test_many_at_once_equal_one_at_a_time_and_bisectors_change_nothing():
    random = np.random.default_rng(5)
    outline = ContactOutline(SHAPES[1])
    twists = random.normal(size=(40, 3)) * [0.01, 0.01, 0.02] + [0.1, 0.0, 0.0]
    wrenches = task_wrenches(twists, SURFACE, SURFACE.radius)
    ways = random.uniform(0.0, outline.length, (200, 3))
    contacts = [outline.at(w) for w in ways]
    points = np.array([c.points for c in contacts])
    normals = np.array([c.normals for c in contacts])
    rays = wrench_rays(points, normals, 0.3, SURFACE.radius)
    more = wrench_rays(points, normals, 0.3, SURFACE.radius, bisectors=True)
    assert more.shape == (200, 9, 3)
    many = margins(rays, wrenches)
    assert margins(more, wrenches) == pytest.approx(many, abs=1e-9)
    for k in range(200):
        assert margin(rays[k], wrenches) == many[k]
        assert compatible(contacts[k], 0.3, twists, SURFACE) == (many[k] >= -HELD)


def test_task_wrenches_are_those_of_the_limit_surface():
    twists = np.array([[0.1, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [0.05, 0.05, 0.3]])
    wrenches = task_wrenches(twists, SURFACE, SURFACE.radius)
    assert wrenches.shape == (3, 3)
    assert wrenches[0] == pytest.approx([1, 0, 0]) and wrenches[1] == pytest.approx([0, 0, 1])
    v = twists[3] * [1.0, 1.0, SURFACE.radius]
    assert wrenches[2] == pytest.approx(v / np.linalg.norm(v))
