"""Do the reconstructions of other people's methods reach the figures of their own papers?

Each scenario is a setting of a paper as far as its authors published it, in text or code: the Gibbs
random field and occlusion with several numbers of robots in one of our worlds, and the global input
with 100 robots in the simulation of its authors. The figures of occlusion are in a diagram, without
numbers. No other setting could be read (docs/rivals.md).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from push_model.settings import SettingsError
from push_study.pool import Row
from push_study.reproductions import gibbs, global_input, occlusion
from push_study.statistics import wilson
from push_study.study import StudyOptions

GLOBAL = f"global-{global_input.ROBOTS}"
OCCLUSION = {f"occlusion-{count}": count for count in occlusion.ROBOTS}
SCENARIOS = (*gibbs.PUBLISHED, GLOBAL, *OCCLUSION)
OPTIONS = {"uncertainty": "mild", "world": "planar"}  # of all but GLOBAL
_PACES = (
    ("first_motion_mean_s", "pace_mean_m_s", "fastest_m_s"),
    ("published_first_motion_s", "published_pace_m_s", "published_fastest_m_s"),
)


@dataclass(frozen=True)
class PaperTask:
    """A run in the setting of a paper. scenario: of ``SCENARIOS``. limit: [s] of simulation; None
    for that of the setting."""

    scenario: str
    seed: int
    out: str
    world: str
    uncertainty: str
    limit: float | None = None


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
    """To the goal, or until the time is over. What a row tells beyond that, see the setting's
    ``run``."""
    if task.scenario == GLOBAL:
        row = global_input.run(task.seed, task.limit or global_input.LIMIT)
    elif task.scenario in OCCLUSION:
        limit, count = task.limit or occlusion.LIMIT, OCCLUSION[task.scenario]
        row = occlusion.run(count, task.seed, task.world, task.uncertainty, limit)
    else:
        limit, count = task.limit or gibbs.LIMIT, int(task.scenario.split("-")[1])
        row = gibbs.run(count, task.seed, task.world, task.uncertainty, limit)
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
            theirs_too = [t for t in global_input.THEIR_CODE if math.isfinite(t)]
            found[name] |= {
                "published_mean_s": mean,
                "published_std_s": std,
                "time_median_s": float(np.median(times)) if times else math.nan,
                "their_code_reached": len(theirs_too),
                "their_code_of": len(global_input.THEIR_CODE),
                "their_code_median_s": float(np.median(theirs_too)),
                "their_code_mean_s": _mean(theirs_too),
                "their_code_std_s": float(np.std(theirs_too)),
            }
        if name not in gibbs.PUBLISHED:
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
    """For each setting, what is reached here and what was published."""
    print("\nsetting               reached     time [s]  first motion [s]  median, greatest [cm/s]")
    for name, s in statistics(rows).items():
        ours = s["time_mean_s"], s["time_std_s"]
        here, there = _PACES if name in gibbs.PUBLISHED else ((), ())
        print(_line(f"{name}, ours", s["reached"], s["of"], ours, [s[k] for k in here]))
        if "published_mean_s" in s:
            published = s["published_mean_s"], s["published_std_s"]
            print(_line(f"{name}, published", 10, 10, published, [s[k] for k in there]))
            if "their_code_of" in s:
                theirs = s["their_code_mean_s"], s["their_code_std_s"]
                reached, of = s["their_code_reached"], s["their_code_of"]
                print(_line(f"{name}, their code", reached, of, theirs, ()))
        else:
            print(f"{name}, published: in a diagram, without numbers")


def _line(
    label: str, reached: int, of: int, time: tuple[float, float], paces: Sequence[float]
) -> str:
    line = f"{label:21s} {reached:2d} of {of:<2d} {time[0]:5.0f} ± {time[1]:<4.0f}"
    if paces:
        first, median, greatest = paces
        line += f" {first:11.0f} {100 * median:15.2f}, {100 * greatest:.2f}"
    return line
