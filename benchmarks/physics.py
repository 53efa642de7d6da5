"""The simulated physics against Coulomb's law and the stable-push limits, in every world."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.measure import at_least, at_most
from push_model import se2, uniform_pressure_radius
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from push_scenario.bodies import load_object, load_robot
from push_scenario.scenario import load_scenario
from sim_bridge.planar_world import PlanarWorld
from sim_bridge.pybullet_world import PyBulletWorld

OPEN = EnvironmentSpec((8.0, 8.0), resolution=0.02)
WORLDS: dict[str, Callable[..., Any]] = {"pybullet": PyBulletWorld, "planar": PlanarWorld}
World = str
DISC = load_robot("disc")


def advance(world: Any, seconds: float) -> None:
    """Step a world by a duration."""
    world.step(round(seconds / world.time_step))


def deceleration(kind: World, item: ObjectSpec, yaw: float, direction: float) -> np.ndarray:
    """[m/s^2], [rad/s^2] change of a sliding object's twist, over mu g; and its drift aside."""
    with WORLDS[kind](OPEN, {}, {"b": (item, np.array([0.0, 0.0, yaw]))}) as world:
        advance(world, 0.3)
        world.set_velocity("b", 0.3 * np.array([math.cos(direction), math.sin(direction), 0.0]))
        advance(world, 0.01)
        first = world.velocity("b")
        advance(world, 0.04)
        change = (first - world.velocity("b")) / 0.04 / (item.floor_friction * 9.81)
    along = change[0] * math.cos(direction) + change[1] * math.sin(direction)
    across = -change[0] * math.sin(direction) + change[1] * math.cos(direction)
    return np.array([along, across])


def spin(kind: World, item: ObjectSpec, yaw: float) -> float:
    """Pure-spin torque over the uniform-pressure value."""
    with WORLDS[kind](OPEN, {}, {"b": (item, np.array([0.0, 0.0, yaw]))}) as world:
        advance(world, 0.3)
        world.set_velocity("b", np.array([0.0, 0.0, 6.0]))
        advance(world, 0.01)
        first = world.velocity("b")[2]
        advance(world, 0.04)
        slowed = (first - world.velocity("b")[2]) / 0.04
    expected = item.floor_friction * 9.81 * uniform_pressure_radius(item.geometry)
    return float(slowed * item.geometry.inertia_per_mass / expected)


def arc_slip(
    kind: World, robot: RobotSpec, item: ObjectSpec, mu: float, factor: float, turn: float
) -> float:
    """[mm] slip along the bumper over a 60 degree arc at factor * r_lim; turn +1 left, -1 right."""
    distance = item.geometry.sides[0].distance
    radius = (distance + robot.bumper.distance) / mu * factor
    spec, speed = replace(item, contact_friction=mu), 0.05
    ahead = np.array([robot.bumper.distance + distance + 0.0005, 0.0, 0.0])
    with WORLDS[kind](OPEN, {"r": (robot, np.zeros(3))}, {"b": (spec, ahead)}) as world:
        for i in range(31):
            world.command("r", speed * i / 30, 0.0)
            advance(world, 0.01)
        advance(world, 0.3)
        for i in range(31):
            world.command("r", speed, turn * speed / radius * i / 30)
            advance(world, 0.01)
        poses = world.poses()
        first = se2.between(poses["r"], poses["b"])
        heading = poses["r"][2]
        while abs(se2.wrap(world.poses()["r"][2] - heading)) < math.pi / 3:
            advance(world, 0.02)
        poses = world.poses()
    return float(1e3 * abs(se2.between(poses["r"], poses["b"])[1] - first[1]))


def straight_slip(kind: World, robot: RobotSpec, item: ObjectSpec) -> float:
    """[mm] slip along the bumper over 1 m."""
    ahead = np.array([robot.bumper.distance + 0.0455, 0.0, 0.0])
    with WORLDS[kind](OPEN, {"r": (robot, np.zeros(3))}, {"b": (item, ahead)}) as world:
        for i in range(31):
            world.command("r", 0.08 * i / 30, 0.0)
            advance(world, 0.01)
        advance(world, 0.3)
        poses = world.poses()
        first = se2.between(poses["r"], poses["b"])
        advance(world, 12.5)
        poses = world.poses()
    return float(1e3 * np.abs(se2.between(poses["r"], poses["b"]) - first)[:2].max())


def wheels(kind: World, robot: RobotSpec) -> tuple[float, float]:
    """Relative error of distance and yaw of wheel commands."""
    with WORLDS[kind](OPEN, {"r": (robot, np.array([0.0, 0.0, 0.3]))}, {}) as world:
        world.command("r", 0.1, 0.0)
        advance(world, 0.2)
        before = world.poses()["r"]
        advance(world, 10.0)
        distance = se2.between(before, world.poses()["r"])[0]
        world.command("r", 0.0, 1.0)
        advance(world, 0.2)
        before = world.poses()["r"][2]
        advance(world, 3.0)
        yaw = se2.wrap(world.poses()["r"][2] - before)
    return abs(distance - 1.0), abs(yaw / 3.0 - 1.0)


