"""Bodies of every kind against the mechanics that they stand for."""

import math
from dataclasses import replace

import numpy as np
import pytest

from push_model import se2, uniform_pressure_radius
from push_model.specs import BoxSpec, EnvironmentSpec, ObjectSpec
from push_scenario.scenario import scenario_from_mapping
from sim_bridge.disturbances import Disturbances
from sim_bridge.pybullet_world import PyBulletWorld
from sim_bridge.settings import PhysicsSettings

OPEN = EnvironmentSpec((6.0, 6.0), resolution=0.05)
ORIGIN = np.zeros(3)


def robot_type(name):
    values = {"environment": "open", "robots": {"r": {"type": name, "start": [0, 0, 0]}}}
    return scenario_from_mapping(values, "one", "one").robots["r"][0]


def plate(com=(0.0, 0.0), **values):
    shape = {"rectangle": {"length": 0.2, "width": 0.12}}
    return ObjectSpec(shape, 0.3, 0.05, 0.3, 0.2, com=com, **values)


@pytest.mark.parametrize("com", [(0.03, 0.0), (-0.04, 0.02), (0.0, -0.03)])
@pytest.mark.parametrize("heading", [0.0, 1.1])
def test_an_object_slides_and_spins_about_its_centre_of_mass(com, heading):
    """The published pose is of the geometric frame; friction is that of the limit surface."""
    item = plate(com)
    start = np.array([0.3, -0.2, heading])
    centre = item.mass_pose(start)
    with PyBulletWorld(OPEN, {}, {"b": (item, start)}) as world:
        world.step(300, contacts=False)
        assert world.poses()["b"] == pytest.approx(start, abs=2e-4)
        world.set_velocity("b", np.array([0.0, 0.0, 6.0]))
        world.step(10, contacts=False)
        first = world.velocity("b")[2]
        world.step(40, contacts=False)
        slowed = (first - world.velocity("b")[2]) / 0.04
        expected = item.limit_surface().max_torque / item.moment
        assert slowed == pytest.approx(expected, rel=0.05)
        moved = item.mass_pose(world.poses()["b"])
        assert moved[:2] == pytest.approx(centre[:2], abs=5e-4)  # it turns about the centre of mass
        assert abs(se2.wrap(moved[2] - centre[2])) > 0.1
        world.place("b", start)
        world.step(300, contacts=False)
        for direction in (0.4, 2.5, -1.2):
            world.set_velocity("b", 0.3 * np.array([math.cos(direction), math.sin(direction), 0]))
            world.step(10, contacts=False)
            before = world.velocity("b")
            world.step(40, contacts=False)
            change = (before - world.velocity("b")) / 0.04
            assert np.hypot(*change[:2]) == pytest.approx(0.3 * 9.81, rel=0.02)
            assert abs(change[2]) * uniform_pressure_radius(item.geometry) < 0.1  # it does not turn


def test_the_contact_in_a_corner_is_where_it_is():
    """Normals that are not parallel: the mean is by loads, not by the length of their sum."""
    corner = EnvironmentSpec((2.0, 2.0), resolution=0.05)
    start = np.array([0.95, 0.95, 0.0])
    with PyBulletWorld(corner, {"r": (robot_type("disc"), start)}, {}) as world:
        world.command_all(["r"], np.array([[0.08, 0.08, 0.0]]), fixed_frame=True)
        world.step(400, contacts=False)
        world.read_contacts()
        world.step(200)
        contacts = {c.body_b: c for c in world.read_contacts()}
        assert set(contacts) == {"wall0", "wall2"}
        for c in contacts.values():
            assert np.linalg.norm(c.normal) == pytest.approx(1.0)
        assert contacts["wall2"].position[:2] == pytest.approx([1.0, 0.95], abs=1e-3)
    # one body in whose notch the disc is wedged: two normals at right angles, one entry
    vee = ObjectSpec(
        {"polygon": {"vertices": [[-0.2, -0.2], [0.2, -0.2], [0.2, 0.1], [0, -0.1], [-0.2, 0.1]]}},
        5.0, 0.05, 0.6, 0.0,
    )  # fmt: skip
    notch = vee.outline[3]
    top = notch + [0.0, 0.05 * math.sqrt(2.0) + 0.002]
    robots = {"r": (robot_type("disc"), np.array([*top, 0.0]))}
    with PyBulletWorld(OPEN, robots, {"v": (vee, ORIGIN)}) as world:
        world.command_all(["r"], np.array([[0.0, -0.1, 0.0]]), fixed_frame=True)
        world.step(400, contacts=False)
        world.read_contacts()
        world.step(200)
        (contact,) = [c for c in world.read_contacts() if c.body_b == "v"]
        disc = world.poses()["r"]
        # the middle of the two points, at 45 degrees each side of straight down
        assert contact.position[0] == pytest.approx(disc[0], abs=3e-3)
        assert contact.position[1] == pytest.approx(disc[1] - 0.05 / math.sqrt(2.0), abs=3e-3)
        assert contact.normal == pytest.approx([0.0, 1.0, 0.0], abs=0.05)
        assert contact.force[1] == pytest.approx(1.9, rel=0.03)


