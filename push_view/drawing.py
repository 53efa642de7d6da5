"""Pictures of a run with matplotlib: map, bodies, paths, goals; for one body or a thousand."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import ListedColormap
from matplotlib.patches import Circle, Polygon, Rectangle

from push_model import se2
from push_model.arrays import Array
from push_record.contents import BagContents, Job
from push_scenario.scenario import Scenario
from push_view.bodies import Bodies, bodies_of
from push_view.page_data import obstacles_json
from push_view.palette import GOAL, OBSTACLE, robot_colour

_NAMED = 6  # number of bodies up to which each is named in the legend
_WAY_POINTS = 2000  # number of points with which a path is drawn


def draw_map(axes: Axes, scenario: Scenario) -> None:
    """Draw obstacles and walls: the shapes that they are, or the cells of a map; axes in [m]."""
    known = obstacles_json(scenario.environment)
    x0, x1, y0, y1 = scenario.grid.extent
    if known is None:
        axes.imshow(
            np.ma.masked_equal(scenario.grid.occupied, False),
            origin="lower",
            extent=(x0, x1, y0, y1),
            cmap=ListedColormap([OBSTACLE]),
            interpolation="nearest",
        )
    else:
        width, height = known["size"]
        walls = Rectangle((-width / 2, -height / 2), width, height, fill=False)
        walls.set(edgecolor=OBSTACLE, linewidth=2.5)
        axes.add_patch(walls)
        for shape in known["shapes"]:
            points = shape.get("points")
            patch = Circle(shape["centre"], shape["radius"]) if points is None else Polygon(points)
            patch.set(facecolor=OBSTACLE, edgecolor="none")
            axes.add_patch(patch)
    axes.set_xlim(x0, x1)
    axes.set_ylim(y0, y1)
    axes.set_aspect("equal")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")


def draw_body(axes: Axes, outline: Array, pose: Array, color: str, **style: Any) -> Polygon:
    """An outline ``(n, 2)`` [m] at a pose ``(3,)``."""
    patch = Polygon(se2.transform(pose, outline), closed=True, edgecolor=color, **style)
    axes.add_patch(patch)
    return patch


def body_vertices(bodies: Bodies, poses: dict[str, Array], moment: int) -> dict[str, list[Array]]:
    """World outlines ``(n, 2)`` [m] of the bodies seen at one time, by colour."""
    result: dict[str, list[Array]] = {c: [] for c in bodies.colours}
    for name, type_of, colour in zip(bodies.names, bodies.type_of, bodies.colours, strict=True):
        if name in poses and np.isfinite(poses[name][moment]).all():
            outline = bodies.types[type_of].outline
            result[colour].append(se2.transform(poses[name][moment], outline))
    return result


def draw_bodies(axes: Axes, vertices: dict[str, list[Array]], **style: Any) -> None:
    """Outlines by colour, filled."""
    for color, outlines in vertices.items():
        axes.add_collection(
            PolyCollection(outlines, facecolors=color, edgecolors=color, **style), autolim=False
        )


def draw_ways(axes: Axes, bodies: Bodies, poses: dict[str, Array]) -> None:
    """Paths of all bodies; each is named in the legend if they are few, otherwise by kind."""
    few = len(poses) <= _NAMED
    named: set[str] = set()
    for kind in bodies.types:
        members = [n for n, t in zip(bodies.names, bodies.type_of, strict=True) if n in poses]
        members = [n for n in members if bodies.type(n) is kind]
        if few:
            for name in members:
                axes.plot(*poses[name][:, :2].T, color=bodies.colour(name), lw=1.4, label=name)
            continue
        step = max(1, len(next(iter(poses.values()))) * len(poses) // (_WAY_POINTS * 100))
        label = "robots" if kind.robot else "objects"
        axes.add_collection(
            LineCollection(
                [poses[n][::step, :2] for n in members],
                colors=[bodies.colour(n) for n in members],
                linewidths=0.5,
                alpha=0.6,
                label=None if label in named else label,
            ),
            autolim=False,
        )
        named.add(label)


def moments(count: int, bodies: int) -> Array:
    """Indices of the frames in which bodies are drawn; the more bodies, the fewer frames."""
    if count == 0:
        return np.zeros(0, dtype=int)
    snapshots = 7 if bodies <= _NAMED else 2 if bodies <= 50 else 1
    if snapshots == 1:
        return np.array([count - 1])
    return np.unique(np.linspace(0, count - 1, snapshots).astype(int))


def draw_jobs(axes: Axes, bodies: Bodies, jobs: Iterable[Job]) -> None:
    """Plans and goals of some teams; plans lie over the paths of bodies."""
    planned: set[str] = set()
    aimed = False
    for job in jobs:
        for push in job.pushes:
            colour, label = robot_colour(push.number), push.name
            shown = None if label in planned else label
            axes.plot(*push.path.T, color=colour, lw=1.2, ls="--", label=shown, zorder=2.6)
            planned.add(label)
        if job.goal is not None and job.object in bodies.names:
            outline = bodies.type(job.object).outline
            goal = draw_body(axes, outline, job.goal, GOAL, fill=False, lw=1.6)
            goal.set_label("_" if aimed else "goal")
            aimed = True


def draw_trajectory(axes: Axes, contents: BagContents, jobs: Iterable[Job] | None = None) -> None:
    """Map, plans and goals of teams, paths of all bodies, and the bodies at a few times."""
    bodies = bodies_of(contents.scenario)
    draw_map(axes, contents.scenario)
    draw_jobs(axes, bodies, contents.jobs.values() if jobs is None else jobs)
    draw_ways(axes, bodies, contents.poses)
    alpha = 0.35 if len(contents.poses) <= _NAMED else 0.6
    for moment in moments(len(contents.time), len(contents.poses)):
        vertices = body_vertices(bodies, contents.poses, int(moment))
        draw_bodies(axes, vertices, alpha=alpha, linewidths=0.8)
    if axes.get_legend_handles_labels()[0]:  # below the map, so that it covers nothing
        below = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.11), "frameon": False}
        axes.legend(**below, fontsize=7, ncols=5)
