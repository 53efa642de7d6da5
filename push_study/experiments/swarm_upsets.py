"""What it costs a swarm when four of ten robots die in mid-run, and when its target is moved.

Ten e-pucks and the square. Deaths: through the six targets of Table 4.1, right, with and without
them, from half the time on that all ten take. A moved target: towards one position, and from half
the way on towards another, beside going to that from the start; times are over the ways that the
object has to go, and over those with the arc that robots have to go round the object where its way
bends: they cannot push on before.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np

from push_model.arrays import Array
from push_model.jobs import JobError
from push_model.specs import EnvironmentSpec
from push_scenario.bodies import load_object, load_robot
from push_scenario.events import Kill
from push_scenario.scatter import around
from push_study.graph_run import LockstepRun
from push_study.pool import Row
from push_study.study import StudyOptions
from push_study.swarm.targets import EXPERIMENT, REACHED, ROBOT, length, positions
from push_study.team_run import made_scenario, run_team
from push_study.uncertainty import uncertainty
from swarm_push.rim import Rim

SCENARIOS = ("swarm_square",)
"""Objects, where none are named."""
OPTIONS = {"uncertainty": "mild", "world": "planar"}
ROBOTS, DEAD = 10, 4
_HALF, _REACH = 2.0, 1.3  # [m] of the room, and of positions
_LEAST = 0.8  # [m] between positions
_LIMIT = 1200.0  # [s]


@dataclass(frozen=True)
class UpsetTask:
    """A trial: four runs. scenario: name of the object."""

    scenario: str
    seed: int
    world: str
    uncertainty: str


def tasks(options: StudyOptions) -> list[UpsetTask]:
    """As many as trials, of every object."""
    for name in options.scenarios:
        load_object(name)
    world = options.world or "planar"
    return [
        UpsetTask(name, options.seed + k, world, options.uncertainty)
        for name in options.scenarios
        for k in range(options.trials)
    ]


class _Run:
    """A swarm that is upset at some time, or by the way."""

    def __init__(self, task: UpsetTask) -> None:
        self._task, self._item, self._robot = task, load_object(task.scenario), load_robot(ROBOT)

    @property
    def beside(self) -> float:
        """[m] from the object's centre to the robots that push it, on average."""
        radius = self._robot.footprint_radius
        return float(np.hypot(*Rim(self._item.geometry.outline, radius, radius).points.T).mean())

    def time(
        self,
        targets: Sequence[tuple[float, float]],
        dead_from: float = math.inf,
        moved_to: tuple[float, float] | None = None,
    ) -> tuple[float, float]:
        """[s] that it takes, infinite where it does not come there; [m] that the object has to go.

        dead_from: [s] from when on four are dead. moved_to: where the one target is put when the
        object is half the way there.
        """
        task, item, robot = self._task, self._item, self._robot
        room = EnvironmentSpec((2.0 * _HALF, 2.0 * _HALF), resolution=0.02)
        random = np.random.default_rng([task.seed, ROBOTS])
        begin = around(random, ROBOTS, item, robot.footprint_radius)
        swarm = {"position_tolerance": REACHED, "orientation": False, "stalled": 300.0}
        scenario = made_scenario(
            task.scenario, room, robot, begin, item, np.zeros(3), {"swarm": swarm}
        )
        way = length(targets)
        done = False

        def meanwhile(run: LockstepRun, now: float, poses: Array) -> None:
            nonlocal done, way
            here = poses[0, :2]
            if not done and now >= dead_from:
                for name in list(scenario.robots)[:DEAD]:
                    run.bridge.disturb(Kill(at=0.0, robot=name))
                done = True
            elif not done and moved_to is not None and _away(here, targets[0]) < 0.5 * way:
                run.supervisor.end_job(JobError.PREEMPTED, "the target was moved")
                run.supervisor.take_task(positions([moved_to]))
                way = float(np.hypot(*here)) + _away(here, moved_to)
                done = True

        outcome = run_team(
            "swarm",
            scenario,
            positions(targets),
            uncertainty(task.uncertainty),
            task.seed,
            _LIMIT,
            meanwhile,
            task.world,
        )
        return (outcome.charged if outcome.success else math.inf), way


