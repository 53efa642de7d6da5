"""What all trials of an experiment amount to."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from push_study.pool import Row


def aggregate(rows: list[Row], statistics: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Success as a fraction; mean, standard deviation and maximum of every measure; statistics.

    A measure that is not finite in a row is left out of its mean; one that is nowhere finite is
    None. A trial that crashed counts as a failure and has no measures. statistics: further values
    by name, e.g. ``ranksum_p``; they may be nested.

    Raises
    ------
    ValueError: a statistic has the name of a measure.
    """
    result: dict[str, Any] = {
        "trials": len(rows),
        "success": sum(bool(r["success"]) for r in rows) / len(rows) if rows else 0.0,
    }
    measured = [r for r in rows if not r.get("crashed")]
    names = [
        k
        for r in measured
        for k, v in r.items()
        if isinstance(v, (int, float)) and not isinstance(v, bool) and k != "seed"
    ]
    for name in dict.fromkeys(names):
        values = np.array([r[name] for r in measured if name in r], dtype=np.float64)
        values = values[np.isfinite(values)]
        result[name] = None
        if values.size:
            result[name] = {
                "mean": float(values.mean()),
                "std": float(values.std()),
                "max": float(values.max()),
            }
    for name, value in (statistics or {}).items():
        if name in result:
            raise ValueError(f"'{name}' is a measure of the trials already")
        result[name] = known(value)
    return result


def known(value: Any) -> Any:
    """A value for JSON, which has no numbers that are not finite: None stands for them."""
    if isinstance(value, Mapping):
        return {str(k): known(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [known(v) for v in value]
    if isinstance(value, np.ndarray):
        return known(value.tolist())
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, np.integer):
        return int(value)
    return value


def by_cell(
    rows: list[Row], columns: tuple[str, ...], measures: tuple[str, ...]
) -> dict[str, float | int]:
    """Of the rows that are alike in some columns: how many there are, how many succeeded, and the
    mean of each measure over those that did.

    Names end with the values of the columns, e.g. ``lambda_swarm_square_8``.
    """
    cells: dict[str, list[Row]] = {}
    for row in rows:
        if all(c in row for c in columns):
            cells.setdefault("_".join(str(row[c]) for c in columns), []).append(row)
    result: dict[str, float | int] = {}
    for cell, mine in cells.items():
        good = [r for r in mine if r["success"]]
        result[f"trials_{cell}"], result[f"successes_{cell}"] = len(mine), len(good)
        for measure in measures:
            values = [r[measure] for r in good if measure in r]
            if values:
                result[f"{measure}_{cell}"] = float(np.mean(values))
    return result
