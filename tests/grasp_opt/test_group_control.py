"""The law of a group: forces, velocities, wheels; (3.20)-(3.25)."""

import math

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from grasp_opt.contact_outline import ContactOutline, Contacts
from grasp_opt.group_control import (
    GroupController,
    GroupControlSettings,
    distribute,
)
from push_model import se2
from push_model.coulomb import cone_edges
from push_model.grasp import grasp_matrix
from push_model.screws import point_velocities
from push_scenario.bodies import load_object, load_robot

ITEM, ROBOT = load_object("plate_ellipse"), load_robot("epuck_ring")
OUTLINE = ContactOutline(ITEM.geometry)


def random_contacts(random, count: int) -> Contacts:
    return OUTLINE.at(random.uniform(0.0, OUTLINE.length, count))


def test_forces_are_in_their_cones_and_make_what_can_be_made():
    random = np.random.default_rng(1)
    scale = np.array([1.0, 1.0, 0.1])
    for _ in range(500):
        count = int(random.integers(1, 6))
        contacts = random_contacts(random, count)
        some = np.vstack(
            [cone_edges(n, 0.2).T @ random.exponential(1.0, 2) for n in contacts.normals]
        )
        wrench = grasp_matrix(contacts.points) @ some.ravel()
        forces = distribute(wrench, contacts, 0.2, 0.1)
        made = grasp_matrix(contacts.points) @ forces.ravel()
        assert (made - wrench) / scale == pytest.approx(np.zeros(3), abs=2e-3 * count)
        inward = (forces * contacts.normals).sum(axis=1)
        along = np.abs(
            contacts.normals[:, 0] * forces[:, 1] - contacts.normals[:, 1] * forces[:, 0]
        )
        assert (inward >= -1e-9).all() and (along <= 0.2 * inward + 1e-9).all()


def test_of_a_wrench_that_cannot_be_made_it_is_the_nearest():
    """With forces that count a millionth of what lacks, against a general solver."""
    random = np.random.default_rng(2)
    scale = np.array([1.0, 1.0, 0.1])
    for _ in range(60):
        contacts = random_contacts(random, int(random.integers(1, 5)))
        wrench = random.normal(0.0, 1.0, 3)
        n = 2 * len(contacts.points)
        spread = np.zeros((n, n))
        for i, normal in enumerate(contacts.normals):
            spread[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = cone_edges(normal, 0.2).T
        G = grasp_matrix(contacts.points) / scale[:, None]
        forces = distribute(wrench * scale, contacts, 0.2, 0.1).ravel()
        mine = np.sum((G @ forces - wrench) ** 2) + 1e-6 * np.sum(forces**2)
        A = np.vstack([G @ spread, 1e-3 * spread])
        best = lsq_linear(A, np.append(wrench, np.zeros(n)), (0.0, np.inf), tol=1e-13)
        assert mine <= 2.0 * best.cost + 1e-7


def controller(angles, **changes) -> GroupController:
    ways = OUTLINE.way_of_angle(np.array(angles))
    return GroupController(
        OUTLINE,
        ways,
        ITEM.contact_friction,
        ITEM.limit_surface(),
        ROBOT.footprint_radius,
        GroupControlSettings(**changes),
    )


def test_on_its_way_the_group_moves_as_one_body_with_the_task():
    """No error, all in contact, forces that can be made: robots follow the twist of the task."""
    random = np.random.default_rng(4)
    group = controller((math.pi - 0.5, math.pi, math.pi + 0.5), force_gain=0.0)
    for _ in range(100):
        pose = random.uniform(-1.0, 1.0, 3) * [1.0, 1.0, 3.0]
        body = np.array([0.05, random.uniform(-0.004, 0.004), random.uniform(-0.02, 0.02)])
        twist = np.append(se2.rotation_matrix(pose[2]) @ body[:2], body[2])
        robots = se2.transform(pose, group.places)
        command = group.command(pose, twist, pose.copy(), twist, robots)
        expected = point_velocities(body, group.places) @ se2.rotation_matrix(pose[2]).T
        assert command.lacking < 0.01
        assert command.velocities == pytest.approx(expected, abs=3e-3)
        assert command.gaps == pytest.approx(np.zeros(3), abs=1e-3)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_an_error_turns_the_group_against_it(axis):
    group = controller((math.pi - 0.8, math.pi, math.pi + 0.8))
    twist, off = np.array([0.05, 0.0, 0.0]), np.zeros(3)
    robots = group.places
    off[axis] = 0.01
    scale = np.array([1.0, 1.0, group.surface.radius])
    there = group.command(np.zeros(3), twist, off, twist, robots).wrench / scale
    back = group.command(np.zeros(3), twist, -off, twist, robots).wrench / scale
    assert there[axis] > back[axis] + 0.1


def test_who_is_away_comes_and_carries_nothing_and_at_rest_nobody_moves():
    group = controller((math.pi - 0.5, math.pi, math.pi + 0.5))
    twist = np.array([0.05, 0.0, 0.0])
    robots = group.places.copy()
    robots[1, 0] -= 0.02
    command = group.command(np.zeros(3), twist, np.zeros(3), twist, robots)
    assert not command.forces[1].any() and command.forces[0].any()
    assert command.velocities[1, 0] > command.velocities[[0, 2], 0].max() + 0.01
    still = group.command(np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3), group.places)
    assert still.velocities == pytest.approx(np.zeros((3, 2)), abs=1e-4)
    assert not still.wrench.any() and still.lacking == 0.0