def _away(here: Array, there: tuple[float, float]) -> float:
    return math.hypot(here[0] - there[0], here[1] - there[1])


def trial(task: UpsetTask) -> Row:
    """All alive, four dead; straight to a position, and by a detour towards another."""
    runs, random = _Run(task), np.random.default_rng([task.seed, 1])
    alive, _ = runs.time(EXPERIMENT)
    dead, _ = runs.time(EXPERIMENT, dead_from=0.5 * alive)
    first, second = (0.0, 0.0), (0.0, 0.0)
    while min(math.hypot(*first), math.hypot(*second), math.dist(first, second)) < _LEAST:
        x, y, u, v = (float(c) for c in random.uniform(-_REACH, _REACH, 4))
        first, second = (x, y), (u, v)
    direct, straight = runs.time([second])
    moved, way = runs.time([first], moved_to=second)
    done = all(map(math.isfinite, (alive, dead, direct, moved)))
    row: Row = {
        "scenario": task.scenario,
        "seed": task.seed,
        "success": done,
        "reason": "" if done else f"{alive:.0f}, {dead:.0f}, {direct:.0f}, {moved:.0f} s",
    }
    if done:
        bend = math.pi - _angle(first, second)
        row |= {"alive_s": alive, "dead_s": dead, "dead_over_alive": dead / alive}
        row |= {"direct_s_per_m": direct / straight, "moved_s_per_m": moved / way}
        arc = bend * runs.beside
        row |= {"moved_over_direct": (moved / way) / (direct / straight), "bend_rad": bend}
        row |= {"with_the_arc": (moved / (way + arc)) / (direct / straight), "arc_m": arc}
    return row


def _angle(first: tuple[float, float], second: tuple[float, float]) -> float:
    """At half the way to the first position, between where the object came from and the second."""
    half = 0.5 * np.array(first)
    back, on = -half, np.array(second) - half
    cosine = float(back @ on / (np.hypot(*back) * np.hypot(*on)))
    return math.acos(max(-1.0, min(1.0, cosine)))


def statistics(rows: list[Row]) -> dict[str, Any]:
    """Medians of the ratios over the trials that completed all four runs."""
    good = [r for r in rows if r["success"]]
    names = ("dead_over_alive", "moved_over_direct", "with_the_arc")
    return {f"{n}_median": float(np.median([r[n] for r in good])) for n in names if good}


def conclude(options: StudyOptions, tasks: Sequence[UpsetTask], rows: list[Row]) -> None:
    """The ratios, and the price of a moved target by how far its way bends."""
    good = [r for r in rows if r["success"]]
    print(f"\n{len(good)} of {len(rows)} trials completed all four runs")
    if not good:
        return
    for key, told in (
        (
            "dead_over_alive",
            f"time if {DEAD} of {ROBOTS} robots fail half-way, relative to no failure",
        ),
        ("moved_over_direct", "time per metre if the target is moved, relative to a direct run"),
        ("with_the_arc", "the same, with the arc of the robots around the object as path"),
    ):
        values = np.array([r[key] for r in good])
        print(f"{told}: median {np.median(values):.3f}, {values.min():.3f} to {values.max():.3f}")
    direct, moved = (np.mean([r[k] for r in good]) for k in ("direct_s_per_m", "moved_s_per_m"))
    print(f"mean time per metre: {direct:.2f} s direct, {moved:.2f} s with a moved target")
    figure, ax = plt.subplots(figsize=(5, 3))
    ax.plot([r["bend_rad"] for r in good], [r["moved_over_direct"] for r in good], "o")
    ax.axhline(1.0, color="C7", lw=0.7)
    ax.set_xlabel("bend of the way [rad]")
    ax.set_ylabel("time a metre over going there at once")
    figure.tight_layout()
    figure.savefig(options.out / "moved.png", dpi=110)
    plt.close(figure)
