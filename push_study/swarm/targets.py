"""A swarm through targets in an open room, in the graph."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from push_job.method import Task
from push_model import se2
from push_model.arrays import Array
from push_model.specs import EnvironmentSpec
from push_scenario.bodies import load_object, load_robot
from push_scenario.scatter import around
from push_scenario.scenario import Scenario
from push_study.pool import Row
from push_study.team_run import Outcome, made_scenario, run_team
from push_study.uncertainty import uncertainty

ROBOT = "epuck_ring"
SIMULATION = ((2.0, 2.0), (0.0, 0.0), (-1.0, 1.0), (-1.0, -2.0), (2.0, -1.0), (0.0, 0.0))
"""[m] Table 4.1, left."""
EXPERIMENT = ((1.0, 1.0), (0.0, 0.0), (-0.5, 0.5), (-0.5, -0.5), (1.0, -0.5), (0.0, 0.0))
"""[m] Table 4.1, right."""
REACHED = 0.1  # [m] from a target, as printed
_MARGIN = 1.2  # [m] about the targets


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
    return float(legs(targets).sum())


def legs(targets: Sequence[tuple[float, float]]) -> Array:
    """``(n,)`` [m] to each target straight from the one before."""
    points = np.array([(0.0, 0.0), *targets])
    lengths: Array = np.hypot(*np.diff(points, axis=0).T)
    return lengths


def positions(targets: Sequence[tuple[float, float]]) -> Task:
    """The task of positions ``(x, y)`` [m], whatever the heading."""
    return Task(tuple(np.array([x, y, math.nan]) for x, y in targets))


def run(task: SwarmTask, mistake: Callable[[Scenario], Scenario] | None = None) -> Row:
    """Through all targets, or as far as the swarm comes. mistake: see ``run_team``."""
    item, robot = load_object(task.scenario), load_robot(ROBOT)
    width, height = 2.0 * (np.abs(np.array(task.targets)).max(axis=0) + _MARGIN)
    room = EnvironmentSpec((float(width), float(height)), resolution=0.05)
    begin = around(
        np.random.default_rng([task.seed, task.robots]), task.robots, item, robot.footprint_radius
    )
    swarm = {
        "position_tolerance": REACHED,
        "orientation": False,
        "stalled": task.limit,
        "law": {"law": task.law},
    }
    scenario = made_scenario(task.scenario, room, robot, begin, item, np.zeros(3), {"swarm": swarm})
    outcome = run_team(
        "swarm",
        scenario,
        positions(task.targets),
        uncertainty(task.uncertainty),
        task.seed,
        task.limit,
        world=task.world,
        mistake=mistake,
    )
    keep_ways(task.trace, outcome)
    row: Row = {
        "scenario": task.scenario,
        "seed": task.seed,
        "robots": task.robots,
        "law": task.law,
        "success": outcome.success,
        "targets": outcome.reached,
        **outcome.row(),
    }
    if outcome.success:
        row["lambda"] = outcome.charged * robot.max_speed / length(task.targets)
    times = outcome.times[: outcome.reached]
    each = np.array(times) * robot.max_speed / legs(task.targets)[: len(times)]
    row |= {f"lambda_{k + 1}": float(value) for k, value in enumerate(each)}
    return row | phase_times(outcome)


def keep_ways(path: Path, outcome: Outcome) -> None:
    """Write the ways of a run, and the outlines that were estimated in it, for its pictures."""
    path.parent.mkdir(parents=True, exist_ok=True)
    found = outcome.trace.outlines
    arrays: dict[str, Any] = {"ways": np.array(outcome.trace.ways)}
    arrays["outline_times"] = np.array([time for time, _ in found])
    arrays |= {f"outline_{k}": outline for k, (_, outline) in enumerate(found)}
    np.savez_compressed(path, **arrays)


def phase_times(outcome: Outcome) -> Row:
    """[s] that each phase took, by name."""
    phases = outcome.trace.phases.items()
    return {f"{name.replace(' ', '_')}_s": spent for name, spent in phases}


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
