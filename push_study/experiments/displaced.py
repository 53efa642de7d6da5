"""Somebody moves the box in mid-push: what the supervisor makes of it, in the nine scenarios."""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from push_model.arrays import Array
from push_ros.claims import own_domain
from push_scenario.events import Displace
from push_scenario.footing import Footing
from push_scenario.scenario import Scenario, load_scenario
from push_study.experiments.single_robot import SCENARIOS as NINE
from push_study.graph_run import LockstepRun
from push_study.job import check_goal, digest, run_job
from push_study.pool import Row
from push_study.study import StudyOptions
from push_study.uncertainty import uncertainty
from push_supervisor.state import State

SCENARIOS = NINE
"""Where none are named."""
OPTIONS = {"uncertainty": "mild"}

FAR, TURN = 0.04, 0.12
"""[m], [rad] by which the box is moved at most."""
POSITION, ORIENTATION = 0.01, 0.05
"""[m], [rad] within which a trial succeeds."""
_WHEN = (7.0, 18.0)  # [s] of sim time from which on; a push is under way from about 3 s on
_TRIES = 10_000  # draws of a move
_PATIENCE = 300.0  # [s] of sim time


@dataclass(frozen=True)
class DisplacedTask:
    """One trial. digest: of the scenario's text."""

    scenario: str
    seed: int
    out: str
    uncertainty: str = "mild"
    digest: str = ""


def tasks(options: StudyOptions) -> list[DisplacedTask]:
    """Every scenario, as often as there are trials."""
    made = []
    for name in options.scenarios:
        scenario = load_scenario(name)
        check_goal(scenario)
        text = digest(scenario)
        made += [
            DisplacedTask(name, seed, str(options.out), options.uncertainty, text)
            for seed in range(options.seed, options.seed + options.trials)
        ]
    return made


class Hand:
    """Moves the object once, while it is pushed; to where nothing else is, and on a free way.

    moved: what it set about to do, None as long as it has done nothing. The world moves it at its
    next tick, as far as nothing is in the way then.
    """

    def __init__(self, scenario: Scenario, seed: int) -> None:
        self.item = scenario.object()[0]
        self.moved: Displace | None = None
        self._footing = Footing(scenario)
        self._random = np.random.default_rng([seed, zlib.crc32(scenario.name.encode()), 7])
        self._at = float(self._random.uniform(*_WHEN))

    def __call__(self, run: LockstepRun) -> None:
        """Wait for the moment, and move it."""

        def due() -> bool:
            pushing = run.supervisor.machine.state is State.PUSHING
            return run.bridge.time >= self._at and pushing

        team = next(iter(run.teams.values()))
        run.spin_until(lambda: due() or team.ended, _PATIENCE)
        if due():
            by = self.draw(run.bridge.world.poses())
            self.moved = Displace(at=run.bridge.time, body=self.item, by=by)
            run.bridge.disturb(self.moved)

    def draw(self, poses: Mapping[str, Array]) -> tuple[float, float, float]:
        """dx, dy, dtheta [m, m, rad], evenly over those that poses ``(3,)`` of all bodies leave.

        Raises
        ------
        RuntimeError: they leave hardly any.
        """
        for _ in range(_TRIES):
            angle, far = self._random.uniform(-np.pi, np.pi), FAR * np.sqrt(self._random.uniform())
            turn = self._random.uniform(-TURN, TURN)
            by = np.array([far * np.cos(angle), far * np.sin(angle), turn])
            if self._footing.along(self.item, by, poses)[1] is None:
                return float(by[0]), float(by[1]), float(by[2])
        raise RuntimeError(f"there is no free pose to which '{self.item}' can be moved")


def trial(task: DisplacedTask) -> Row:
    """Push the object to the goal, and move it on the way."""
    with own_domain():
        scenario = load_scenario(task.scenario)
        believed, world, drawn = uncertainty(task.uncertainty).draw(scenario, task.seed)
        hand = Hand(world, task.seed)
        measures, _ = run_job(believed, world, meanwhile=hand)
    close = measures["position_error_m"] <= POSITION
    close &= measures["orientation_error_rad"] <= ORIENTATION
    row = {"scenario": task.scenario, "seed": task.seed, **measures, **drawn}
    if hand.moved is None:
        return row | {"success": False, "reason": f"not moved; {measures['reason']}"}
    return row | {
        "success": bool(measures["success"] and close),
        "displaced_m": float(np.hypot(*hand.moved.by[:2])),
        "displaced_rad": abs(float(hand.moved.by[2])),
        "displaced_at_s": hand.moved.at,
    }


def statistics(rows: list[Row]) -> dict[str, Any]:
    """Medians of the errors over all trials, and how many new plans and collisions there were."""
    done = [r for r in rows if "position_error_m" in r]
    if not done:
        return {}
    return {
        "position_median_m": float(np.median([r["position_error_m"] for r in done])),
        "orientation_median_rad": float(np.median([r["orientation_error_rad"] for r in done])),
        "new_plans": sum(int(r["replans"]) for r in done),
        "collision_ticks": sum(int(r["collisions"]) for r in done),
    }


def conclude(options: StudyOptions, tasks: Sequence[DisplacedTask], rows: list[Row]) -> None:
    """How many end where they should, and what it cost."""
    wins = sum(bool(r["success"]) for r in rows)
    print(f"\n{wins} of {len(rows)} within {1e3 * POSITION:.0f} mm and {ORIENTATION:g} rad")
    if found := statistics(rows):
        done = [r for r in rows if "position_error_m" in r]
        p, o = (max(r[k] for r in done) for k in ("position_error_m", "orientation_error_rad"))
        print(
            f"position {1e3 * found['position_median_m']:.2f} mm median, {1e3 * p:.2f} most; "
            f"orientation {found['orientation_median_rad']:.4f} rad median, {o:.4f} most; "
            f"{found['new_plans']} new plans, {found['collision_ticks']} collisions"
        )
