"""One run of anybody's swarm in an open room to one position, in any world, without ROS."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.free_space import FreeSpace
from push_model.occupancy import rasterise
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from push_scenario.bodies import load_object, load_robot
from push_study.group_world import GroupWorld
from push_study.pool import Row
from push_study.rivals.gibbs import Gibbs
from push_study.rivals.global_input import GlobalInput
from push_study.rivals.occlusion import Occlusion
from push_study.rivals.rival import Arena, Rival
from push_study.swarm_map import scattered
from push_study.swarm_run import ROBOT, TRACE, drive
from push_study.uncertainty import uncertainty
from swarm_push.laws import LawSections, LawSettings
from swarm_push.region import covered_region
from swarm_push.swarm_job import SwarmJob, SwarmJobSettings

RIVALS: dict[str, Callable[[Arena], Rival]] = {
    "global-input": GlobalInput,
    "occlusion": Occlusion,
    "gibbs": Gibbs,
}
OURS = ("crescent", "thesis")
ROBOTS_OF = {"global-input": "disc"}
"""Robots of methods for such as go in any direction; others have e-pucks, as large and fast."""
SIZE, START, TARGET = 3.0, (-0.7, -0.7), (0.7, 0.7)  # [m]
REACHED = 0.1  # [m]
_LEAD = 0.025  # [m]


@dataclass(frozen=True)
class RivalTask:
    """A run. scenario: name of the object; method: of ``OURS`` or ``RIVALS``."""

    scenario: str
    seed: int
    out: str
    method: str
    robots: int
    world: str
    uncertainty: str
    limit: float

    @property
    def trace(self) -> Path:
        """Where its ways are kept."""
        return Path(self.out) / "ways" / f"{self.scenario}-{self.method}-{self.seed}.npz"


def run(task: RivalTask) -> Row:
    """To the target, or as far as the swarm comes."""
    item, robot = load_object(task.scenario), load_robot(ROBOTS_OF.get(task.method, ROBOT))
    room = EnvironmentSpec((SIZE, SIZE), resolution=0.02)
    random = np.random.default_rng([task.seed, task.robots])
    start = np.array([*START, random.uniform(-math.pi, math.pi)])
    outline = se2.transform(item.mass_pose(start), item.geometry.outline)
    radius, speed = robot.footprint_radius, robot.max_speed
    begin = scattered(random, task.robots, FreeSpace(rasterise(room)), outline, radius)
    doubt = uncertainty(task.uncertainty)
    with GroupWorld(room, robot, begin, item, start, doubt, task.seed, task.world) as world:
        if task.method in OURS:
            job = _job(room, item, robot, task)
            ways, _ = drive(job, world, item, task.limit)
        else:
            arena = Arena(room.size, item, radius, speed, np.array(TARGET), task.seed)
            ways = _drive(RIVALS[task.method](arena), world, item, robot, task.limit)
        taken, drawn = world.time, world.drawn
        away = float(np.hypot(*(item.mass_pose(world.truth()[0])[:2] - TARGET)))
    task.trace.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(task.trace, ways=ways)
    done = away < REACHED + 5e-3
    least = float(np.hypot(*(ways[:, 0, :2] - TARGET).T).min())
    row: Row = {
        "scenario": task.scenario,
        "seed": task.seed,
        "method": task.method,
        "robots": task.robots,
        "success": done,
        "reason": "" if done else f"{away:.2f} m away after {taken:.0f} s",
        "position_error_m": away,
        "nearest_m": min(least, away),
    }
    if done:
        length = math.hypot(TARGET[0] - START[0], TARGET[1] - START[1])
        row |= {"duration_s": taken, "lambda": taken * speed / length}
    return row | drawn


def _drive(
    rival: Rival, world: GroupWorld, item: ObjectSpec, robot: RobotSpec, limit: float
) -> Array:
    ways, tick, speed = [], 0, robot.max_speed
    wheels = robot.kinematics
    while world.time < limit:
        seen, robots = world.see()
        pose = item.mass_pose(seen)
        if np.hypot(*(pose[:2] - TARGET)) < REACHED:
            break
        velocities = rival.velocities(world.time, pose, robots)
        fast = np.hypot(*velocities.T) / speed
        velocities = velocities / np.maximum(fast, 1.0)[:, None]
        if tick % TRACE == 0:
            ways.append(np.vstack([*world.truth()]))
        if wheels is not None:
            velocities = wheels.follow(velocities, robots[:, 2], _LEAD)
        world.step(velocities)
        tick += 1
    return np.array(ways)


def _job(room: EnvironmentSpec, item: ObjectSpec, robot: RobotSpec, task: RivalTask) -> SwarmJob:
    grid = rasterise(room)
    region = covered_region(grid, robot.footprint_radius)
    assert region is not None
    settings = replace(SwarmJobSettings(), position_tolerance=REACHED, stalled=task.limit)
    laws = LawSections(law=LawSettings(law=task.method))  # type: ignore[arg-type]
    job = SwarmJob(region, item, robot, settings, laws, grid)
    job.begin([np.array([*TARGET, math.nan])])
    return job
