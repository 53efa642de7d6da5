"""What all trials of an experiment amount to."""

from typing import Any

import numpy as np

from push_study.pool import Row


def aggregate(rows: list[Row]) -> dict[str, Any]:
    """Success as a fraction; mean, standard deviation and maximum of every measure."""
    result: dict[str, Any] = {
        "trials": len(rows),
        "success": sum(bool(r["success"]) for r in rows) / len(rows) if rows else 0.0,
    }
    names = [
        k
        for r in rows
        for k, v in r.items()
        if isinstance(v, (int, float)) and not isinstance(v, bool) and k != "seed"
    ]
    for name in dict.fromkeys(names):
        values = np.array([r[name] for r in rows if name in r], dtype=np.float64)
        result[name] = {
            "mean": float(values.mean()),
            "std": float(values.std()),
            "max": float(values.max()),
        }
    return result
