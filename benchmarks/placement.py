"""Placements for tasks: against far finer grids, and against IPOPT from the thesis's start."""

import math
import time
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.measure import at_least, at_most
from grasp_opt.object_trajectory import ObjectTrajectory, polynomial, study_trajectories
from grasp_opt.placement import Placer
from grasp_opt.placement_nlp import LocalPlacer
from push_model.shape_specs import PolygonShape, RectangleShape
from push_model.specs import ObjectSpec
from push_scenario.bodies import load_object

RADIUS = 0.05
FINE = {2: 200, 3: 66}  # points of the exhaustive grid, by the number of robots
_KEPT = 40  # of its placements that are refined


def objects() -> dict[str, ObjectSpec]:
    """Ellipse, octagon, rectangle, as plates of chapter 3."""
    plate = load_object("plate_ellipse")
    corners = [(0.22 * math.cos(a), 0.22 * math.sin(a)) for a in np.arange(8) * math.pi / 4.0]
    return {
        "ellipse": plate,
        "octagon": replace(plate, shape=PolygonShape(tuple(corners))),
        "rectangle": replace(plate, shape=RectangleShape(0.4, 0.3)),
    }


def trajectories() -> dict[str, ObjectTrajectory]:
    """Four tasks: two that turn, one that sways, one that turns back."""
    six = study_trajectories()
    names = ("polynomial-1", "polynomial-3", "sinusoid-2")
    return {n: six[n] for n in names} | {"bend": polynomial((0.5, -0.2), 0.8, 0.1, 0.1)}


def start(placer: Placer) -> np.ndarray:
    """The thesis's Theta_0, about the direction of these tasks: evenly behind, 45 degrees apart."""
    spread = np.arange(placer.count) - 0.5 * (placer.count - 1)
    return np.array(placer.outline.way_of_angle(math.pi + spread * math.pi / 4.0))


def run() -> dict[str, Any]:
    """Cost over the exhaustive grid's best, times, and where the local method ends."""
    rows = []
    for shape, item in objects().items():
        for name, trajectory in trajectories().items():
            for count in (2, 3):
                rows.append(_compare(shape, name, item, trajectory, count))
                r = rows[-1]
                print(
                    f"  {shape:9s} {name:13s} {count} robots: cost {r['cost']:8.4f}, over the grid "
                    f"{100 * r['over']:+6.2f} %, {r['seconds']:.2f} s, margin {r['margin']:+.3f}; "
                    f"IPOPT {100 * r['local_over']:+9.2f} %, {r['local_seconds']:.2f} s"
                    + ("" if r["local_solved"] else ", not solved"),
                    flush=True,
                )
    over = max(r["over"] for r in rows)
    slow = max(r["seconds"] for r in rows if r["count"] == 3)
    worse = float(np.mean([r["local_over"] > 0.01 for r in rows]))
    print(f"  the local method ends in a worse optimum in {100 * worse:.0f} % of {len(rows)} tasks")
    return {
        "rows": rows,
        "bounds": {
            "cost over the exhaustive grid's best": at_most(over, 0.01),
            "3 robots, N = 50 [s]": at_most(slow, 2.0),
            "tasks": at_least(float(len(rows)), 20.0),
        },
    }


def _compare(
    shape: str, name: str, item: ObjectSpec, trajectory: ObjectTrajectory, count: int
) -> dict[str, Any]:
    placer = Placer(item, trajectory, count, RADIUS)
    placer.cost(start(placer))
    began = time.thread_time()
    ours = placer.best()
    seconds = time.thread_time() - began
    grid = Placer(item, trajectory, count, RADIUS).best(FINE[count], _KEPT)
    local = LocalPlacer(placer)
    began = time.thread_time()
    answer = local.solve(start(placer))
    local_seconds = time.thread_time() - began
    reached = placer.cost(answer.way) if answer.solved else math.inf
    if placer.outline.from_corner(answer.way).min() < placer.settings.corner - 1e-3:
        reached = math.inf  # at a corner, where nothing can push
    best = min(grid.cost, ours.cost)
    return {
        "shape": shape,
        "task": name,
        "count": count,
        "cost": ours.cost,
        "over": ours.cost / best - 1.0,
        "seconds": seconds,
        "margin": ours.margin,
        "theta": placer.outline.angle_of_way(ours.way).tolist(),
        "local_over": reached / best - 1.0,
        "local_solved": answer.solved,
        "local_seconds": local_seconds,
    }
