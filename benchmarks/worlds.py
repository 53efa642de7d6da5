"""Speed of the planar world against PyBullet: discs that press on a plate between walls."""

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.measure import at_least
from push_model.shape_specs import PolygonShape
from push_model.specs import EnvironmentSpec
from push_scenario.bodies import load_object, load_robot
from sim_bridge.planar_world import PlanarWorld
from sim_bridge.pybullet_world import PyBulletWorld

TICK = 0.01  # [s] between commands
_PLATE = 0.25  # [m] circumradius


def crowd(make: Callable[..., Any], count: int, bumper: float) -> Any:
    """A world of discs behind a hexagonal plate, with three walls of the arena near."""
    disc = load_robot("disc")
    drive = replace(disc.drive, max_force=1.9)
    disc = replace(disc, drive=drive, bumper=replace(disc.bumper, radius=bumper))
    corners = [(_PLATE * math.cos(a), _PLATE * math.sin(a)) for a in np.arange(6) * math.pi / 3.0]
    plate = replace(load_object("plate_hexagon"), shape=PolygonShape(tuple(corners)), mass=0.5)
    rows = max(1, round(math.sqrt(count)))
    gap = 2.0 * bumper + 0.004
    starts = {}
    for k in range(count):
        column, row = divmod(k, rows)
        x = -_PLATE - 1.2 * bumper - gap * column
        starts[f"d{k}"] = np.array([x, gap * (row - 0.5 * (rows - 1)), 0.0])
    wide = gap * rows + 0.6
    room = EnvironmentSpec((2.0 * (gap * (count // rows + 1) + 2.5), wide), resolution=0.05)
    robots = {name: (disc, start) for name, start in starts.items()}
    return make(room, robots, {"plate": (plate, np.zeros(3))})


def pace(make: Callable[..., Any], count: int, bumper: float, seconds: float) -> float:
    """Simulated seconds per CPU second, with contacts, commands and poses in every tick."""
    random = np.random.default_rng(1)
    with crowd(make, count, bumper) as world:
        names = [n for n in world.names if n != "plate"]
        steps = round(TICK / world.time_step)
        twists = np.zeros((count, 3))
        twists[:, :2] = random.normal([0.1, 0.0], 0.01, (count, 2))
        world.command_all(names, twists, True)
        world.step(round(1.0 / world.time_step) if count < 200 else steps)
        world.read_contacts()
        spent = time.thread_time()
        for _ in range(round(seconds / TICK)):
            world.command_all(names, twists, True)
            world.step(steps)
            world.poses()
        return seconds / (time.thread_time() - spent)


def run() -> dict[str, Any]:
    """Pace of both worlds, and their ratio."""
    result: dict[str, Any] = {"bounds": {}}
    pace(PlanarWorld, 2, 0.05, 0.1)
    for count, bumper, seconds, limit in (
        (5, 0.05, 20.0, 300.0),
        (20, 0.05, 10.0, 100.0),
        (200, 0.035, 2.0, 0.0),
        (1000, 0.035, 1.0, 3.0),
    ):
        ours = pace(PlanarWorld, count, bumper, seconds)
        other = pace(PyBulletWorld, count, bumper, min(1.0, 20.0 / count))
        print(f"  {count:5d} discs: planar {ours:7.1f} x, PyBullet {other:6.2f} x real time")
        result[str(count)] = {"planar": ours, "pybullet": other}
        if limit:
            result["bounds"][f"planar, {count} discs [x real time]"] = at_least(ours, limit)
    return result
