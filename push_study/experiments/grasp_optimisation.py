"""Section 3.2.1: where robots push best along a task, by (3.16)-(3.19), and how sure that is.

Every task's placement is held against an exhaustive grid, against the thesis's start of the
search, and against the local method of the thesis from that start and from random ones. As in
Figure 3.15, the part of the wrench that the task asks for and the contacts cannot make is drawn.
"""

import json
import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from grasp_opt.contact_outline import ContactOutline
from grasp_opt.group_control import distribute
from grasp_opt.object_trajectory import ObjectTrajectory, polynomial, study_trajectories
from grasp_opt.placement import PlacementSettings, Placer
from grasp_opt.placement_nlp import LocalPlacer
from grasp_opt.wrench_cone import task_wrenches
from push_model import se2
from push_model.arrays import Array
from push_model.coulomb import cone_edges
from push_model.grasp import grasp_matrix
from push_model.settings import SettingsError
from push_model.specs import ObjectSpec
from push_scenario.bodies import load_object, load_robot
from push_study.pool import Row
from push_study.study import StudyOptions

SCENARIOS = ("plate_ellipse", "plate_octagon", "plate_rectangle")
"""Objects, where none are named."""
OPTIONS: dict[str, str] = {}
ROBOT, ROBOTS = "epuck_ring", (2, 3)
MODELS = ("limit_surface", "printed")
GRID = {2: 200, 3: 66}
"""Points about the outline of the exhaustive grid, by the number of robots."""
REFINED = 40
"""Of its placements."""
WORSE = 0.01
"""Of the best cost: an optimum dearer than that is another one."""
_MOMENTS = 40  # of a task at which its wrench is looked at
_STARTS = 24  # points about the outline that random starts are drawn from
_CONE = 0.09  # [m] length of a friction cone's edges in drawings


def trajectories() -> dict[str, ObjectTrajectory]:
    """Four tasks: two that turn, one that sways, one that turns back."""
    six = study_trajectories()
    names = ("polynomial-1", "polynomial-3", "sinusoid-2")
    return {n: six[n] for n in names} | {"bend": polynomial((0.5, -0.2), 0.8, 0.1, 0.1)}


def theta0(placer: Placer) -> Array:
    """``(n,)`` [m] the thesis's start, about the direction of these tasks: evenly behind the
    object, 45 degrees apart."""
    spread = np.array([i - 0.5 * (placer.count - 1) for i in range(placer.count)])
    return np.array(placer.outline.way_of_angle(math.pi + spread * math.pi / 4.0))


def local_cost(placer: Placer, local: LocalPlacer, start: Array) -> float:
    """Where the local method ends; infinite where it does not, or at a corner, where nothing can
    push."""
    answer = local.solve(start)
    cornered = placer.outline.from_corner(answer.way).min() < placer.settings.corner - 1e-3
    return math.inf if cornered or not answer.solved else placer.cost(answer.way)


@dataclass(frozen=True)
class OptimisationTask:
    """One optimum. scenario: name of the object; seed: of ``starts`` random starts of the local
    method, besides the thesis's."""

    scenario: str
    seed: int
    out: str
    trajectory: str
    robots: int
    model: str
    starts: int


def tasks(options: StudyOptions) -> list[OptimisationTask]:
    """Every object along every trajectory, with every number of robots, by both models."""
    for name in options.scenarios:
        if not load_object(name).geometry.convex:
            raise SettingsError(f"'{name}' is not convex: groups push convex objects")
    return [
        OptimisationTask(
            name, options.seed, str(options.out), trajectory, count, model, options.trials
        )
        for name in options.scenarios
        for trajectory in trajectories()
        for count in ROBOTS
        for model in MODELS
    ]


def placer_of(task: OptimisationTask) -> Placer:
    """The search of a task."""
    settings = PlacementSettings(model=task.model)  # type: ignore[arg-type]
    item, robot = load_object(task.scenario), load_robot(ROBOT)
    path = trajectories()[task.trajectory]
    return Placer(item, path, task.robots, robot.footprint_radius, settings)


