"""The simulated physics against Coulomb's law and the stable-push limits."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.measure import at_least, at_most
from push_model import se2, uniform_pressure_radius
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from push_scenario.scenario import load_scenario
from sim_bridge.pybullet_world import PyBulletWorld

OPEN = EnvironmentSpec((8.0, 8.0), resolution=0.02)


def deceleration(item: ObjectSpec, yaw: float, direction: float) -> np.ndarray:
    """[m/s^2], [rad/s^2] change of a sliding object's twist, over mu g; and its drift aside."""
    with PyBulletWorld(OPEN, {}, {"b": (item, np.array([0.0, 0.0, yaw]))}) as world:
        world.step(300)
        world.set_velocity("b", 0.3 * np.array([math.cos(direction), math.sin(direction), 0.0]))
        world.step(10)
        first = world.velocity("b")
        world.step(40)
        change = (first - world.velocity("b")) / 0.04 / (item.floor_friction * 9.81)
    along = change[0] * math.cos(direction) + change[1] * math.sin(direction)
    across = -change[0] * math.sin(direction) + change[1] * math.cos(direction)
    return np.array([along, across])


def spin(item: ObjectSpec, yaw: float) -> float:
    """Pure-spin torque over the uniform-pressure value."""
    with PyBulletWorld(OPEN, {}, {"b": (item, np.array([0.0, 0.0, yaw]))}) as world:
        world.step(300)
        world.set_velocity("b", np.array([0.0, 0.0, 6.0]))
        world.step(10)
        first = world.velocity("b")[2]
        world.step(40)
        slowed = (first - world.velocity("b")[2]) / 0.04
    expected = item.floor_friction * 9.81 * uniform_pressure_radius(item.geometry)
    return float(slowed * item.geometry.inertia_per_mass / expected)


def arc_slip(robot: RobotSpec, item: ObjectSpec, mu: float, factor: float, turn: float) -> float:
    """[mm] slip along the bumper over a 60 degree arc at factor * r_lim; turn +1 left, -1 right."""
    distance = item.geometry.sides[0].distance
    radius = (distance + robot.bumper.distance) / mu * factor
    spec, speed = replace(item, contact_friction=mu), 0.05
    ahead = np.array([robot.bumper.distance + distance + 0.0005, 0.0, 0.0])
    with PyBulletWorld(OPEN, {"r": (robot, np.zeros(3))}, {"b": (spec, ahead)}) as world:
        for i in range(31):
            world.command("r", speed * i / 30, 0.0)
            world.step(10)
        world.step(300)
        for i in range(31):
            world.command("r", speed, turn * speed / radius * i / 30)
            world.step(10)
        poses = world.poses()
        first = se2.between(poses["r"], poses["b"])
        heading = poses["r"][2]
        while abs(se2.wrap(world.poses()["r"][2] - heading)) < math.pi / 3:
            world.step(20)
        poses = world.poses()
    return float(1e3 * abs(se2.between(poses["r"], poses["b"])[1] - first[1]))


def straight_slip(robot: RobotSpec, item: ObjectSpec) -> float:
    """[mm] slip along the bumper over 1 m."""
    ahead = np.array([robot.bumper.distance + 0.0455, 0.0, 0.0])
    with PyBulletWorld(OPEN, {"r": (robot, np.zeros(3))}, {"b": (item, ahead)}) as world:
        for i in range(31):
            world.command("r", 0.08 * i / 30, 0.0)
            world.step(10)
        world.step(300)
        poses = world.poses()
        first = se2.between(poses["r"], poses["b"])
        world.step(12500)
        poses = world.poses()
    return float(1e3 * np.abs(se2.between(poses["r"], poses["b"]) - first)[:2].max())


