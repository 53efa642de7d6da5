"""Friction between any two kinds of bodies, in both worlds: forces of contacts that slide."""

from dataclasses import replace

import numpy as np
import pybullet as pb
import pytest

from push_model import SettingsError
from push_model.shape_specs import RectangleShape
from push_model.specs import EnvironmentSpec, ObjectSpec
from push_scenario.bodies import load_robot
from sim_bridge.planar_world import PlanarWorld
from sim_bridge.pybullet_world import PyBulletWorld
from sim_bridge.robot_body import _BASE

ROOM = EnvironmentSpec((2.0, 2.0))  # walls at 1 m, their friction is 0.3
EAST = "wall2"
DISC, RING = load_robot("disc"), load_robot("epuck_ring")
STRONG = replace(DISC, drive=replace(DISC.drive, max_force=30.0))
HEAVY = ObjectSpec(RectangleShape(0.2, 0.2), 50.0, 0.045, 1.0, 0.4)
LIGHT = ObjectSpec(RectangleShape(0.2, 0.2), 0.2, 0.045, 0.01, 0.4)
WORLDS = pytest.mark.parametrize("kind", [PlanarWorld, PyBulletWorld])
AMONG = pytest.mark.parametrize("among", [0.2, 0.6, 1.0])


def ratio(world, first, second, twists, seconds=0.3, fixed=True):
    """Friction over normal force of two bodies while robots keep their twists ``(3,)``."""
    along, across = [], []
    names, steps = list(twists), max(1, round(0.01 / world.time_step))
    for _ in range(round(100.0 * seconds)):
        world.command_all(names, np.array([twists[n] for n in names]), fixed)
        world.step(steps, contacts=True)
        for contact in world.read_contacts():
            if {contact.body_a, contact.body_b} == {first, second}:
                force, normal = np.asarray(contact.force)[:2], np.asarray(contact.normal)[:2]
                press = float(force @ normal)
                along.append(abs(press))
                across.append(float(np.hypot(*(force - press * normal))))
    skip = len(along) // 3  # until they have met, and slide
    assert len(along) > 10  # they have touched
    return sum(across[skip:]) / sum(along[skip:])


def pair(among, **changes):
    return {f"r{k}": replace(STRONG, robot_friction=among, **changes) for k in (1, 2)}


def made(kind, robots, starts, objects=None):
    placed = {n: (r, np.array(s)) for (n, r), s in zip(robots.items(), starts, strict=True)}
    return kind(ROOM, placed, objects or {})


@WORLDS
@pytest.mark.parametrize("among", [0.1, 0.2, 0.4, 0.6])  # beyond, they roll on each other
def test_robot_on_robot_is_what_their_type_says(kind, among):
    with made(kind, pair(among), [(-0.1, -0.02, 0.0), (0.0, 0.0, 0.0)]) as world:
        twists = {"r1": (0.02, 0.12, 0.0), "r2": (0.0, 0.0, 0.0)}
        assert ratio(world, "r1", "r2", twists) == pytest.approx(among, rel=0.04)


@WORLDS
@AMONG
def test_robot_on_wall_does_not_depend_on_it(kind, among):
    with made(kind, pair(among), [(0.949, 0.0, 0.0), (0.0, 0.0, 0.0)]) as world:
        twists = {"r1": (0.03, 0.12, 0.0), "r2": (0.0, 0.0, 0.0)}
        assert ratio(world, "r1", EAST, twists) == pytest.approx(0.3, rel=0.04)


@WORLDS
@AMONG
def test_robot_on_object_does_not_depend_on_it(kind, among):
    objects = {"box": (HEAVY, np.zeros(3))}
    with made(kind, pair(among), [(-0.1505, -0.05, 0.0), (0.8, 0.8, 0.0)], objects) as world:
        twists = {"r1": (0.03, 0.12, 0.0), "r2": (0.0, 0.0, 0.0)}
        assert ratio(world, "r1", "box", twists) == pytest.approx(0.4, rel=0.04)


@WORLDS
@AMONG
def test_object_on_wall_does_not_depend_on_it(kind, among):
    """One robot presses the box against the wall, the other one pushes it along."""
    objects = {"box": (LIGHT, np.array([0.899, 0.0, 0.0]))}
    starts = [(0.748, 0.0, 0.0), (0.899, -0.151, 0.0)]
    with made(kind, pair(among), starts, objects) as world:
        twists = {"r1": (0.02, 0.05, 0.0), "r2": (0.0, 0.06, 0.0)}
        assert ratio(world, "box", EAST, twists) == pytest.approx(0.4 * 0.3, rel=0.06)


def test_robots_with_wheels_have_it_too():
    """What PyBullet says of the two surfaces; it multiplies them."""
    robots = {f"r{k}": replace(RING, robot_friction=0.3) for k in (1, 2)}
    with made(PyBulletWorld, robots, [(-0.2, 0.0, 0.0), (0.2, 0.0, 0.0)]) as world:
        bodies = [world._wheeled[name].body for name in robots]
        first, second = (
            pb.getDynamicsInfo(b, _BASE, physicsClientId=world._client)[1] for b in bodies
        )
        assert first * second == pytest.approx(0.3)


def test_pybullet_refuses_robots_with_different_frictions_among_them():
    robots = {"r1": replace(DISC, robot_friction=0.5), "r2": DISC}
    with pytest.raises(SettingsError, match=r"robot_friction: .* one value .* got 0\.5, 1"):
        made(PyBulletWorld, robots, [(-0.2, 0.0, 0.0), (0.2, 0.0, 0.0)])


def test_the_planar_world_takes_the_geometric_mean_of_two_types():
    robots = {
        "r1": replace(STRONG, robot_friction=0.2),
        "r2": replace(STRONG, robot_friction=0.8),
    }
    with made(PlanarWorld, robots, [(-0.1, -0.02, 0.0), (0.0, 0.0, 0.0)]) as world:
        twists = {"r1": (0.02, 0.12, 0.0), "r2": (0.0, 0.0, 0.0)}
        assert ratio(world, "r1", "r2", twists) == pytest.approx(0.4, rel=0.04)