def test_robots_come_to_the_object_the_way_that_they_will_push():
    group = controller((math.pi - 0.8, math.pi, math.pi + 0.8))
    ahead = group.ahead(np.array([0.05, 0.0, 0.08]))
    pose = np.array([0.4, -0.3, 2.0])
    robots = se2.transform(pose, group.places - 0.01 * ahead)
    velocities = group.meet(pose, ahead, robots)
    gaps, closing = group.closing(pose, robots, velocities)
    assert (closing > 0.0).all()
    assert (gaps > 1e-3).all() and (gaps < 0.011).all()
    local = velocities @ se2.rotation_matrix(pose[2])
    speeds = np.hypot(*local.T)
    assert local == pytest.approx(speeds[:, None] * ahead, abs=1e-9)
    assert (speeds > 0.005).all() and (speeds <= group.settings.approach + 1e-9).all()


def test_a_robot_that_will_push_along_the_outline_comes_to_the_object_all_the_same():
    """Object turning about a point behind a contact: the robot there moves along the outline."""
    group = controller((math.pi - 0.8, math.pi, math.pi + 0.8))
    pose, settings = np.array([0.4, -0.3, 2.0]), group.settings
    inward = group.outline.at(group.ways).normals
    for slant in (-0.2, 0.0, 0.1, 0.5, 1.0):
        across = np.column_stack([-inward[:, 1], inward[:, 0]])
        ahead = slant * inward + math.sqrt(1.0 - slant**2) * across
        robots = se2.transform(pose, group.places - 0.0015 * inward)
        velocities = group.meet(pose, ahead, robots)
        gaps, closing = group.closing(pose, robots, velocities)
        assert closing == pytest.approx(settings.gap_gain * gaps, rel=0.05), slant


def test_robots_that_come_too_close_part_again_and_others_do_not_care():
    group = controller((math.pi - 0.3, math.pi, math.pi + 0.9))
    twist = np.array([0.05, 0.0, 0.0])
    robots = group.places.copy()
    unit = (robots[1] - robots[0]) / np.hypot(*(robots[1] - robots[0]))
    robots[0] = robots[1] - 0.103 * unit
    still = np.zeros(3)
    near = group.command(still, twist, still, twist, robots).velocities
    free = controller((math.pi - 0.3, math.pi, math.pi + 0.9), apart=0.0)
    alone = free.command(still, twist, still, twist, robots).velocities
    assert (near[1] - near[0]) @ unit >= 0.5 * 0.005 - 1e-9
    assert near[2] == pytest.approx(alone[2], abs=1e-12)
    assert near[0] + near[1] == pytest.approx(alone[0] + alone[1], abs=1e-12)