def wheels(robot: RobotSpec) -> tuple[float, float]:
    """Relative error of distance and yaw of wheel commands."""
    with PyBulletWorld(OPEN, {"r": (robot, np.array([0.0, 0.0, 0.3]))}, {}) as world:
        world.command("r", 0.1, 0.0)
        world.step(200)
        before = world.poses()["r"]
        world.step(10000)
        distance = se2.between(before, world.poses()["r"])[0]
        world.command("r", 0.0, 1.0)
        world.step(200)
        before = world.poses()["r"][2]
        world.step(3000)
        yaw = se2.wrap(world.poses()["r"][2] - before)
    return abs(distance - 1.0), abs(yaw / 3.0 - 1.0)


def run() -> dict[str, Any]:
    """The physics suite."""
    scenario = load_scenario("env1-target1")
    robot, item = scenario.robot()[1], scenario.object()[1]
    values = np.array(
        [
            deceleration(item, yaw, direction)
            for yaw in np.arange(16) * math.pi / 8
            for direction in np.arange(8) * math.pi / 4
        ]
    )
    mean, spread = values[:, 0].mean(), np.ptp(values[:, 0]) / values[:, 0].mean()
    print(
        f"  deceleration / mu g: mean {mean:.4f}, spread over 16 x 8 {spread:.4f}, "
        f"aside max {np.abs(values[:, 1]).max():.4f}"
    )
    aside = [
        replace(item, com=com, shape={"rectangle": {"length": 0.09, "width": 0.12}})
        for com in ((0.02, 0.0), (-0.015, 0.02), (0.0, -0.03))
    ]
    offset = np.array(
        [
            deceleration(other, yaw, direction)
            for other in aside
            for yaw in np.arange(4) * math.pi / 8
            for direction in np.arange(4) * math.pi / 2
        ]
    )
    offset_spins = np.array([spin(other, yaw) for other in aside for yaw in (0.0, 0.6)])
    print(
        f"  com aside: deceleration {offset[:, 0].min():.4f} .. {offset[:, 0].max():.4f}, "
        f"spin {offset_spins.min():.4f} .. {offset_spins.max():.4f}"
    )
    spins = np.array([spin(item, yaw) for yaw in np.arange(8) * math.pi / 16])
    print(f"  spin torque / uniform pressure: {spins.min():.4f} .. {spins.max():.4f}")
    stick, slip = {}, {}
    for mu in (0.2, 0.3, 0.5):
        stick[mu] = max(arc_slip(robot, item, mu, 1.1, t) for t in (1.0, -1.0))
        slip[mu] = min(arc_slip(robot, item, mu, 0.85, t) for t in (1.0, -1.0))
        print(f"  mu {mu}: slip {stick[mu]:.2f} mm at 1.1 r_lim, {slip[mu]:.2f} mm at 0.85 r_lim")
    straight = straight_slip(robot, item)
    distance, yaw = wheels(robot)
    print(
        f"  straight 1 m: {straight:.3f} mm; wheels: distance {100 * distance:.3f} %, "
        f"yaw {100 * yaw:.3f} %"
    )
    return {
        "deceleration": float(mean),
        "spread": float(spread),
        "spin": spins.tolist(),
        "stick_mm": stick,
        "slip_mm": slip,
        "straight_mm": straight,
        "bounds": {
            "deceleration off mu g": at_most(np.abs(values[:, 0] - 1.0).max(), 0.02),
            "isotropy": at_most(spread, 0.03),
            "deceleration, com aside": at_most(np.abs(offset[:, 0] - 1.0).max(), 0.02),
            "spin torque, com aside": at_most(np.abs(offset_spins - 1.0).max(), 0.05),
            "spin torque off": at_most(np.abs(spins - 1.0).max(), 0.05),
            "slip at 1.1 r_lim [mm]": at_most(max(stick.values()), 1.0),
            "slip at 0.85 r_lim [mm]": at_least(min(slip.values()), 4.0),
            "straight push over 1 m [mm]": at_most(straight, 0.3),
            "wheel distance": at_most(distance, 0.01),
            "wheel yaw": at_most(yaw, 0.01),
        },
    }
