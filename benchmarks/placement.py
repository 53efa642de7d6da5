"""Placements for tasks: against a lower bound, far finer grids, and IPOPT from the thesis's start.

The lower bound (``grasp_opt/placement_bound.py``) holds for every placement. The gap to it says by
how much the best known placement could be bettered at most.
"""

import time
from typing import Any

import numpy as np

from benchmarks.measure import at_least, at_most
from grasp_opt.object_trajectory import ObjectTrajectory
from grasp_opt.placement import Placer
from grasp_opt.placement_bound import PlacementBound
from grasp_opt.placement_nlp import LocalPlacer
from push_model.specs import ObjectSpec
from push_scenario.bodies import load_object
from push_study.experiments.grasp_optimisation import (
    GRID,
    REFINED,
    ROBOTS,
    SCENARIOS,
    WORSE,
    local_cost,
    theta0,
    trajectories,
)

RADIUS = 0.05
BOXES, NEAR = 20_000, 0.01  # of the lower bound at most; gap at which it ends


def run() -> dict[str, Any]:
    """Cost relative to the exhaustive grid's best, times, and results of the local method."""
    rows = []
    for shape in SCENARIOS:
        for name, trajectory in trajectories().items():
            for count in ROBOTS:
                rows.append(_compare(shape, name, load_object(shape), trajectory, count))
                r = rows[-1]
                print(
                    f"  {shape:15s} {name:13s} {count} robots: cost {r['cost']:8.4f}, over grid "
                    f"{100 * r['over']:+6.2f} %, {r['seconds']:.2f} s, margin {r['margin']:+.3f}; "
                    f"over the lower bound at most {100 * r['gap']:.1f} %, "
                    f"{r['bound_seconds']:.1f} s; "
                    f"IPOPT {100 * r['local_over']:+9.2f} %, {r['local_seconds']:.2f} s",
                    flush=True,
                )
    over = max(r["over"] for r in rows)
    slow = max(r["seconds"] for r in rows if r["count"] == 3)
    worse = float(np.mean([r["local_over"] > WORSE for r in rows]))
    print(f"  the local method ends in a worse optimum in {100 * worse:.0f} % of {len(rows)} tasks")
    return {
        "rows": rows,
        "bounds": {
            "cost over the exhaustive grid's best": at_most(over, WORSE),
            "3 robots, N = 50 [s]": at_most(slow, 2.0),
            "tasks": at_least(float(len(rows)), 20.0),
        },
    }


def _compare(
    shape: str, name: str, item: ObjectSpec, trajectory: ObjectTrajectory, count: int
) -> dict[str, Any]:
    placer = Placer(item, trajectory, count, RADIUS)
    placer.cost(theta0(placer))
    began = time.thread_time()
    ours = placer.best()
    seconds = time.thread_time() - began
    grid = Placer(item, trajectory, count, RADIUS).best(GRID[count], REFINED)
    local = LocalPlacer(placer)
    began = time.thread_time()
    reached = local_cost(placer, local, theta0(placer))
    local_seconds = time.thread_time() - began
    best = min(grid.cost, ours.cost)
    began = time.thread_time()
    bound = PlacementBound(placer).lower(NEAR, best, BOXES)
    bound_seconds = time.thread_time() - began
    return {
        "shape": shape,
        "task": name,
        "count": count,
        "cost": ours.cost,
        "over": ours.cost / best - 1.0,
        "lower": bound.lower,
        "gap": bound.gap(ours.cost),
        "bound_seconds": bound_seconds,
        "seconds": seconds,
        "margin": ours.margin,
        "theta": placer.outline.angle_of_way(ours.way).tolist(),
        "local_over": reached / best - 1.0,
        "local_seconds": local_seconds,
    }
