"""A floor that drags: objects slow down exponentially, and creep where friction would hold them."""

from dataclasses import replace

import numpy as np
import pytest

from push_model.settings import SettingsError
from push_model.shape_specs import RectangleShape
from push_model.specs import GRAVITY, EnvironmentSpec, ObjectSpec
from push_scenario.bodies import load_robot
from sim_bridge.viscous_world import ViscousSettings, ViscousWorld
from sim_bridge.worlds import world_kind, world_names

OPEN = EnvironmentSpec((4.0, 4.0))
BOX = ObjectSpec(
    RectangleShape(0.3, 0.2), mass=0.5, height=0.1, floor_friction=0.6, contact_friction=0.2
)


def test_it_is_a_world_by_name_and_refuses_what_is_no_drag():
    assert "viscous" in world_names() and world_kind("viscous").settings is ViscousSettings
    with pytest.raises(SettingsError, match="drag"):
        ViscousSettings(drag=0.0)


@pytest.mark.parametrize("drag", [0.5, 5.0])
def test_a_sliding_object_slows_down_exponentially(drag):
    """In speed and in turn rate, at the same rate, and along a straight line."""
    v, dt, steps = np.array([0.3, 0.1, 2.0]), 1e-3, 200
    with ViscousWorld(OPEN, {}, {"box": (BOX, np.zeros(3))}, ViscousSettings(dt, drag=drag)) as w:
        w.set_velocity("box", v)
        w.step(steps)
        left = np.exp(-drag * dt * steps / BOX.mass)
        assert w.velocity("box") == pytest.approx(left * v, rel=0.02)
        way = BOX.mass / drag * (1.0 - left)
        assert w.poses()["box"] == pytest.approx(way * v, rel=0.02)


@pytest.mark.parametrize("drag", [1.0, 100.0, 300.0])
def test_a_robot_pushes_as_fast_as_its_wheels_hold(drag):
    """It carries the object along, or its wheels slip and the object creeps at force over drag."""
    robot, commanded = load_robot("epuck_ring"), 0.1
    start = np.array([-0.15 - robot.push_distance, 0.0, 0.0])
    bodies = {"r": (robot, start)}, {"box": (BOX, np.zeros(3))}
    with ViscousWorld(OPEN, *bodies, ViscousSettings(2e-3, drag=drag)) as world:
        world.command("r", commanded, 0.0)
        world.step(1000)
        before = world.poses()["box"][0]
        world.step(500)
        speed = world.poses()["box"][0] - before  # in a second
    force = min(
        robot.drive.wheel_friction * robot.mass * GRAVITY,
        2.0 * robot.drive.wheel_torque / robot.drive.wheel_radius,
    )
    assert speed == pytest.approx(min(commanded, force / drag), rel=0.02)


def test_friction_of_the_floor_does_not_count_and_steps_of_any_length_are_stable():
    slick, ends = replace(BOX, floor_friction=0.1), []
    for item, dt in ((BOX, 2e-2), (slick, 2e-2), (slick, 1e-3)):
        with ViscousWorld(OPEN, {}, {"box": (item, np.zeros(3))}, ViscousSettings(dt)) as world:
            world.set_velocity("box", np.array([0.3, 0.0, 0.0]))
            world.step(round(0.2 / dt))
            ends.append(world.poses()["box"][0])
    assert ends == pytest.approx([0.3 * BOX.mass / ViscousSettings().drag] * 3, rel=1e-3)


def test_the_force_of_a_robot_is_that_of_the_drag_on_all_that_it_pushes():
    """Two boxes of unlike mass in a row; step by step or at once, and again after a reset."""
    robot, drag = load_robot("epuck_ring"), 20.0
    other = replace(BOX, mass=2.0, com=(0.01, 0.0))
    start = np.array([-0.15 - robot.push_distance, 0.0, 0.0])
    items = {"box": (BOX, np.zeros(3)), "other": (other, np.array([0.301, 0.0, 0.0]))}
    ends = []
    with ViscousWorld(
        OPEN, {"r": (robot, start)}, items, ViscousSettings(5e-3, drag=drag)
    ) as world:
        for counts in ([1] * 400, [400]):
            world.command("r", 0.04, 0.0)
            for count in counts:
                world.step(count)
            world.read_contacts()
            world.step(100)
            contacts = world.read_contacts()
            k = contacts.body_a.index("r")
            assert contacts.body_b[k] == "box"
            force = np.hypot(*contacts.force[k, :2])
            assert force == pytest.approx(2.0 * drag * 0.04, rel=0.01)
            ends.append(world.poses().table.copy())
            world.reset()
    assert np.array_equal(ends[0], ends[1])
