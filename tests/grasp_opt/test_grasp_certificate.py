"""The certified margin: no truth within the believed intervals has less; placements by it."""

from dataclasses import replace

import numpy as np
import pytest

from grasp_opt.grasp_certificate import GraspCertificate
from grasp_opt.object_trajectory import study_trajectories
from grasp_opt.placement import NoPlacement, PlacementSettings, Placer
from grasp_opt.robust_placement import robust_placement
from grasp_opt.wrench_cone import margin, task_wrenches, wrench_rays
from push_model.belief import Interval
from push_model.stick_certificate import ContactBelief
from push_scenario.bodies import load_object

SIX = study_trajectories()
FEW = PlacementSettings(steps=12)
NAMES = ("plate_ellipse", "plate_square", "plate_hexagon", "plate_triangle")


def believed(friction, com_x=(0.0, 0.0), com_y=(0.0, 0.0)):
    def interval(low, high):
        return Interval(0.5 * (low + high), low, high)

    return ContactBelief(interval(*friction), interval(*com_x), interval(*com_y))


def true_margin(item, contacts, twists, friction, com):
    """The margin if these are the friction and the centre of mass of the object."""
    surface = replace(item, com=tuple(com)).limit_surface()
    dx, dy = com
    x, y, turn = twists.T
    moved = np.column_stack([x - turn * dy, y + turn * dx, turn])
    rays = wrench_rays(contacts.points - com, contacts.normals, friction, surface.radius)
    return margin(rays, task_wrenches(moved, surface, surface.radius))


@pytest.mark.long
def test_no_truth_within_the_intervals_has_less_margin():
    random, near, held = np.random.default_rng(1), 0, 0
    for _ in range(40):
        item = load_object(NAMES[random.integers(len(NAMES))])
        twists = list(SIX.values())[random.integers(len(SIX))].body_twists[1:-1:20]
        placer = Placer(item, SIX["sinusoid-1"], int(random.integers(2, 5)), 0.05, FEW)
        grid = placer.grid(16)
        tried = placer.outline.at
        held_at_half = [
            way for way in grid[random.permutation(len(grid))[:12]]
            if true_margin(item, tried(way), twists, 0.5, np.zeros(2)) > 0.0
        ]  # fmt: skip
        if not held_at_half:
            continue
        contacts = tried(held_at_half[0])
        low = random.uniform(0.2, 0.5)
        wide = random.uniform(0.0, 0.015, 2)
        given = believed(
            (low, low + random.uniform(0.0, 0.3)), (-wide[0], wide[0]), (-wide[1], wide[1])
        )
        sure = GraspCertificate(item, given, twists).margin(contacts)
        least = 1.0
        for k in range(12):
            friction = random.uniform(given.friction.low, given.friction.high)
            com = random.uniform(-wide, wide)
            if k % 2:  # the ends of the intervals, where the margin is least
                friction, com = given.friction.low, random.choice([-1.0, 0.0, 1.0], 2) * wide
            found = true_margin(item, contacts, twists, friction, com)
            assert sure < 0.0 or found >= sure - 1e-9
            least = min(least, found)
        near += sure >= 0.0 and least < sure + 0.03
        held += sure >= 0.0
    assert held > 12 and near > 0.7 * held


def test_an_exact_belief_has_the_margin_of_the_test():
    item, task = load_object("plate_ellipse"), SIX["polynomial-1"]
    placer = Placer(item, task, 3, 0.05, FEW)
    mu = item.contact_friction
    for way in placer.grid(12)[::7]:
        contacts = placer.outline.at(way)
        sure = GraspCertificate(item, believed((mu, mu)), task.body_twists).margin(contacts)
        assert sure == pytest.approx(placer.margin(contacts), abs=1e-9)


def test_intervals_beyond_the_object_give_no_certificate():
    item = load_object("plate_ellipse")
    certificate = GraspCertificate(item, believed((0.2, 0.3), (-1.0, 1.0)), np.eye(3))
    assert not certificate.possible
    assert certificate.margin(Placer(item, SIX["sinusoid-1"], 2, 0.05).outline.at(np.zeros(2))) < 0


@pytest.mark.long
def test_placements_hold_for_all_that_is_believed_where_any_do():
    """Placements for the believed values alone do not, in many cases."""
    nominal = sure = cases = 0
    for name in NAMES[:3]:
        item = load_object(name)
        mu = item.contact_friction
        given = believed((0.5 * mu, 1.5 * mu), (-0.01, 0.01), (-0.01, 0.01))
        for task in list(SIX.values())[:3]:
            try:
                blind = robust_placement(item, task, 3, 0.05, 5.0, FEW)
                found = robust_placement(item, task, 3, 0.05, 5.0, FEW, given)
            except NoPlacement:
                continue
            cases += 1
            certificate = GraspCertificate(item, given, task.body_twists)
            nominal += certificate.margin(blind.contacts) >= 0.0
            sure += certificate.margin(found.contacts) >= 0.0
            if certificate.margin(found.contacts) < 0.0:  # as without intervals
                assert found.way == pytest.approx(blind.way)
    assert cases >= 6 and sure > nominal