def test_a_disc_pushes_with_its_traction_and_no_more():
    disc = robot_type("disc")
    force = disc.drive.max_force
    box = ObjectSpec({"rectangle": {"length": 0.1, "width": 0.1}}, 0.1, 0.05, 0.3, 0.1)
    for share in (0.3, 0.8, 1.3):
        item = replace(box, mass=share * force / (0.3 * 9.81))
        objects = {"b": (item, np.array([0.1005, 0.0, 0.0]))}
        with PyBulletWorld(OPEN, {"r": (disc, ORIGIN)}, objects) as world:
            world.command("r", 0.07, 0.0)
            world.step(500)
            before = world.poses()["b"][0]
            world.read_contacts()
            world.step(500)
            way = world.poses()["b"][0] - before
            (contact,) = [c for c in world.read_contacts() if "b" in (c.body_a, c.body_b)]
            assert way == pytest.approx(0.035 if share < 1.0 else 0.0, abs=1e-3)
            assert abs(contact.force[0]) == pytest.approx(min(share, 1.0) * force, rel=0.05)


def test_discs_go_where_they_are_told_in_their_own_frame_and_in_the_worlds():
    disc = robot_type("disc")
    starts = [np.array([0.0, 0.3 * k, 0.8 * k]) for k in range(4)]
    with PyBulletWorld(OPEN, {f"d{k}": (disc, s) for k, s in enumerate(starts)}, {}) as world:
        twist = np.tile([0.05, 0.02, 0.5], (4, 1))
        world.command_all(["d0", "d1"], twist[:2])
        world.command_all(["d2", "d3"], twist[2:], fixed_frame=True)
        world.step(30)
        before = world.poses().table
        for _ in range(100):
            world.step(10)
        after = world.poses().table
        assert after[:, 2] - before[:, 2] == pytest.approx(np.full(4, 0.5), abs=1e-3)
        assert after[2:, :2] - before[2:, :2] == pytest.approx(
            np.tile([0.05, 0.02], (2, 1)), abs=2e-4
        )
        for k in (0, 1):  # an arc
            turn = np.linspace(before[k, 2], after[k, 2], 2001)
            c, s = np.cos(turn).mean(), np.sin(turn).mean()
            way = [0.05 * c - 0.02 * s, 0.05 * s + 0.02 * c]
            assert after[k, :2] - before[k, :2] == pytest.approx(way, abs=2e-4)
        world.command_all(["d0"], np.array([[9.0, 0.0, 0.0]]))
        world.step(200)
        assert np.hypot(*world.velocity("d0")[:2]) == pytest.approx(disc.max_speed, rel=1e-3)


def test_wheels_under_torque_roll_until_they_slip():
    """Section 2.3: traction is mu times the load of the wheels; the rest is on the caster."""
    pioneer = robot_type("pioneer")
    drive = pioneer.drive
    load = 17 * 9.81 - 16 * 9.81 * 0.15 / 0.21
    grip = drive.wheel_friction * load * drive.wheel_radius / 2.0  # [Nm] a wheel
    for share, slips in ((0.5, False), (1.8, True)):
        with PyBulletWorld(OPEN, {"p": (pioneer, np.array([-2.5, 0.0, 0.0]))}, {}) as world:
            world.step(200, contacts=False)
            world.command_torques("p", share * grip, share * grip)
            world.step(300, contacts=False)
            first, speed = world.velocity("p")[0], world.wheel_state("p").speed.mean()
            world.step(300, contacts=False)
            pull = (world.velocity("p")[0] - first) / 0.3
            rolled = drive.wheel_radius * world.wheel_state("p").speed.mean()
            if slips:
                assert rolled > 1.5 * world.velocity("p")[0]
                # accelerating backs weight onto the caster: a little less than at rest and not more
                assert 0.8 < pull / (drive.wheel_friction * load / 17) < 1.1
            else:
                assert rolled == pytest.approx(world.velocity("p")[0], rel=0.02)
                inertia = 17 + 2 * drive.wheel_inertia / drive.wheel_radius**2
                expected = 2 * share * grip / drive.wheel_radius / inertia
                assert pull == pytest.approx(expected, rel=0.03)
            assert speed > 0.0
            assert world.wheel_state("p").torque == pytest.approx([share * grip] * 2)


