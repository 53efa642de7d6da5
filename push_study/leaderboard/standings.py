"""What the matches amount to: cells with intervals, and ranks among methods that are told the same.

A cell is a method at a contest. Success has Wilson's 95 % interval, Lambda (the charged time over
that of a robot at full speed on the straight line) Student's over the matches that succeeded. One
cell leads another when its interval of the share of successes lies above the other's. Where these
overlap, it leads when it has as many successes at least, and its Lambda is smaller at the problems
that both solve: the differences, seed by seed, have a mean whose 99 % interval is below zero.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from push_model.arrays import Array
from push_study.leaderboard.entry import Entry
from push_study.pool import Row
from push_study.statistics import mean_interval, wilson

_FEWEST = 5  # values without which no interval is given
_SURE = 0.99  # level of the interval of differences: one of two equal methods leads in 1 of 100

Interval = tuple[float, float]


@dataclass(frozen=True)
class Cell:
    """A method at a contest. lambda_, path, robot_path, cpu: means over what succeeded (cpu: over
    all), nan where nothing did. path: of the object, over the straight line; robot_path: [m] of a
    robot. clearance: [m] least of the object over what succeeded. by_seed: Lambda of what
    succeeded. rank: 0 where it is not ranked, or no other ranked method is told the same. leads:
    names of methods that it leads."""

    contest: str
    entry: Entry
    trials: int
    successes: int
    share: Interval
    lambda_: float
    lambda_interval: Interval
    seconds: float
    path: float
    robot_path: float
    cpu: float
    clearance: float
    by_seed: Mapping[int, float]
    rank: int = 0
    leads: tuple[str, ...] = ()


def cells(rows: Sequence[Row], entries: Mapping[str, Entry], contests: Sequence[str]) -> list[Cell]:
    """Of all rows, with ranks; contests in their order, methods by rank in what they are told.

    entries: by the methods of the rows.
    """
    found = []
    for name in contests:
        here = [_cell(name, k, e, rows) for k, e in entries.items()]
        found += _ranked([c for c in here if c is not None])
    return found


def _cell(contest: str, method: str, entry: Entry, rows: Sequence[Row]) -> Cell | None:
    mine = [r for r in rows if (r["scenario"], r["method"]) == (contest, method)]
    if not mine:
        return None
    good = [r for r in mine if r["success"]]
    values = np.array([r["lambda"] for r in good])
    cpu = [r["cpu_s"] for r in mine if "cpu_s" in r]
    return Cell(
        contest,
        entry,
        len(mine),
        len(good),
        wilson(len(good), len(mine)),
        _mean(values),
        mean_interval(values) if len(values) >= _FEWEST else (math.nan, math.nan),
        _mean(np.array([r["charged_s"] for r in good])),
        _mean(np.array([r["path_ratio"] for r in good])),
        _mean(np.array([r["robot_path_m"] for r in good])),
        _mean(np.array(cpu)),
        min((float(r["clearance_m"]) for r in good), default=math.nan),
        {int(r["seed"]): float(r["lambda"]) for r in good},
    )


def leads(first: Cell, second: Cell) -> bool:
    """Whether one cell is better than another beyond what chance explains."""
    if first.share[0] > second.share[1]:
        return True
    if first.successes * second.trials < second.successes * first.trials:
        return False
    slower = difference(first, second)
    return len(slower) >= _FEWEST and mean_interval(slower, _SURE)[1] < 0.0


def difference(first: Cell, second: Cell) -> Array:
    """``(k,)`` Lambda of one cell minus that of another, at the seeds that both solve."""
    common = sorted(first.by_seed.keys() & second.by_seed.keys())
    return np.array([first.by_seed[s] - second.by_seed[s] for s in common])


def _ranked(here: list[Cell]) -> list[Cell]:
    told = dict.fromkeys(c.entry.told for c in here)
    result = []
    for what in told:
        equal = [c for c in here if c.entry.told == what]
        # No Lambda is the worst Lambda.
        ordered = sorted(equal, key=lambda c: (-c.successes / c.trials, _last(c.lambda_)))
        number, alone = 0, sum(c.entry.ranked for c in ordered) < 2
        for c in ordered:
            number += c.entry.ranked
            if c.entry.ranked and not alone:
                ahead = tuple(o.entry.name for o in ordered if o.entry.ranked and leads(c, o))
                c = replace(c, rank=number, leads=ahead)
            result.append(c)
    return result


def _last(value: float) -> float:
    return math.inf if math.isnan(value) else value


def _mean(values: np.ndarray) -> float:
    return float(values.mean()) if len(values) else math.nan
