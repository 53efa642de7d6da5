"""Studies whose trials are a scenario and a seed, and whose measures are compared by scenario."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from push_model.arrays import Array
from push_model.settings import SettingsError
from push_study.pool import Row
from push_study.statistics import mean_interval, wilson
from push_study.study import StudyOptions


@dataclass(frozen=True)
class Episode:
    """scenario: parts of a name, joined by hyphens."""

    scenario: str
    seed: int


def episodes(options: StudyOptions, known: Sequence[str]) -> list[Episode]:
    """As many of each scenario; raises SettingsError for one that is not known."""
    for name in options.scenarios:
        if name not in known:
            raise SettingsError(f"no scenario called '{name}'; expected one of: {', '.join(known)}")
    return [
        Episode(name, options.seed + k) for k in range(options.trials) for name in options.scenarios
    ]


def scenarios(*parts: Iterable[str]) -> tuple[str, ...]:
    """Their names: each of the first part with each of the second one, and so on."""
    names = [""]
    for part in parts:
        names = [f"{name}-{more}" if name else more for name in names for more in part]
    return tuple(names)


def statistics(
    rows: list[Row], measures: Sequence[str], of_successes: Collection[str] = ()
) -> dict[str, Any]:
    """Interval of the share of episodes that succeed, and of the means of measures. of_successes:
    measures that are taken of these episodes only."""
    found: dict[str, Any] = {}
    for name in dict.fromkeys(str(r["scenario"]) for r in rows):
        mine, count = finished(rows, name), sum(r["scenario"] == name for r in rows)
        found[f"wilson_{name}"] = wilson(sum(bool(r["success"]) for r in mine), count)
        for measure in measures:
            found[f"{measure}_{name}"] = mean_interval(_values(mine, measure, of_successes))
    return found


def finished(rows: list[Row], name: str) -> list[Row]:
    """Episodes of a scenario that did not crash: those that have measures."""
    return [r for r in rows if r["scenario"] == name and not r.get("crashed")]


def _values(rows: list[Row], measure: str, of_successes: Collection[str]) -> Array:
    rows = [r for r in rows if r["success"] or measure not in of_successes]
    return np.array([float(r[measure]) for r in rows])


def report(
    options: StudyOptions,
    rows: list[Row],
    done: str,
    measures: Sequence[str],
    of_successes: Collection[str] = (),
) -> None:
    """A line for each scenario. done: what an episode is that succeeds, in a word."""
    for name in options.scenarios:
        mine, count = finished(rows, name), sum(r["scenario"] == name for r in rows)
        good = sum(bool(r["success"]) for r in mine)
        if not mine:
            continue
        low, high = wilson(good, count)
        print(f"\n{name}: {done} {good} of {count} ({low:.2f} to {high:.2f})")
        for measure in measures:
            values = _values(mine, measure, of_successes)
            if len(values):
                ends = f"least {values.min():.2f}, most {values.max():.2f}"
                print(f"{measure}: mean {values.mean():.2f}, {ends}")
