"""A swarm on a map with walls, in the graph: one node for all robots, or one a robot."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from push_job.method import Task
from push_model import se2
from push_model.arrays import Array
from push_model.free_space import FreeSpace
from push_model.occupancy import rasterise
from push_model.settings import from_mapping
from push_model.specs import EnvironmentSpec, ObjectSpec
from push_scenario.bodies import load_object, load_robot
from push_scenario.files import find, read_yaml
from push_scenario.scatter import scattered
from push_study.pool import Row
from push_study.swarm.targets import ROBOT, keep_ways, phase_times
from push_study.team_run import made_scenario, run_team
from push_study.uncertainty import uncertainty

MAPS = {
    "transport_reference": ((-1.0, -1.0), (1.0, 1.0)),
    "transport_middle": ((0.0, -1.0), (0.0, 1.0)),
    "transport_corner": ((-1.0, -1.0), (-1.0, 1.0)),
    "transport_two_corners": ((-1.0, -1.0), (1.0, 1.0)),
}
"""[m] Where the object starts and where it is to go, of Queiroz and MacRae 2024."""
REACHED, TURNED = 0.1, 0.1  # [m], [rad]
_STALLED = 120.0  # [s]


@dataclass(frozen=True)
class MapTask:
    """A run. scenario: name of the map; object: its name; turned: whether headings matter; lost:
    part of the messages between agents of a decentralised swarm, None for one node for all."""

    scenario: str
    seed: int
    out: str
    object: str
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
        return Path(self.out) / "ways" / f"{self.scenario}-{self.object}-{kind}-{self.seed}.npz"


def load_map(name: str) -> EnvironmentSpec:
    """A room of config/environments."""
    path = find("environments", name)
    return from_mapping(EnvironmentSpec, read_yaml(path), str(path))


def drawn(
    name: str, item: ObjectSpec, seed: int, robots: int, turned: bool
) -> tuple[Array, Array, Array]:
    """Poses of the object at the start and at the goal ``(3,)``, whose heading is nan if headings
    do not matter, and of robots at random places ``(robots, 3)``."""
    random = np.random.default_rng([seed, robots])
    (sx, sy), (gx, gy) = MAPS[name]
    start = np.array([sx, sy, random.uniform(-math.pi, math.pi)])
    goal = np.array([gx, gy, random.uniform(-math.pi, math.pi) if turned else math.nan])
    outline = se2.transform(item.mass_pose(start), item.geometry.outline)
    space, radius = FreeSpace(rasterise(load_map(name))), load_robot(ROBOT).footprint_radius
    return start, goal, scattered(random, robots, space, outline, radius)


def run(task: MapTask) -> Row:
    """To the map's goal, with headings at start and goal at random."""
    item, robot, room = load_object(task.object), load_robot(ROBOT), load_map(task.scenario)
    start, goal, begin = drawn(task.scenario, item, task.seed, task.robots, task.turned)
    swarm: dict[str, object] = {
        "position_tolerance": REACHED,
        "orientation_tolerance": TURNED,
        "orientation": task.turned,
        "stalled": _STALLED,
    }
    if task.lost is not None:
        swarm["agents"] = {"decentralised": True, "lost": task.lost, "seed": task.seed}
    scenario = made_scenario(task.scenario, room, robot, begin, item, start, {"swarm": swarm})
    outcome = run_team(
        "swarm",
        scenario,
        Task((goal,)),
        uncertainty(task.uncertainty),
        task.seed,
        task.limit,
        world=task.world,
    )
    keep_ways(task.trace, outcome)
    row: Row = {
        "scenario": task.scenario,
        "seed": task.seed,
        "object": task.object,
        "robots": task.robots,
        "turned": task.turned,
        "success": outcome.success,
        **outcome.row(),
    }
    if outcome.success:
        ways = np.array(outcome.trace.ways)
        row["way_m"] = float(np.hypot(*np.diff(ways[:, 0, :2], axis=0).T).sum())
    return row | phase_times(outcome)
