"""One run of a swarm on a map with walls, in any world, without ROS."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.free_space import FreeSpace, Obstacles
from push_model.occupancy import rasterise
from push_model.settings import from_mapping
from push_model.specs import EnvironmentSpec, ObjectSpec
from push_scenario.bodies import load_object, load_robot
from push_scenario.files import find, read_yaml
from push_study.group_world import GroupWorld
from push_study.pool import Row
from push_study.swarm_run import ROBOT, TRACE, drive
from push_study.uncertainty import uncertainty
from swarm_push.agent import Agent, AgentSettings, AgentState
from swarm_push.region import covered_region
from swarm_push.swarm_job import SwarmJob, SwarmJobSettings

MAPS = {
    "transport_reference": ((-1.0, -1.0), (1.0, 1.0)),
    "transport_middle": ((0.0, -1.0), (0.0, 1.0)),
    "transport_corner": ((-1.0, -1.0), (-1.0, 1.0)),
    "transport_two_corners": ((-1.0, -1.0), (1.0, 1.0)),
}
"""[m] Where the object starts and where it is to go, of Queiroz and MacRae 2024."""
REACHED, TURNED = 0.1, 0.1  # [m], [rad]
_GAP = 0.02  # [m] between all at the start
_STALLED = 120.0  # [s]


@dataclass(frozen=True)
class MapTask:
    """A run. scenario: name of the map; item: of the object; turned: whether headings matter; lost:
    part of the messages between robots that decide for themselves, None where one node decides."""

    scenario: str
    seed: int
    out: str
    item: str
    robots: int
    turned: bool
    world: str
    uncertainty: str
    limit: float
    lost: float | None = None

    @property
    def trace(self) -> Path:
        """Where its ways are kept."""
        kind = "pose" if self.turned else "position"
        return Path(self.out) / "ways" / f"{self.scenario}-{self.item}-{kind}-{self.seed}.npz"


def load_map(name: str) -> EnvironmentSpec:
    """A room of config/environments."""
    path = find("environments", name)
    return from_mapping(EnvironmentSpec, read_yaml(path), str(path))


def scattered(
    random: np.random.Generator, count: int, space: FreeSpace, outline: Array, radius: float
) -> Array:
    """``(n, 3)`` poses anywhere on a map with an object ``(k, 2)`` on it, apart from all."""
    x0, x1 = space.places[:, 0].min(), space.places[:, 0].max()
    y0, y1 = space.places[:, 1].min(), space.places[:, 1].max()
    placed = np.zeros((0, 3))
    while len(placed) < count:
        p = random.uniform((x0, y0), (x1, y1))
        among = Obstacles(
            (outline,), np.column_stack([placed[:, :2], np.full(len(placed), radius)])
        )
        if space.room(p[None], among)[0] > radius + _GAP:
            placed = np.vstack([placed, [*p, random.uniform(-math.pi, math.pi)]])
    return placed


def run(task: MapTask) -> Row:
    """To the map's goal, with headings at start and goal at random."""
    item, robot = load_object(task.item), load_robot(ROBOT)
    room = load_map(task.scenario)
    random = np.random.default_rng([task.seed, task.robots])
    (sx, sy), (gx, gy) = MAPS[task.scenario]
    start = np.array([sx, sy, random.uniform(-math.pi, math.pi)])
    goal = np.array([gx, gy, random.uniform(-math.pi, math.pi) if task.turned else math.nan])
    radius = robot.footprint_radius
    outline = se2.transform(item.mass_pose(start), item.geometry.outline)
    begin = scattered(random, task.robots, FreeSpace(rasterise(room)), outline, radius)
    doubt = uncertainty(task.uncertainty)
    with GroupWorld(room, robot, begin, item, start, doubt, task.seed, task.world) as world:
        if task.lost is None:
            job = _job(room, item, task.turned)
            job.begin([goal])
            ways, phases = drive(job, world, item, task.limit)
        else:
            jobs = [_job(room, item, task.turned) for _ in world.names]
            ways = drive_agents(jobs, goal, world, item, task)
            job, phases = jobs[0], {}
        taken, drawn = world.time, world.drawn
        away, turned = job.errors(item.mass_pose(world.truth()[0]))
    task.trace.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(task.trace, ways=ways)
    done = job.index == 1
    row: Row = {
        "scenario": task.scenario,
        "seed": task.seed,
        "object": task.item,
        "robots": task.robots,
        "turned": task.turned,
        "success": done,
        "reason": "" if done else job.reason,
        "position_error_m": away,
        "orientation_error_rad": turned,
    }
    if done:
        row["duration_s"] = taken
        row["way_m"] = float(np.hypot(*np.diff(ways[:, 0, :2], axis=0).T).sum())
    row |= {f"{name.replace(' ', '_')}_s": spent for name, spent in phases.items()}
    return row | drawn


def drive_agents(
    jobs: list[SwarmJob], goal: Array, world: GroupWorld, item: ObjectSpec, task: MapTask
) -> Array:
    """The same where every robot decides for itself: poses ``(t, 1 + n, 3)`` now and then."""
    assert task.lost is not None
    settings = AgentSettings(decentralised=True, lost=task.lost, seed=task.seed)
    agents = [Agent(n, job, settings) for n, job in zip(world.names, jobs, strict=True)]
    for agent in agents:
        agent.job.begin([goal])
    ways, words, none, tick = [], list[AgentState](), np.zeros((0, 3)), 0
    while world.time < task.limit and any(a.job.busy for a in agents):
        seen, robots = world.see()
        pose = item.mass_pose(seen)
        for agent in agents:
            for word in words:
                agent.hear(word)
        told = [a.step(world.time, pose, p, none) for a, p in zip(agents, robots, strict=True)]
        words = [word for _, word in told]
        if tick % TRACE == 0:
            ways.append(np.vstack([*world.truth()]))
        world.step(np.array([twist for twist, _ in told]))
        tick += 1
    return np.array(ways)


def _job(room: EnvironmentSpec, item: ObjectSpec, turned: bool) -> SwarmJob:
    robot, grid = load_robot(ROBOT), rasterise(room)
    region = covered_region(grid, robot.footprint_radius)
    assert region is not None
    settings = replace(
        SwarmJobSettings(),
        position_tolerance=REACHED,
        orientation_tolerance=TURNED,
        orientation=turned,
        stalled=_STALLED,
    )
    return SwarmJob(region, item, robot, settings, grid=grid)
