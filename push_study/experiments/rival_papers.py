"""Do the reconstructions of other people's methods reach the figures of their own papers?

Each scenario is a setting of a paper as far as its authors published it, in text or code: the Gibbs
random field with 2 to 20 robots in one of our worlds, and the global input with 100 robots in the
simulation of its authors. Other settings and figures could not be read (docs/rivals.md).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from push_model.settings import SettingsError
from push_study.pool import Row
from push_study.reproductions import gibbs, global_input
from push_study.statistics import wilson
from push_study.study import StudyOptions

GLOBAL = f"global-{global_input.ROBOTS}"
SCENARIOS = (*gibbs.PUBLISHED, GLOBAL)
OPTIONS = {"uncertainty": "mild", "world": "planar"}
_PACES = (
    ("first_motion_mean_s", "pace_mean_m_s", "fastest_m_s"),
    ("published_first_motion_s", "published_pace_m_s", "published_fastest_m_s"),
)


@dataclass(frozen=True)
class PaperTask:
    """A run in the setting of a paper. scenario: of ``SCENARIOS``. limit: [s] of simulation."""

    scenario: str
    seed: int
    out: str
    world: str
    uncertainty: str
    limit: float = gibbs.LIMIT


def tasks(options: StudyOptions) -> list[PaperTask]:
    """As many of each.

    Raises
    ------
    SettingsError: for what is no setting, an option that no setting uses, and where something that
        one needs is not installed.
    """
    for name in options.scenarios:
        if name not in SCENARIOS:
            known = ", ".join(SCENARIOS)
            raise SettingsError(f"no setting called '{name}'; expected one of: {known}")
    unused = ", ".join(f"--{name}" for name in sorted(options.asked & OPTIONS.keys()))
    if set(options.scenarios) == {GLOBAL} and unused:
        raise SettingsError(f"{GLOBAL} has a simulation of its own; leave out {unused}")
    if GLOBAL in options.scenarios:
        global_input.ready()
    world = options.world or OPTIONS["world"]
    return [
        PaperTask(name, options.seed + k, str(options.out), world, options.uncertainty)
        for k in range(options.trials)
        for name in options.scenarios
    ]


def trial(task: PaperTask) -> Row:
    """To the goal, or until the time is over. Rows of the Gibbs random field tell more, see its
    ``run``."""
    if task.scenario == GLOBAL:
        row = global_input.run(task.seed, task.limit)
    else:
        count = int(task.scenario.split("-")[1])
        row = gibbs.run(count, task.seed, task.world, task.uncertainty, task.limit)
    return {"scenario": task.scenario, "seed": task.seed, **row}


def statistics(rows: list[Row]) -> dict[str, Any]:
    """Reached, and time of what was reached, beside the published figures."""
    found: dict[str, Any] = {}
    for name in SCENARIOS:
        mine = [r for r in rows if r["scenario"] == name]
        if not mine:
            continue
        times = [r["duration_s"] for r in mine if r["success"]]
        found[name] = {
            "reached": len(times),
            "of": len(mine),
            "wilson": wilson(len(times), len(mine)),
            "time_mean_s": _mean(times),
            "time_std_s": float(np.std(times)) if times else math.nan,
        }
        if name == GLOBAL:
            mean, std = global_input.PUBLISHED
            found[name] |= {"published_mean_s": mean, "published_std_s": std}
            continue
        theirs, moved = gibbs.PUBLISHED[name], [r for r in mine if "pace_m_s" in r]
        found[name] |= {
            "first_motion_mean_s": _mean([r["first_motion_s"] for r in moved]),
            "pace_mean_m_s": _mean([r["pace_m_s"] for r in moved]),
            "fastest_m_s": max((r["fastest_m_s"] for r in moved), default=math.nan),
            "published_mean_s": theirs.mean,
            "published_std_s": theirs.std,
            "published_first_motion_s": theirs.first_motion,
            "published_pace_m_s": theirs.pace,
            "published_fastest_m_s": theirs.fastest,
        }
    return found


def _mean(values: Sequence[float]) -> float:
    return float(np.mean(values)) if len(values) else math.nan


def conclude(options: StudyOptions, tasks: Sequence[PaperTask], rows: list[Row]) -> None:
    """Two lines for each setting: ours, and what was published."""
    print("\nsetting               reached     time [s]  first motion [s]  median, greatest [cm/s]")
    for name, s in statistics(rows).items():
        ours = s["time_mean_s"], s["time_std_s"]
        published = s["published_mean_s"], s["published_std_s"]
        here, there = _PACES if name != GLOBAL else ((), ())
        print(_line(f"{name}, ours", s["reached"], s["of"], ours, [s[k] for k in here]))
        print(_line(f"{name}, published", 10, 10, published, [s[k] for k in there]))


def _line(
    label: str, reached: int, of: int, time: tuple[float, float], paces: Sequence[float]
) -> str:
    line = f"{label:21s} {reached:2d} of {of:<2d} {time[0]:5.0f} ± {time[1]:<4.0f}"
    if paces:
        first, median, greatest = paces
        line += f" {first:11.0f} {100 * median:15.2f}, {100 * greatest:.2f}"
    return line