def jam(kind: World) -> tuple[float, float]:
    """A plate between a wall and a disc that presses on it: creep [mm] in 5 s; force at the wall
    over that of the disc (the floor takes the rest)."""
    room = EnvironmentSpec((2.0, 2.0), resolution=0.02)
    plate = replace(load_object("plate_square"), contact_friction=0.3)
    poses = {"d": np.array([1.0 - 0.35 - 0.0502, 0.03, 0.0]), "p": np.array([0.8249, 0.0, 0.0])}
    with WORLDS[kind](room, {"d": (DISC, poses["d"])}, {"p": (plate, poses["p"])}) as world:
        world.command_all(["d"], np.array([[0.1, 0.0, 0.0]]), True)
        advance(world, 1.0)
        before = world.poses()["p"].copy()
        world.read_contacts()
        advance(world, 5.0)
        creep = float(np.hypot(*(world.poses()["p"] - before)[:2]))
        push = {frozenset((c.body_a, c.body_b)): c.force for c in world.read_contacts()}
    felt = sum(np.abs(f[0]) for pair, f in push.items() if "d" not in pair)
    given = sum(np.abs(f[0]) for pair, f in push.items() if "d" in pair)
    return 1e3 * creep, float(felt / given)


def work(kind: World) -> float:
    """Work of two discs that turn and push a plate, over the friction work of the floor."""
    plate = load_object("plate_hexagon")
    surface = plate.limit_surface()
    strong = replace(DISC, drive=replace(DISC.drive, max_force=20.0))
    outline = plate.geometry.outline
    side = (outline[2] + outline[3]) / 2.0, (outline[3] + outline[4]) / 2.0
    starts = {}
    for name, middle in zip("de", side, strict=True):
        starts[name] = np.array([*(middle * (1.0 + 0.0501 / np.hypot(*middle))), 0.0])
    robots = {name: (strong, start) for name, start in starts.items()}
    given = taken = 0.0
    with WORLDS[kind](OPEN, robots, {"p": (plate, np.zeros(3))}) as world:
        angle, centre, dt = 0.0, np.array([0.0, -1.2]), 0.01
        for tick in range(1200):
            speed = 0.1 * min(1.0, tick / 100)
            angle -= speed / 1.2 * dt
            turn = se2.pose(0.0, 0.0, angle)
            goal = [
                centre + se2.transform(turn, (s[:2] - centre)[None])[0] for s in starts.values()
            ]
            now = world.poses()
            twists = [[*((g - now[n][:2]) / dt), 0.0] for n, g in zip(starts, goal, strict=True)]
            world.command_all(list(starts), np.array(twists), True)
            before = now["p"]
            advance(world, dt)
            after = world.poses()["p"]
            moved = np.array([*(after - before)[:2], se2.wrap(after[2] - before[2])])
            if tick < 150:
                world.read_contacts()
                continue
            for contact in world.read_contacts():
                sign = -1.0 if contact.body_a in starts else 1.0
                arm = contact.position[:2] - 0.5 * (before + after)[:2]
                step = moved[:2] + moved[2] * np.array([-arm[1], arm[0]])
                given += sign * float(contact.force[:2] @ step)
            local = se2.transform(se2.pose(0.0, 0.0, -after[2]), moved[None, :2])[0]
            twist = np.array([*local, moved[2]])
            taken += float(surface.wrench(twist) @ twist)
    return given / taken


def run() -> dict[str, Any]:
    """The physics suite, world by world."""
    result: dict[str, Any] = {"bounds": {}}
    for kind in WORLDS:
        print(f"  -- {kind}")
        result[kind] = suite(kind)
        for name, bound in result[kind].pop("bounds").items():
            result["bounds"][f"{kind}: {name}"] = bound
    return result


def suite(kind: World) -> dict[str, Any]:
    """One world against theory."""
    scenario = load_scenario("env1-target1")
    robot, item = scenario.robot()[1], scenario.object()[1]
    values = np.array(
        [
            deceleration(kind, item, yaw, direction)
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
            deceleration(kind, other, yaw, direction)
            for other in aside
            for yaw in np.arange(4) * math.pi / 8
            for direction in np.arange(4) * math.pi / 2
        ]
    )
    offset_spins = np.array([spin(kind, other, yaw) for other in aside for yaw in (0.0, 0.6)])
    print(
        f"  com aside: deceleration {offset[:, 0].min():.4f} .. {offset[:, 0].max():.4f}, "
        f"spin {offset_spins.min():.4f} .. {offset_spins.max():.4f}"
    )
    spins = np.array([spin(kind, item, yaw) for yaw in np.arange(8) * math.pi / 16])
    print(f"  spin torque / uniform pressure: {spins.min():.4f} .. {spins.max():.4f}")
    stick, slip = {}, {}
    for mu in (0.2, 0.3, 0.5):
        stick[mu] = max(arc_slip(kind, robot, item, mu, 1.1, t) for t in (1.0, -1.0))
        slip[mu] = min(arc_slip(kind, robot, item, mu, 0.85, t) for t in (1.0, -1.0))
        print(f"  mu {mu}: slip {stick[mu]:.2f} mm at 1.1 r_lim, {slip[mu]:.2f} mm at 0.85 r_lim")
    straight = straight_slip(kind, robot, item)
    distance, yaw = wheels(kind, robot)
    creep, share = jam(kind)
    effort = work(kind)
    print(
        f"  straight 1 m: {straight:.3f} mm; wheels: distance {100 * distance:.3f} %, "
        f"yaw {100 * yaw:.3f} %"
    )
    print(
        f"  jammed at a wall: creep {creep:.3f} mm in 5 s, wall's share {share:.3f}; work of two "
        f"discs / friction {effort:.4f}"
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
            "creep of a jammed plate in 5 s [mm]": at_most(creep, 0.3),
            "work / friction off": at_most(abs(effort - 1.0), 0.04),
        },
    }