def trial(task: OptimisationTask) -> Row:
    """Search, and hold the answer against others."""
    placer = placer_of(task)
    found, grid = placer.best(), placer_of(task).best(GRID[task.robots], REFINED)
    best, begin = min(found.cost, grid.cost), np.sort(theta0(placer))
    local = LocalPlacer(placer)
    random = np.random.default_rng(
        [task.seed, zlib.crc32(f"{task.scenario} {task.trajectory} {task.robots}".encode())]
    )
    starts = placer.grid(_STARTS)
    picks = random.choice(len(starts), size=min(task.starts, len(starts)), replace=False)
    ends = np.array([local_cost(placer, local, starts[k]) / best - 1.0 for k in picks])
    places = {"optimised places": found.way.tolist(), "evenly behind": begin.tolist()}
    _places_file(task).parent.mkdir(parents=True, exist_ok=True)
    _places_file(task).write_text(json.dumps(places) + "\n")
    good = bool(found.cost <= (1.0 + WORSE) * grid.cost)
    reached = local_cost(placer, local, begin) / best - 1.0
    row: Row = {
        "scenario": task.scenario,
        "seed": task.seed,
        "trajectory": task.trajectory,
        "robots": task.robots,
        "model": task.model,
        "success": good,
        "reason": "" if good else "an exhaustive grid has a cheaper placement",
        "cost": found.cost,
        "over_grid": found.cost / grid.cost - 1.0,
        "margin": found.margin,
        "theta": " ".join(f"{a:.3f}" for a in placer.outline.angle_of_way(found.way)),
        "theta0_over": placer.cost(begin) / best - 1.0,
        "local_ends": math.isfinite(reached),
        "local_starts": len(ends),
        "local_worse": float(np.mean(ends > WORSE)),
        "lacking": float(lacking(task, found.way)[1].mean()),
        "theta0_lacking": float(lacking(task, begin)[1].mean()),
    }
    return row | ({"local_over": reached} if math.isfinite(reached) else {})


def _places_file(task: OptimisationTask) -> Path:
    name = f"{task.scenario}-{task.trajectory}-{task.robots}-{task.model}.json"
    return Path(task.out) / "places" / name


def lacking(task: OptimisationTask, way: Array) -> tuple[Array, Array]:
    """Moments ``(k,)`` [s] of a task and the parts ``(k,)`` of its wrench then that contacts at
    ways ``(n,)`` cannot make, as of Figure 3.15."""
    item, path = load_object(task.scenario), trajectories()[task.trajectory]
    contacts, surface = ContactOutline(item.geometry).at(way), item.limit_surface()
    length = surface.radius
    moments = np.linspace(0.0, path.duration, _MOMENTS + 2)[1:-1]
    twists = np.array([_into_body(path.twist_at(t), path.sample(t)[2]) for t in moments])
    scale = np.array([1.0, 1.0, length])
    parts = []
    for unit in task_wrenches(twists, surface, length):
        forces = distribute(unit * scale, contacts, item.contact_friction, length)
        made = grasp_matrix(contacts.points) @ forces.ravel()
        parts.append(float(np.linalg.norm(made / scale - unit)))
    return moments, np.array(parts)


def _into_body(twist: Array, heading: float) -> Array:
    """A twist ``(3,)`` along the world's axes in a frame with that heading."""
    return np.append(se2.rotation_matrix(heading).T @ twist[:2], twist[2])


