"""Somebody moves the box in mid-push: what the supervisor makes of it, in the nine scenarios."""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from push_model.settings import SettingsError
from push_ros.claims import own_domain
from push_scenario.events import Displace
from push_scenario.scenario import Scenario, load_scenario
from push_study.experiments.single_robot import SCENARIOS as NINE
from push_study.job import digest, run_job
from push_study.pool import Row
from push_study.study import StudyOptions
from push_study.uncertainty import uncertainty

SCENARIOS = NINE
"""Where none are named."""

FAR, TURN = 0.04, 0.12
"""[m], [rad] by which the box is moved at most."""
POSITION, ORIENTATION = 0.01, 0.05
"""[m], [rad] within which a trial succeeds."""
_WHEN = (12.0, 30.0)  # [s] of sim time: the first push lasts from about 8 s on


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
        if scenario.goal is None:
            raise SettingsError(f"scenario '{name}' has no goal")
        text = digest(scenario)
        made += [
            DisplacedTask(name, seed, str(options.out), options.uncertainty, text)
            for seed in range(options.seed, options.seed + options.trials)
        ]
    return made


def disturbance(scenario: Scenario, seed: int) -> Displace:
    """Of a trial: when, where to, how far turned."""
    random = np.random.default_rng([seed, zlib.crc32(scenario.name.encode()), 7])
    angle, far = random.uniform(-np.pi, np.pi), FAR * np.sqrt(random.uniform())
    by = (
        float(far * np.cos(angle)),
        float(far * np.sin(angle)),
        float(random.uniform(-TURN, TURN)),
    )
    return Displace(float(random.uniform(*_WHEN)), scenario.object()[0], by)


def trial(task: DisplacedTask) -> Row:
    """Push the object to the goal, and move it on the way."""
    with own_domain():
        scenario = load_scenario(task.scenario)
        believed, world, drawn = uncertainty(task.uncertainty).draw(scenario, task.seed)
        event = disturbance(scenario, task.seed)
        measures, _ = run_job(believed, replace(world, events=(event,)))
    close = measures["position_error_m"] <= POSITION
    close &= measures["orientation_error_rad"] <= ORIENTATION
    return {
        "scenario": task.scenario,
        "seed": task.seed,
        **measures,
        "success": bool(measures["success"] and close),
        "displaced_m": float(np.hypot(*event.by[:2])),
        "displaced_rad": abs(float(event.by[2])),
        "displaced_at_s": event.at,
        **drawn,
    }


def conclude(options: StudyOptions, tasks: Sequence[DisplacedTask], rows: list[Row]) -> None:
    """How many end where they should, and what it cost."""
    done = [r for r in rows if "position_error_m" in r]
    wins = sum(bool(r["success"]) for r in rows)
    print(f"\n{wins} of {len(rows)} within {1e3 * POSITION:.0f} mm and {ORIENTATION:g} rad")
    if done:
        p = 1e3 * np.array([r["position_error_m"] for r in done])
        o = np.array([r["orientation_error_rad"] for r in done])
        replans, hits = (sum(r[k] for r in done) for k in ("replans", "collisions"))
        print(
            f"position {np.median(p):.2f} mm median, {p.max():.2f} most; orientation "
            f"{np.median(o):.4f} rad median, {o.max():.4f} most; {replans} new plans, "
            f"{hits} collisions"
        )
