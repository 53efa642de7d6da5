"""Stable-push limits in simulation: no slip just inside, slip just outside, for many polygons.

The pusher is a heavy e-puck, so that its wheels do not slip.
"""

import math
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.measure import at_least, at_most
from push_model import contact_on_side, curvature_limits, se2
from push_model.specs import EnvironmentSpec, ObjectSpec
from push_scenario.scenario import load_scenario
from sim_bridge.pybullet_world import PyBulletWorld

INSIDE, OUTSIDE = 0.92, 1.15  # of the limiting curvature
POLYGONS: dict[str, list[list[float]]] = {
    "square": [[0, 0], [0.09, 0], [0.09, 0.09], [0, 0.09]],
    "rectangle": [[0, 0], [0.12, 0], [0.12, 0.07], [0, 0.07]],
    "triangle": [[0, 0], [0.12, 0], [0.06, 0.104]],
    "pentagon": [[0.06 * math.cos(a), 0.06 * math.sin(a)] for a in np.arange(5) * 1.2566],
    "trapezium": [[0, 0], [0.12, 0], [0.1, 0.08], [0.03, 0.08]],
}


def slip(task: tuple[str, int, float, float, float]) -> float:
    """[mm] of the object at the bumper over an arc: polygon, side, friction, curvature, turn."""
    name, index, mu, kappa, degrees = task
    vertices = tuple(tuple(v) for v in POLYGONS[name])
    item = ObjectSpec({"polygon": {"vertices": vertices}}, 0.05, 0.06, 0.3, mu, feet=8)
    robot = load_scenario("short").robot()[1]
    robot = replace(robot, mass=1.0, drive=replace(robot.drive, wheel_torque=0.5))
    contact = contact_on_side(item.geometry.sides[index], robot.bumper.width)
    grasp = contact.object_pose + [robot.bumper.distance + 0.0008, 0.0, 0.0]
    environment = EnvironmentSpec((6.0, 6.0), resolution=0.05)
    speed = 0.04
    with PyBulletWorld(environment, {"r": (robot, np.zeros(3))}, {"b": (item, grasp)}) as world:
        for i in range(31):
            world.command("r", speed * i / 30, 0.0)
            world.step(10)
        world.step(300)
        for i in range(31):
            world.command("r", speed, speed * kappa * i / 30)
            world.step(10)
        poses = world.poses()
        first = se2.between(poses["r"], poses["b"])
        world.step(round(math.radians(degrees) / (speed * abs(kappa)) * 1000))
        poses = world.poses()
    change = se2.between(poses["r"], poses["b"]) - first
    return float(1e3 * max(abs(change[1]), 0.5 * robot.bumper.width * abs(se2.wrap(change[2]))))


def tasks() -> list[tuple[str, int, float, float, float]]:
    """Every side of every polygon, three frictions, both turns, inside and outside."""
    robot = load_scenario("short").robot()[1]
    result = []
    for name, vertices in POLYGONS.items():
        for mu in (0.2, 0.3, 0.5):
            shape = {"polygon": {"vertices": tuple(tuple(v) for v in vertices)}}
            item = ObjectSpec(shape, 0.05, 0.06, 0.3, mu)
            for side in item.geometry.sides:
                contact = contact_on_side(side, robot.bumper.width)
                limits = curvature_limits(contact, robot.bumper.distance, mu, item.limit_surface())
                if limits is None:
                    continue
                for bound in (limits.minimum, limits.maximum):
                    for factor in (INSIDE, OUTSIDE):
                        result.append((name, side.index, mu, bound * factor, 60.0))
    return result


def run() -> dict[str, Any]:
    """The table: greatest slip inside, least slip outside."""
    work = tasks()
    with ProcessPoolExecutor(mp_context=multiprocessing.get_context("spawn")) as pool:
        slips = list(pool.map(slip, work, chunksize=4))
    rows: dict[tuple[str, int, float], list[tuple[float, float]]] = {}
    for i in range(0, len(work), 2):
        name, side, mu, _, _ = work[i]
        rows.setdefault((name, side, mu), []).append((slips[i], slips[i + 1]))
    print("  polygon    side   mu   right: inside outside   left: inside outside [mm]")
    for (name, side, mu), pairs in rows.items():
        cells = "   ".join(f"{a:14.2f} {b:7.2f}" for a, b in pairs)
        print(f"  {name:10s} {side:4d}  {mu:.1f}   {cells}")
    inside, outside = np.array(slips[0::2]), np.array(slips[1::2])
    return {
        "rows": [
            {"polygon": n, "side": s, "mu": m, "slips_mm": p} for (n, s, m), p in rows.items()
        ],
        "bounds": {
            "greatest slip inside [mm]": at_most(inside.max(), 1.5),
            "least slip outside [mm]": at_least(outside.min(), 2.0),
            "least outside over inside": at_least((outside / np.maximum(inside, 0.1)).min(), 2.0),
        },
    }