def statistics(rows: list[Row]) -> dict[str, Any]:
    """By model: how near the optimum is to the exhaustive grid's best, and how often the local
    method ends at a higher cost, from the thesis's start and from random ones."""
    found: dict[str, Any] = {}
    for model in MODELS:
        mine = [r for r in rows if r.get("model") == model]
        if mine:
            good = sum(bool(r["success"]) for r in mine)
            found[model] = {"tasks": len(mine), "within": good}
        mine = [r for r in mine if "cost" in r]
        if mine:
            found[model] |= {
                "over_grid_worst": float(max(r["over_grid"] for r in mine)),
                "local_misses": float(
                    np.mean([r.get("local_over", math.inf) > WORSE for r in mine])
                ),
                "local_misses_random": float(np.mean([r["local_worse"] for r in mine])),
                "random_starts": int(mine[0]["local_starts"]),
            }
    return found


def conclude(options: StudyOptions, tasks: Sequence[OptimisationTask], rows: list[Row]) -> None:
    """What the optimum is worth, and how often the local method misses it."""
    print(
        "\nobject           trajectory    robots  model          over the grid [%]  margin   "
        "Theta0 [%]   IPOPT [%]"
    )
    for r in rows:
        if "cost" in r:
            local = f"{100 * r['local_over']:12.1f}" if r["local_ends"] else "  at a corner"
            print(
                f"{r['scenario']:17s}{r['trajectory']:14s}{r['robots']:4d}    {r['model']:15s}"
                f"{100 * r['over_grid']:14.3f} {r['margin']:11.3f} {100 * r['theta0_over']:12.1f}"
                f"{local}"
            )
    for model, mine in statistics(rows).items():
        print(
            f"{model}: {mine['within']} of {mine['tasks']} within {100 * WORSE:g} % of an "
            f"exhaustive grid's best"
        )
        if "over_grid_worst" not in mine:
            continue
        print(
            f"  worst {100 * mine['over_grid_worst']:+.2f} %; the local "
            f"method ends at a higher cost in {100 * mine['local_misses']:.0f} % from the "
            f"thesis's start and in {100 * mine['local_misses_random']:.0f} % from "
            f"{mine['random_starts']} random starts"
        )
    for name in options.scenarios:
        found = [
            t
            for t in tasks
            if (t.scenario, t.model) == (name, MODELS[0]) and _places_file(t).is_file()
        ]
        if found:
            _figure(name, found, options)


def _figure(name: str, tasks: Sequence[OptimisationTask], options: StudyOptions) -> None:
    """Placements with their friction cones, and what the task's wrench lacks with them."""
    figure, axes = plt.subplots(
        2, len(tasks), figsize=(2.6 * len(tasks), 5.4), squeeze=False, sharey="row"
    )
    item, robot = load_object(name), load_robot(ROBOT)
    for task, column in zip(tasks, axes.T, strict=True):
        places = json.loads(_places_file(task).read_text())
        for (label, way), colour in zip(places.items(), ("C0", "C7"), strict=True):
            _draw(column[0], item, np.array(way), robot.footprint_radius, colour)
            column[1].plot(*lacking(task, np.array(way)), colour, label=label)
        column[0].set_title(f"{task.trajectory}, {task.robots} robots", fontsize=8)
        column[0].set_aspect("equal")
        column[1].set_xlabel("t [s]")
    axes[0, 0].set_ylabel("y [m]")
    axes[1, 0].set_ylabel("part of the wrench that lacks")
    axes[1, 0].legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(options.out / f"{name}.png", dpi=100)
    plt.close(figure)


def _draw(axes: Axes, item: ObjectSpec, way: Array, radius: float, colour: str) -> None:
    """An object in its frame, robots at their places, and what they can push with."""
    outline = ContactOutline(item.geometry)
    ring = np.vstack([item.geometry.outline, item.geometry.outline[:1]])
    axes.plot(*ring.T, "k", linewidth=1.0)
    contacts = outline.at(way)
    for point, normal, centre in zip(
        contacts.points, contacts.normals, contacts.centres(radius), strict=True
    ):
        axes.add_patch(Circle((centre[0], centre[1]), radius, fill=False, color=colour))
        for edge in cone_edges(normal, item.contact_friction):
            axes.plot(*np.array([point, point + _CONE * edge]).T, colour, linewidth=0.8)
