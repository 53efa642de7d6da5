"""Any method in an open room to one position, in the graph: ours and the rivals alike."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from push_model import se2
from push_model.free_space import FreeSpace
from push_model.occupancy import rasterise
from push_model.specs import EnvironmentSpec
from push_scenario.bodies import load_object, load_robot
from push_scenario.scatter import scattered
from push_study.pool import Row
from push_study.swarm.targets import ROBOT, keep_ways, positions
from push_study.team_run import made_scenario, run_team
from push_study.uncertainty import uncertainty

RIVALS = ("global-input", "occlusion", "gibbs")
OURS = ("crescent", "thesis")
ROBOTS_OF = {"global-input": "disc"}
"""Robots of methods for such as go in any direction; others have e-pucks, as large and fast."""
SIZE, START, TARGET = 3.0, (-0.7, -0.7), (0.7, 0.7)  # [m]
REACHED = 0.1  # [m]


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
    ours = task.method in OURS
    system = "swarm" if ours else task.method
    parameters: dict[str, object] = {
        "position_tolerance": REACHED,
        "orientation": False,
        "stalled": task.limit,
    }
    if ours:
        parameters["law"] = {"law": task.method}
    else:
        parameters["seed"] = task.seed
    scenario = made_scenario(task.scenario, room, robot, begin, item, start, {system: parameters})
    outcome = run_team(
        system,
        scenario,
        positions([TARGET]),
        uncertainty(task.uncertainty),
        task.seed,
        task.limit,
        world=task.world,
    )
    keep_ways(task.trace, outcome)
    ways = np.array(outcome.trace.ways)
    row: Row = {
        "scenario": task.scenario,
        "seed": task.seed,
        "method": task.method,
        "robots": task.robots,
        "success": outcome.success,
        **outcome.row(),
        "nearest_m": float(np.hypot(*(ways[:, 0, :2] - TARGET).T).min()),
    }
    if outcome.success:
        straight = math.hypot(TARGET[0] - START[0], TARGET[1] - START[1])
        row["lambda"] = outcome.charged * speed / straight
    return row
