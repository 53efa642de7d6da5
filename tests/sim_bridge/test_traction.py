"""What is said to be too heavy, against the simulated world."""

from dataclasses import replace

import numpy as np
import pytest

from push_model.bumpers import FlatBumper
from push_model.drives import SpeedDrive
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from push_model.traction import lift_share, push_force, too_heavy, traction, wheel_load
from push_scenario.scenario import scenario_from_mapping
from sim_bridge.pybullet_world import PyBulletWorld
from tests.samples import mostly_long

OPEN = EnvironmentSpec((6.0, 6.0), resolution=0.05)
PUSHED = {"pioneer": "pioneer_box", "epuck": "box9", "epuck_ring": "box9", "disc": "box9"}


def types(robot: str) -> tuple[RobotSpec, ObjectSpec]:
    values = {
        "environment": "open",
        "robots": {"r": {"type": robot, "start": [0, 0, 0]}},
        "objects": {"b": {"type": PUSHED[robot], "start": [0.8, 0, 0]}},
    }
    scenario = scenario_from_mapping(values, "pair", "pair")
    return scenario.robots["r"][0], scenario.objects["b"][0]


def moved(robot: RobotSpec, item: ObjectSpec, speed: float = 0.05) -> float:
    """Way of the object over the commanded one."""
    ahead = np.array([robot.push_distance + item.geometry.sides[0].distance + 5e-4, 0.0, 0.0])
    with PyBulletWorld(OPEN, {"r": (robot, np.zeros(3))}, {"b": (item, ahead)}) as world:
        for i in range(16):
            world.command("r", speed * i / 15, 0.0)
            world.step(10, contacts=False)
        world.step(240, contacts=False)
        before = world.poses()["b"][0]
        world.step(400, contacts=False)
        return float((world.poses()["b"][0] - before) / (0.4 * speed))


def usage(robot: RobotSpec, item: ObjectSpec) -> float:
    lift = lift_share(robot, item)
    needed = push_force(item, lift)
    return needed / max(traction(robot, needed, lift), 1e-9)


def case(name: str, target: float, random: np.random.Generator) -> tuple[RobotSpec, ObjectSpec]:
    """A random robot of a type, and an object that takes such a part of its traction."""
    robot, item = types(name)
    height = random.uniform(0.05, 0.2) if name == "pioneer" else random.uniform(0.009, 0.03)
    robot = replace(robot, bumper=replace(robot.bumper, z=height))
    if name != "disc":
        drive = replace(robot.drive, wheel_friction=random.uniform(0.5, 1.0))
        robot = replace(robot, drive=drive)
    item = replace(
        item,
        floor_friction=random.uniform(0.15, 0.6),
        contact_friction=random.uniform(0.05, 0.5),
    )
    low, high = 0.002, 50.0
    for _ in range(40):
        item = replace(item, mass=(low + high) / 2.0)
        low, high = (low, item.mass) if usage(robot, item) > target else (item.mass, high)
    return robot, item


@pytest.mark.parametrize(
    "name", mostly_long(["epuck_ring", *sorted(set(PUSHED) - {"pioneer", "epuck_ring"})], 1)
)
def test_what_is_not_too_heavy_moves_as_commanded_and_what_is_does_not(name):
    """Masses x heights x frictions; from 1 to 1.25 times the traction is left undecided."""
    random = np.random.default_rng(7)
    for k in range(8):
        light = k % 2 == 0
        robot, item = case(name, random.uniform(*((0.4, 0.98) if light else (1.27, 1.8))), random)
        way = moved(robot, item)
        what = f"{robot.bumper_z=} {item.mass=} {item.floor_friction=} {item.contact_friction=}"
        if light:
            assert too_heavy(robot, item) is None and 0.96 < way < 1.04, (way, what)
        else:
            assert too_heavy(robot, item) is not None and way < 0.7, (way, what)


def test_a_robot_driven_by_torques_is_not_judged():
    """Its wheels may slip and push all the same."""
    pioneer, box = types("pioneer")
    assert too_heavy(pioneer, replace(box, mass=100.0)) is None


def test_a_heavy_box_is_too_heavy_at_axle_height_and_not_for_a_low_ring():
    """A box of 0.3 kg."""
    epuck, box = types("epuck")
    heavy = replace(box, mass=0.3)
    assert too_heavy(epuck, box) is None
    assert too_heavy(epuck, heavy) == "too heavy: needs 0.94 N, has 0.74 N"
    assert too_heavy(types("epuck_ring")[0], heavy) is None
    assert moved(types("epuck_ring")[0], heavy) > 0.96 and moved(epuck, heavy) < 0.25


def test_loads_balance():
    """Forces and moments on the whole robot, by hand."""
    robot, box = types("epuck")
    assert push_force(replace(box, mass=0.3)) == pytest.approx(0.3 * 0.3 * 9.81)
    assert wheel_load(robot, 0.0) == pytest.approx(0.2 * 9.81)
    # the rear caster at 27.75 mm takes 0.88 N x 20.5 mm
    assert wheel_load(robot, 0.88) == pytest.approx(1.962 - 0.88 * 0.0205 / 0.02775)
    lifted = 1.962 - 0.1 * 0.88 - 0.88 * (0.0205 + 0.1 * 0.05) / 0.02775
    assert wheel_load(robot, 0.88, 0.1) == pytest.approx(lifted)
    assert wheel_load(robot, 50.0) == 0.0
    pioneer, _ = types("pioneer")
    assert wheel_load(pioneer, 0.0) == pytest.approx(17 * 9.81 - 16 * 9.81 * 0.15 / 0.21)
    weak = replace(robot, drive=replace(robot.drive, wheel_torque=0.001))
    assert traction(weak, 0.01) == pytest.approx(2 * 0.001 / 0.0205)
    blunt = replace(robot, bumper=FlatBumper(0.07, 0.05, z=0.002), casters=())
    assert wheel_load(blunt, 0.5) == pytest.approx(1.962 - 0.5 * 0.002 / robot.body_radius)


@pytest.mark.parametrize("turn_rate", [-2.0, -1.4, 1.0, 2.0])
def test_wheels_that_slip_keep_their_traction(turn_rate: float) -> None:
    """Both wheels slip forward, each at its own speed: friction is opposite to slip, so that none
    of it is left to squeeze the axle, and the robot pushes the wall with all of it."""
    robot = types("epuck_ring")[0]
    drive = robot.drive
    assert isinstance(drive, SpeedDrive) and drive.wheel_inertia > 0.0
    start = np.array([0.5 * OPEN.size[0] - robot.push_distance - 1e-3, 0.0, 0.0])
    felt = []
    with PyBulletWorld(OPEN, {"r": (robot, start)}, {}) as world:
        world.command("r", 0.06, turn_rate)
        for _ in range(12):
            world.step(20)
            felt.append(sum(abs(c.force[0]) for c in world.read_contacts()))
    # The wall's friction presses the robot down a little: it has no less than its weight gives.
    assert drive.wheel_friction * robot.mass * 9.81 < np.mean(felt[4:])
