"""Physics that obeys its own laws; short versions of `planar-push bench physics`."""

import math
from dataclasses import replace

import numpy as np
import pytest

from push_model import se2, uniform_pressure_radius
from push_model.occupancy import MapSpec, OccupancyGrid
from push_model.specs import EnvironmentSpec, ObjectSpec
from sim_bridge.pybullet_world import PyBulletWorld
from sim_bridge.settings import PhysicsSettings

OPEN = EnvironmentSpec((6.0, 6.0))


def world(robots=None, objects=None):
    return PyBulletWorld(OPEN, robots or {}, objects or {})


def test_wheels_roll_without_slip(robot):
    with world({"r": (robot, np.array([0.0, 0.0, 0.7]))}) as w:
        w.command("r", 0.1, 0.0)
        w.step(200)
        before = w.poses()["r"]
        w.step(3000)
        moved = se2.between(before, w.poses()["r"])
        assert moved == pytest.approx([0.3, 0.0, 0.0], abs=0.003)
        w.command("r", 0.0, 1.0)
        w.step(200)
        before = w.poses()["r"]
        w.step(1000)
        assert se2.wrap(w.poses()["r"][2] - before[2]) == pytest.approx(1.0, rel=0.01)


@pytest.mark.parametrize("yaw", [0.0, 0.4])
@pytest.mark.parametrize("direction", [0.0, 1.1])
def test_sliding_friction_is_coulomb_and_isotropic(box, yaw, direction):
    with world(objects={"b": (box, np.array([0.0, 0.0, yaw]))}) as w:
        w.step(300)
        w.set_velocity("b", 0.3 * np.array([math.cos(direction), math.sin(direction), 0.0]))
        w.step(10)
        v0 = w.velocity("b")
        w.step(40)
        v1 = w.velocity("b")
        deceleration = np.hypot(*(v0 - v1)[:2]) / 0.04
        assert deceleration == pytest.approx(box.floor_friction * 9.81, rel=0.02)


def test_spinning_friction_is_that_of_uniform_pressure(box):
    with world(objects={"b": (box, np.zeros(3))}) as w:
        w.step(300)
        w.set_velocity("b", np.array([0.0, 0.0, 6.0]))
        w.step(10)
        first = w.velocity("b")[2]
        w.step(40)
        slowed = (first - w.velocity("b")[2]) / 0.04
        expected = (
            box.floor_friction
            * 9.81
            * uniform_pressure_radius(box.geometry)
            / box.geometry.inertia_per_mass
        )
        assert slowed == pytest.approx(expected, rel=0.05)


def push_along_arc(robot, box, mu, factor, degrees=60.0, speed=0.05):
    """Slip [mm] of the box along the bumper over an arc whose radius is factor * r_lim."""
    radius = (0.045 + robot.bumper.distance) / mu * factor
    item = replace(box, contact_friction=mu)
    start = np.array([0.0, 0.0, 0.0])
    ahead = np.array([robot.bumper.distance + 0.045 + 0.0005, 0.0, 0.0])
    with world({"r": (robot, start)}, {"b": (item, ahead)}) as w:
        for i in range(31):
            w.command("r", speed * i / 30, 0.0)
            w.step(10)
        w.step(300)
        for i in range(31):
            w.command("r", speed, speed / radius * i / 30)
            w.step(10)
        poses = w.poses()
        first = se2.between(poses["r"], poses["b"])
        w.step(round(math.radians(degrees) * radius / speed * 1000))
        poses = w.poses()
        contacts = [c for c in w.read_contacts() if {c.body_a, c.body_b} == {"r", "b"}]
        assert contacts and contacts[0].duty > 0.9
        return 1e3 * abs(se2.between(poses["r"], poses["b"])[1] - first[1])


