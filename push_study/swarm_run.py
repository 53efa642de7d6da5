"""One run of a swarm through targets, in any world, without ROS."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from push_model import se2
from push_model.arrays import Array
from push_model.outlines import distance, inside
from push_model.specs import EnvironmentSpec, ObjectSpec
from push_scenario.bodies import load_object, load_robot
from push_study.group_world import TICK, GroupWorld
from push_study.pool import Row
from push_study.uncertainty import uncertainty
from swarm_push.laws import LawSections, LawSettings
from swarm_push.swarm_job import SwarmJob, SwarmJobSettings

ROBOT = "epuck_ring"
SIMULATION = ((2.0, 2.0), (0.0, 0.0), (-1.0, 1.0), (-1.0, -2.0), (2.0, -1.0), (0.0, 0.0))
"""[m] Table 4.1, left."""
EXPERIMENT = ((1.0, 1.0), (0.0, 0.0), (-0.5, 0.5), (-0.5, -0.5), (1.0, -0.5), (0.0, 0.0))
"""[m] Table 4.1, right."""
REACHED = 0.1  # [m] from a target, as printed
_MARGIN = 1.2  # [m] about the targets
_AROUND = 1.0  # [m] about the object that robots start in
_GAP = 0.02  # [m] between all at the start
TRACE = 10
"""Ticks between points of a way that are kept."""


@dataclass(frozen=True)
class SwarmTask:
    """A run. scenario: name of the object; law: of ``swarm_push.laws``; targets: of positions."""

    scenario: str
    seed: int
    out: str
    robots: int
    law: str
    world: str
    uncertainty: str
    targets: tuple[tuple[float, float], ...]
    limit: float

    @property
    def trace(self) -> Path:
        """Where its ways are kept."""
        name = f"{self.scenario}-{self.robots}-{self.law}-{self.seed}.npz"
        return Path(self.out) / "ways" / name


def length(targets: Sequence[tuple[float, float]]) -> float:
    """[m] straight from target to target, from the origin on."""
    points = np.array([(0.0, 0.0), *targets])
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def starts(random: np.random.Generator, count: int, item: ObjectSpec, radius: float) -> Array:
    """``(n, 3)`` poses about an object in the origin, at random, apart from it and each other."""
    reach = max(_AROUND, 0.25 * math.sqrt(count))
    placed: list[Array] = []
    while len(placed) < count:
        p = random.uniform(-reach, reach, 2)
        outline = item.outline
        if inside(outline, p[None])[0] or distance(outline, p[None])[0] < radius + _GAP:
            continue
        if all(np.hypot(*(p - q)) > 2.0 * radius + _GAP for q in placed):
            placed.append(p)
    return np.column_stack([np.array(placed), random.uniform(-math.pi, math.pi, count)])


def run(task: SwarmTask) -> Row:
    """Through all targets, or as far as the swarm comes."""
    item, robot = load_object(task.scenario), load_robot(ROBOT)
    half = np.abs(np.array(task.targets)).max(axis=0) + _MARGIN
    room = EnvironmentSpec((2.0 * float(half[0]), 2.0 * float(half[1])), resolution=0.05)
    radius = robot.footprint_radius
    x, y = half - radius
    region = np.array([[-x, -y], [x, -y], [x, y], [-x, y]])
    settings = replace(SwarmJobSettings(), position_tolerance=REACHED, stalled=task.limit)
    laws = LawSections(law=LawSettings(law=task.law))  # type: ignore[arg-type]
    job = SwarmJob(region, item, robot, settings, laws)
    job.begin([np.array([*t, math.nan]) for t in task.targets])
    begin = starts(np.random.default_rng([task.seed, task.robots]), task.robots, item, radius)
    doubt = uncertainty(task.uncertainty)
    with GroupWorld(room, robot, begin, item, np.zeros(3), doubt, task.seed, task.world) as world:
        ways, phases = drive(job, world, item, task.limit)
        taken, drawn = world.time, world.drawn
    task.trace.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(task.trace, ways=ways, times=np.array(job.times))
    done = job.index == len(task.targets)
    row: Row = {
        "scenario": task.scenario,
        "seed": task.seed,
        "robots": task.robots,
        "law": task.law,
        "success": done,
        "reason": "" if done else job.reason,
        "targets": job.index,
    }
    if done:
        speed = robot.differential.max_speed
        row |= {"duration_s": taken, "lambda": taken * speed / length(task.targets)}
    row |= {f"{name.replace(' ', '_')}_s": spent for name, spent in phases.items()}
    return row | drawn


def drive(
    job: SwarmJob,
    world: GroupWorld,
    item: ObjectSpec,
    limit: float,
    meanwhile: Callable[[float], None] | None = None,
) -> tuple[Array, dict[str, float]]:
    """Until a job that was begun ends, or a time [s]: poses ``(t, 1 + n, 3)`` of object and robots
    now and then, and how long [s] each phase took. meanwhile: told the time at every tick."""
    ways, none = [], np.zeros((0, 3))
    phases: dict[str, float] = {}
    tick = 0
    while world.time < limit and job.busy:
        if meanwhile is not None:
            meanwhile(world.time)
        seen, robots = world.see()
        here = dict(zip(world.names, robots, strict=True))
        twists = job.step(world.time, item.mass_pose(seen), here, none)
        if job.last is not None:
            name = job.last.phase.value
            phases[name] = phases.get(name, 0.0) + TICK
        if tick % TRACE == 0:
            ways.append(np.vstack([*world.truth()]))
        world.step(np.array([twists[n] for n in world.names]))
        tick += 1
    return np.array(ways), phases


def draw_ways(axes: Axes, task: SwarmTask) -> None:
    """An object and its way, as of Figure 4.10."""
    ways, item = np.load(task.trace)["ways"], load_object(task.scenario)
    outline = np.vstack([item.outline, item.outline[:1]])
    for k in np.linspace(0, len(ways) - 1, 14).astype(int):
        axes.plot(*se2.transform(ways[k, 0], outline).T, color="C0", lw=0.6, alpha=0.7)
        axes.plot(*ways[k, 1:, :2].T, ".", color="C7", ms=2)
    axes.plot(*ways[:, 0, :2].T, color="C1", lw=1.0)
    axes.plot(*np.array(task.targets).T, "kx", ms=4)
    axes.set_aspect("equal")