def test_torques_are_for_torque_drives_and_a_wheel_has_a_greatest_speed(robot):
    world = PyBulletWorld(OPEN, {"e": (robot, ORIGIN)}, {})
    with world, pytest.raises(ValueError, match="no torques"):
        world.command_torques("e", 0.1, 0.1)
    pioneer = robot_type("pioneer")
    quick = replace(pioneer, drive=replace(pioneer.drive, max_wheel_speed=2.0))
    with PyBulletWorld(OPEN, {"p": (quick, np.array([-2.0, 0.0, 0.0]))}, {}) as world:
        world.command_torques("p", 1.5, 1.5)
        world.step(1500, contacts=False)
        assert world.wheel_state("p").speed == pytest.approx([2.0, 2.0], rel=0.02)
        world.command("p", 0.1, 0.0)  # and by velocity
        world.step(800, contacts=False)
        assert world.velocity("p")[0] == pytest.approx(0.1, rel=0.03)


def test_wheels_touch_nothing_but_the_floor(robot):
    """Spheres for wheels stick out of the body; walls must not feel them."""
    wall = EnvironmentSpec((6.0, 6.0), (BoxSpec((0.5, 0.12), (2.0, 0.16)),), resolution=0.05)
    with PyBulletWorld(wall, {"r": (robot, np.array([0.0, 0.0, 0.0]))}, {}) as world:
        world.step(50)
        world.command("r", 0.1, 0.0)
        world.step(2000)
        x, y, theta = world.poses()["r"]
        assert x > 0.19 and abs(y) < 1e-3 and abs(theta) < 1e-2
        assert not world.read_contacts()


def test_a_ring_touches_all_round_at_its_height():
    ring = robot_type("epuck_ring")
    box = ObjectSpec({"rectangle": {"length": 0.1, "width": 0.1}}, 0.05, 0.05, 0.3, 0.1)
    for heading in (0.0, 0.9, 2.0):
        item = {"b": (box, np.array([-0.1005, 0.0, 0.0]))}
        with PyBulletWorld(OPEN, {"r": (ring, np.array([0.0, 0.0, heading]))}, item) as world:
            world.step(100)
            world.set_velocity("b", np.array([0.2, 0.0, 0.0]))
            world.step(30)
            (contact,) = [c for c in world.read_contacts() if "b" in (c.body_a, c.body_b)]
            sign = 1.0 if contact.body_a == "b" else -1.0
            assert sign * contact.normal[0] == pytest.approx(-1.0, abs=0.01)
            assert contact.position[2] == pytest.approx(ring.bumper_z, abs=0.0035)


def test_the_killed_stand_and_the_removed_are_gone_until_the_reset(robot):
    disc = robot_type("disc")
    robots = {"e": (robot, ORIGIN), "d": (disc, np.array([0.0, 0.5, 0.0]))}
    with PyBulletWorld(OPEN, robots, {"b": (plate(), np.array([0.0, 1.0, 0.0]))}) as world:
        for name in ("e", "d"):
            world.command(name, 0.05, 0.0)
        world.step(200)
        world.kill("e")
        world.remove("d")
        still = world.poses()["e"]
        world.command_all(["e", "d"], np.array([[0.05, 0.0, 0.0]] * 2))
        world.step(300)
        assert world.names == ("e", "b") == tuple(world.poses())
        assert world.poses()["e"][:2] == pytest.approx(still[:2], abs=2e-3)
        with pytest.raises(ValueError, match="removed"):
            world.place("d", ORIGIN)
        world.reset()
        assert world.names == ("e", "d", "b")
        world.command("e", 0.05, 0.0)
        world.step(400)
        assert world.poses()["e"][0] > 0.015


U_SHAPE = [[0, 0], [0.2, 0], [0.2, 0.19], [0.14, 0.19], [0.14, 0.06], [0.06, 0.06], [0.06, 0.2],
           [0, 0.2]]  # fmt: skip


def test_a_disc_reaches_into_a_concave_object():
    """A U is hollow: a disc stands inside it without touching."""
    item = ObjectSpec({"polygon": {"vertices": U_SHAPE}}, 0.2, 0.05, 0.3, 0.2)
    small = replace(robot_type("disc"), body_radius=0.02)
    small = replace(small, bumper=replace(small.bumper, radius=0.03))
    inside = np.array(U_SHAPE[5]) + [0.04, 0.06] - (np.array(U_SHAPE[0]) - item.outline[0])
    robots = {"r": (small, np.array([*inside, 0.0]))}
    with PyBulletWorld(OPEN, robots, {"u": (item, ORIGIN)}, PhysicsSettings()) as world:
        world.step(100)
        assert not [c for c in world.read_contacts() if "u" in (c.body_a, c.body_b)]
        world.command_all(["r"], np.array([[0.05, 0.0, 0.0]]), fixed_frame=True)
        world.step(1000)
        assert world.poses()["u"][0] > 0.02


def test_an_unknown_event_body_does_nothing(robot):
    assert Disturbances((), 100.0, None).apply(5, None, None) == []