@pytest.mark.long
@pytest.mark.parametrize("mu", [0.2, 0.5])
def test_onset_of_slip_is_at_the_stable_push_limit(robot, box, mu):
    assert push_along_arc(robot, box, mu, 1.1) < 1.0
    assert push_along_arc(robot, box, mu, 0.85) > 4.0


def test_contact_force_balances_floor_friction(robot, box):
    ahead = np.array([robot.bumper.distance + 0.0455, 0.0, 0.0])
    with world({"r": (robot, np.zeros(3))}, {"b": (box, ahead)}) as w:
        w.command("r", 0.05, 0.0)
        w.step(1000)
        w.read_contacts()
        w.step(1000)
        (contact,) = [c for c in w.read_contacts() if {c.body_a, c.body_b} == {"r", "b"}]
        sign = 1.0 if contact.body_a == "b" else -1.0
        # friction at the bumper also lifts or presses down: that changes the load on the feet
        load = box.floor_friction * (box.mass * 9.81 - sign * contact.force[2])
        assert np.hypot(*contact.force[:2]) == pytest.approx(load, rel=0.03)
        assert sign * contact.force[0] > 0.0 and sign * contact.normal[0] > 0.99


def test_a_nan_command_never_reaches_the_physics(robot):
    with world({"r": (robot, np.zeros(3))}) as w:
        with pytest.raises(ValueError, match="not finite"):
            w.command("r", math.nan, 0.0)
        w.step(10)
        assert np.isfinite(w.poses()["r"]).all()


def test_two_worlds_repeat_bit_for_bit(robot, box):
    def run():
        ahead = np.array([0.1, 0.01, 0.1])
        with world({"r": (robot, np.zeros(3))}, {"b": (box, ahead)}) as w:
            w.command("r", 0.08, 0.3)
            w.step(800)
            return np.concatenate(list(w.poses().values()))

    assert np.array_equal(run(), run())


def test_reset_returns_to_the_start(robot, box):
    with world({"r": (robot, np.zeros(3))}, {"b": (box, np.array([0.2, 0.0, 0.0]))}) as w:
        w.command("r", 0.1, 0.0)
        w.step(2500)
        assert w.poses()["b"][0] > 0.22
        w.reset()
        assert w.poses()["b"] == pytest.approx([0.2, 0.0, 0.0], abs=1e-6)
        w.step(100)
        assert w.poses()["r"] == pytest.approx([0, 0, 0], abs=1e-4)


def test_convex_and_concave_objects_stand_and_slide(robot):
    for shape in (
        {"polygon": {"vertices": [[0, 0], [0.12, 0], [0.06, 0.1]]}},
        {"ellipse": {"semi_axis_x": 0.08, "semi_axis_y": 0.05}},
        {"flower": {"radius": 0.08, "amplitude": 0.015, "petals": 5}},
    ):
        item = ObjectSpec(shape, 0.1, 0.06, 0.3, 0.2)
        with PyBulletWorld(OPEN, {}, {"b": (item, np.zeros(3))}, PhysicsSettings()) as w:
            w.step(300)
            w.set_velocity("b", np.array([0.3, 0.0, 0.0]))
            w.step(10)
            first = w.velocity("b")[0]
            w.step(40)
            slowed = (first - w.velocity("b")[0]) / 0.04
            assert slowed == pytest.approx(0.3 * 9.81, rel=0.02), shape


def test_occupied_cells_of_a_map_are_walls(robot):
    occupied = np.zeros((40, 60), dtype=bool)
    occupied[:, 45:50] = True  # x from 0.45 to 0.50
    room = MapSpec(OccupancyGrid(occupied, 0.02, np.array([-0.45, -0.4])), 0.1, 0.3)
    with PyBulletWorld(room, {"r": (robot, np.zeros(3))}, {}) as w:
        w.command("r", 0.1, 0.0)
        w.step(6000)
        x, y, _ = w.poses()["r"]
        assert x + robot.bumper.distance == pytest.approx(0.45, abs=0.004)
        assert abs(y) < 0.01
