"""When the contacts of a push are no longer sure to hold, told in mid-push, over random grasps."""

from dataclasses import replace

import numpy as np
import pytest

from grasp_opt.grasp_certificate import GraspCertificate
from grasp_opt.object_trajectory import polynomial, screw, study_trajectories
from grasp_opt.placement import Placer
from grasp_opt.slip_watch import RESERVE, SlipWatch, spread
from grasp_opt.wrench_cone import margin, task_wrenches, wrench_rays
from push_model import se2
from push_model.belief import Interval
from push_model.stick_certificate import ContactBelief
from push_scenario.bodies import load_object

SIX = list(study_trajectories().values())
NAMES = ("plate_ellipse", "plate_square", "plate_hexagon", "plate_triangle")


def grasps(random, count):
    """Objects, contacts of two to four robots that hold a trajectory, and the trajectory."""
    found = 0
    while found < count:
        item = load_object(NAMES[random.integers(len(NAMES))])
        item = replace(item, contact_friction=random.uniform(0.2, 0.6))
        task = SIX[random.integers(len(SIX))]
        placer = Placer(item, task, int(random.integers(2, 5)), 0.05)
        for way in random.permutation(placer.grid(16))[:40]:
            if placer.margin(placer.outline.at(way)) > 0.0:
                found += 1
                yield item, placer.outline.at(way), task
                break


def margins(item, contacts, task, friction, com):
    """The margin at each time, if these are friction and centre of mass."""
    surface = replace(item, com=tuple(com)).limit_surface()
    x, y, turn = task.body_twists.T
    moved = np.column_stack([x - turn * com[1], y + turn * com[0], turn])
    rays = wrench_rays(contacts.points - com, contacts.normals, friction, surface.radius)
    still = ~np.any(moved != 0.0, axis=1)
    wrenches = [task_wrenches(v[None], surface, surface.radius) for v in moved]
    return np.array([1.0 if s else margin(rays, w) for s, w in zip(still, wrenches, strict=True)])


def intervals(friction, com, part, wide):
    return ContactBelief(
        Interval(friction, friction * (1.0 - part), friction * (1.0 + part)),
        *(Interval(c, c - wide, c + wide) for c in com),
    )


def test_a_push_is_sure_under_the_belief_that_it_was_planned_with():
    random = np.random.default_rng(1)
    for item, contacts, task in grasps(random, 25):
        given = intervals(item.contact_friction, (0.0, 0.0), random.uniform(0.0, 0.9), 0.01)
        watch = SlipWatch(contacts, task, item, random.choice([None, given]))
        assert watch.ahead(0.0) == np.inf
        watch.believe(item, given)
        assert watch.ahead(0.0) == np.inf, "wider intervals alone change no believed value"


def test_the_first_wrench_that_is_not_held_is_told():
    """Held against the margins of the believed values, sample by sample."""
    random, told, certain = np.random.default_rng(2), 0, 0
    for item, contacts, task in grasps(random, 40):
        watch = SlipWatch(contacts, task, item, None)
        enough = min(RESERVE, watch.nominal)
        friction = item.contact_friction * random.uniform(0.05, 1.0)
        com = random.uniform(-0.02, 0.02, 2)
        believed = replace(item, contact_friction=friction, com=tuple(com))
        given = intervals(friction, com, 0.1, 0.002)
        watch.believe(believed, given)
        moving = np.flatnonzero(np.any(task.body_twists != 0.0, axis=1))
        some = moving[spread(len(moving))]
        held = margins(item, contacts, task, friction, com)[some]
        assert watch.nominal == pytest.approx(held.min(), abs=1e-9)
        assert watch.certified <= watch.nominal + 1e-9
        sure = GraspCertificate(item, given, task.body_twists[some]).margins(contacts)
        short = task.time[some][(held < enough - 1e-9) & (sure < -1e-9)]
        for time in random.uniform(0.0, task.duration, 5):
            later = short[short >= time]
            if not len(later):
                assert watch.ahead(time) == np.inf
            else:
                assert watch.ahead(time) == pytest.approx(later[0] - time)
        assert not len(short) or watch.certified < 0.0
        told += bool(len(short))
        certain += watch.certified >= 0.0
        watch.believe(item, None)
        assert watch.ahead(0.0) == np.inf and watch.certified is None
    assert told > 10 and certain > 3


def test_a_trajectory_of_another_point_of_the_object():
    """Poses are those of the point, twists their rates; there and back is where it began."""
    random = np.random.default_rng(3)
    tasks = [*SIX, polynomial((0.3,), 0.5, 0.05, 0.05, 1.0)]
    tasks += [screw(random.normal(size=3), np.array([0.1, 0.2, 1.5]), 0.1, 0.1, 0.2)]
    for task in tasks:
        point = random.uniform(-0.1, 0.1, 2)
        moved = task.about(point)
        for k in range(0, len(task.time), 25):
            there = se2.compose(task.pose[k], np.array([*point, 0.0]))
            assert moved.pose[k, :2] == pytest.approx(there[:2], abs=1e-12)
        rate = np.gradient(moved.pose, moved.time, axis=0)[2:-2]
        same = np.gradient(task.pose, task.time, axis=0)[2:-2]
        off = np.abs((moved.twist - task.twist)[2:-2] - (rate - same))
        assert off.max() < 2e-3 * (1.0 + np.abs(task.twist).max())
        back = moved.about(-point)
        assert back.pose == pytest.approx(task.pose, abs=1e-12)
        assert back.twist == pytest.approx(task.twist, abs=1e-12)
