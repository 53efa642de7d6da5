"""Do the reconstructions of other people's methods reach the figures of their own papers?

Each scenario is a setting of a paper as far as its authors published it, in text or code. Only the
Gibbs random field has a setting and figures that could be read (docs/rivals.md).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from push_job.method import Task
from push_model.arrays import Array
from push_model.bumpers import RingBumper
from push_model.drives import SpeedDrive
from push_model.outlines import distance, inside
from push_model.se2 import transform
from push_model.settings import SettingsError
from push_model.shape_specs import RectangleShape
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from push_scenario.bodies import load_robot
from push_study.pool import Row
from push_study.statistics import wilson
from push_study.study import StudyOptions
from push_study.team_run import made_scenario, run_team
from push_study.uncertainty import uncertainty

PUBLISHED = {
    "gibbs-2": (725, 88),
    "gibbs-4": (446, 92),
    "gibbs-10": (297, 20),
    "gibbs-20": (259, 16),
}
"""[s] mean and standard deviation of ten runs each, all of which reach the goal: computed from the
authors' recordings (rezeck/grf_transport, folder exp_scalability of July 2021)."""
SCENARIOS = tuple(PUBLISHED)
OPTIONS = {"uncertainty": "mild", "world": "planar"}
ROOM, START, GOAL = 4.0, (0.0, 0.55, 0.0), (0.0, -1.15)  # [m]; 1.7 m apart, as in the recordings
_STRIP = (1.05, 1.95)  # [m] of y in which robots start, over the whole width
_APART, _REACHED, _LIMIT = 0.2, 0.1, 900.0  # [m], [m], [s]
_RADIUS, _HALF_TRACK, _WHEEL, _SPEED = 0.037, 0.0323, 0.025, 0.12  # [m], [m], [m], [m/s]
_OBJECT = ObjectSpec(
    RectangleShape(0.5, 0.4), mass=0.2, height=0.1, floor_friction=0.3, contact_friction=0.2
)


@dataclass(frozen=True)
class PaperTask:
    """A run in the setting of a paper. scenario: of ``SCENARIOS``."""

    scenario: str
    seed: int
    out: str
    world: str
    uncertainty: str


def tasks(options: StudyOptions) -> list[PaperTask]:
    """As many of each; raises SettingsError for what is no setting."""
    for name in options.scenarios:
        if name not in PUBLISHED:
            known = ", ".join(PUBLISHED)
            raise SettingsError(f"no setting called '{name}'; expected one of: {known}")
    world = options.world or OPTIONS["world"]
    return [
        PaperTask(name, options.seed + k, str(options.out), world, options.uncertainty)
        for k in range(options.trials)
        for name in options.scenarios
    ]


def hero() -> RobotSpec:
    """Their robot: radius, wheels and greatest speed are theirs, weight and motors an e-puck's."""
    epuck = load_robot("epuck_ring")
    assert isinstance(epuck.drive, SpeedDrive) and isinstance(epuck.bumper, RingBumper)
    drive = replace(
        epuck.drive, wheel_radius=_WHEEL, half_track=_HALF_TRACK, max_wheel_speed=_SPEED / _WHEEL
    )
    bumper = replace(epuck.bumper, radius=_RADIUS)
    return replace(
        epuck, drive=drive, bumper=bumper, body_radius=_RADIUS - 1e-3, mass=0.14, casters=None
    )


def starts(random: np.random.Generator, count: int) -> Array:
    """``(count, 3)`` poses in the strip behind the object, apart from each other."""
    outline = transform(np.array(START), _OBJECT.outline)
    found: list[Array] = []
    half = 0.5 * ROOM - 0.1
    while len(found) < count:
        place = random.uniform([-half, _STRIP[0]], [half, _STRIP[1]])
        clear = not inside(outline, place[None])[0]
        clear &= bool(distance(outline, place[None])[0] > 2.0 * _RADIUS)
        if clear and all(np.hypot(*(place - p)) > _APART for p in found):
            found.append(place)
    return np.column_stack([np.array(found), random.uniform(-math.pi, math.pi, count)])


def trial(task: PaperTask) -> Row:
    """To the goal, or until the time of the recordings is over."""
    count = int(task.scenario.split("-")[1])
    begin = starts(np.random.default_rng([task.seed, count]), count)
    room = EnvironmentSpec((ROOM, ROOM), resolution=0.05)
    settings = {
        "position_tolerance": _REACHED,
        "orientation": False,
        "stalled": _LIMIT,
        "seed": task.seed,
    }
    start = np.array(START)
    scenario = made_scenario(
        task.scenario, room, hero(), begin, _OBJECT, start, {"gibbs": settings}
    )
    outcome = run_team(
        "gibbs",
        scenario,
        Task((np.array([*GOAL, math.nan]),)),
        uncertainty(task.uncertainty),
        task.seed,
        _LIMIT,
        world=task.world,
    )
    row = {"scenario": task.scenario, "seed": task.seed, "success": outcome.success}
    return row | outcome.row()


def statistics(rows: list[Row]) -> dict[str, Any]:
    """Reached, and time of what was reached, beside the published figure."""
    found: dict[str, Any] = {}
    for name, (mean, std) in PUBLISHED.items():
        mine = [r for r in rows if r["scenario"] == name]
        if mine:
            times = [r["duration_s"] for r in mine if r["success"]]
            found[name] = {
                "reached": len(times),
                "of": len(mine),
                "wilson": wilson(len(times), len(mine)),
                "time_mean_s": float(np.mean(times)) if times else math.nan,
                "time_std_s": float(np.std(times)) if times else math.nan,
                "published_mean_s": mean,
                "published_std_s": std,
            }
    return found


def conclude(options: StudyOptions, tasks: Sequence[PaperTask], rows: list[Row]) -> None:
    """A line for each setting."""
    print("\nsetting        reached      time [s]     published [s] (all of ten reached)")
    for name, s in statistics(rows).items():
        print(
            f"{name:12s} {s['reached']:3d} of {s['of']:<3d} {s['time_mean_s']:7.0f} ± "
            f"{s['time_std_s']:<4.0f}   {s['published_mean_s']:5d} ± {s['published_std_s']}"
        )
