"""How a swarm fares as it grows: discs that bring the square to a position, eight to a thousand."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from push_model.settings import SettingsError
from push_model.specs import EnvironmentSpec
from push_scenario.bodies import load_object, load_robot
from push_scenario.scatter import around
from push_scenario.scenario import Scenario
from push_study.pool import Row
from push_study.study import StudyOptions
from push_study.summary import by_cell
from push_study.swarm.targets import positions
from push_study.team_run import made_scenario, run_team
from push_study.uncertainty import uncertainty

SCENARIOS = ("swarm_square",)
"""The object."""
OPTIONS = {"uncertainty": "mild", "world": "planar"}
ROBOTS = (8, 20, 50, 100, 200, 500, 1000)
DISTANCE = 1.5  # [m]
REACHED = 0.1  # [m]
_LIMIT = 300.0  # [s]
_LEAST, _SPACE = 2.5, 0.5  # [m] half the width of the room at least; from the discs to its walls


@dataclass(frozen=True)
class ScaleTask:
    """A run. scenario: name of the object; robots: how many discs."""

    scenario: str
    seed: int
    robots: int
    world: str
    uncertainty: str


def tasks(options: StudyOptions) -> list[ScaleTask]:
    """Every number of discs."""
    if options.scenarios != SCENARIOS:
        raise SettingsError(f"swarm-scale supports only the scenario '{SCENARIOS[0]}'")
    world = options.world or "planar"
    return [
        ScaleTask(SCENARIOS[0], options.seed + k, count, world, options.uncertainty)
        for count in ROBOTS
        for k in range(options.trials)
    ]


def scenario_of(task: ScaleTask) -> Scenario:
    """Discs anywhere about the object, in a room with space for all of them."""
    item, disc = load_object(task.scenario), load_robot("disc")
    random = np.random.default_rng([task.seed, task.robots])
    begin = around(random, task.robots, item, disc.footprint_radius)
    half = max(_LEAST, float(np.abs(begin[:, :2]).max()) + _SPACE)
    room = EnvironmentSpec((2.0 * half, 2.0 * half), resolution=0.05)
    swarm = {"position_tolerance": REACHED, "orientation": False, "stalled": _LIMIT}
    return made_scenario(task.scenario, room, disc, begin, item, np.zeros(3), {"swarm": swarm})


def trial(task: ScaleTask) -> Row:
    """To the position."""
    scenario, doubt = scenario_of(task), uncertainty(task.uncertainty)
    ((disc, _), *_) = scenario.robots.values()
    goal = positions([(DISTANCE, 0.0)])
    outcome = run_team("swarm", scenario, goal, doubt, task.seed, _LIMIT, world=task.world)
    row: Row = {
        "scenario": task.scenario,
        "seed": task.seed,
        "robots": task.robots,
        "success": outcome.success,
        **outcome.row(),
    }
    if outcome.success:
        row["lambda"] = outcome.charged * disc.max_speed / DISTANCE
    return row


def statistics(rows: list[Row]) -> dict[str, Any]:
    """Mean Lambda and time by number of robots."""
    return dict(by_cell(rows, ("robots",), ("lambda", "charged_s")))


def conclude(options: StudyOptions, tasks: Sequence[ScaleTask], rows: list[Row]) -> None:
    """Lambda by the number of discs."""
    print("\nrobots   reached    time [s]        Lambda")
    means = []
    for count in ROBOTS:
        mine = [r for r in rows if r.get("robots") == count]
        good = [r for r in mine if r["success"]]
        if good:
            times, units = ([r[k] for r in good] for k in ("charged_s", "lambda"))
            told = f"{np.mean(times):6.1f} +- {np.std(times):4.1f}  {np.mean(units):6.2f}"
            means.append((count, float(np.mean(units))))
        else:
            told = ""
        if mine:
            print(f"{count:6d}   {len(good):2d} of {len(mine):<2d}  {told}")
    figure, ax = plt.subplots(figsize=(5, 3))
    if means:
        ax.semilogx(*np.array(means).T, "o-")
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel("robots")
    ax.set_ylabel("Lambda")
    figure.tight_layout()
    figure.savefig(options.out / "scale.png", dpi=110)
    plt.close(figure)
