"""From a bag to pictures: trajectory over the map, errors and margins over time, an animation."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import yaml
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from push_model import se2
from push_model.arrays import Array
from push_record.bag import read_bag, read_metadata
from push_ros.validation import planar_pose
from push_scenario.scenario import Scenario, scenario_from_mapping

_ROBOT, _OBJECT, _PLAN, _GOAL, _INK = "#2a62c9", "#d0751c", "#777777", "#c22f3d", "#222222"

PRODUCTS = ("trajectory.png", "animation.gif", "report.pdf")
"""Files that a report consists of."""


@dataclass
class BagContents:
    """Time series of a bag. time [s]; poses ``(n, 3)``; status rows, see ``STATUS``."""

    scenario: Scenario
    metadata: dict[str, str]
    time: Array = field(default_factory=lambda: np.zeros(0))
    poses: dict[str, Array] = field(default_factory=dict)
    status: Array = field(default_factory=lambda: np.zeros((0, 8)))
    states: list[tuple[float, str, str]] = field(default_factory=list)
    plan: list[Array] = field(default_factory=list)
    goal: Array | None = None
    collisions: int = 0


STATUS = (
    "time",
    "error_x",
    "error_y",
    "error_theta",
    "solve_time",
    "curvature_margin",
    "obstacle_margin",
    "object_offset_y",
)


def _seconds(stamp: Any) -> float:
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def load(bag: Path) -> BagContents:
    """Read what the report needs."""
    metadata = read_metadata(bag)
    if "scenario" not in metadata:
        raise ValueError(f"{bag}: no scenario in it; was it recorded by planar-push?")
    name = metadata.get("scenario_name", "scenario")
    scenario = scenario_from_mapping(yaml.safe_load(metadata["scenario"]), name, str(bag))
    contents = BagContents(scenario, metadata)
    bodies = set(scenario.robots) | set(scenario.objects)
    times: list[float] = []
    poses: dict[str, list[Array]] = {}
    status: list[list[float]] = []
    wanted = {
        "/ground_truth/poses",
        "/job_state",
        "/push_plan",
        "/contacts",
    }
    status_topics = {f"/{robot}/controller/status" for robot in scenario.robots}
    for record in read_bag(bag, wanted | status_topics):
        m = record.message
        if record.topic == "/ground_truth/poses":
            times.append(_seconds(m.header.stamp))
            for name, *pose in zip(m.names, m.x, m.y, m.theta, strict=True):
                poses.setdefault(name, []).append(np.array(pose))
        elif record.topic in status_topics:
            if m.mode in (1, 2):
                status.append([_seconds(m.header.stamp)] + [getattr(m, k) for k in STATUS[1:]])
        elif record.topic == "/job_state":
            contents.states.append((_seconds(m.header.stamp), m.state_name, m.reason))
            if m.goal.header.frame_id:
                contents.goal = planar_pose(m.goal.pose)
        elif record.topic == "/push_plan":
            contents.plan = [np.column_stack([s.trajectory.x, s.trajectory.y]) for s in m.segments]
        else:
            contents.collisions += sum(
                1
                for pair in map(set, zip(m.body_a, m.body_b, strict=True))
                if pair & bodies and not pair <= bodies
            )
    count = min([len(times), *(len(p) for p in poses.values())]) if poses else 0
    contents.time = np.array(times[:count])
    contents.poses = {k: np.array(v[:count]) for k, v in poses.items()}
    contents.status = np.array(status).reshape(-1, len(STATUS))
    if contents.goal is None:
        contents.goal = scenario.goal
    return contents


def draw_map(axes: Axes, scenario: Scenario) -> None:
    """Draw the occupancy grid, axes in [m]."""
    grid = scenario.grid
    axes.imshow(
        np.where(grid.occupied, 0.25, 1.0),
        origin="lower",
        extent=grid.extent,
        cmap="gray",
        vmin=0.0,
        vmax=1.0,
        interpolation="nearest",
    )
    axes.set_aspect("equal")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")


def _body(axes: Axes, outline: Array, pose: Array, color: str, **style: Any) -> Polygon:
    patch = Polygon(se2.transform(pose, outline), closed=True, edgecolor=color, **style)
    axes.add_patch(patch)
    return patch


def outlines_of(scenario: Scenario) -> dict[str, tuple[Array, str]]:
    """Outline ``(n, 2)`` [m] and colour of every body by name."""
    result = {n: (r.outline, _ROBOT) for n, (r, _) in scenario.robots.items()}
    result.update({n: (o.geometry.outline, _OBJECT) for n, (o, _) in scenario.objects.items()})
    return result


def draw_trajectory(axes: Axes, contents: BagContents, snapshots: int = 7) -> None:
    """Map, plan, ways of all bodies, and the bodies at some moments."""
    draw_map(axes, contents.scenario)
    outlines = outlines_of(contents.scenario)
    for number, way in enumerate(contents.plan):
        axes.plot(*way.T, color=_PLAN, lw=1.0, ls="--", label="plan (axle)" if not number else None)
    for name, poses in contents.poses.items():
        outline, color = outlines[name]
        axes.plot(poses[:, 0], poses[:, 1], color=color, lw=1.4, label=name)
        for i in np.linspace(0, len(poses) - 1, snapshots).astype(int):
            _body(axes, outline, poses[i], color, facecolor=color, alpha=0.35, lw=0.8)
    item = next(iter(contents.scenario.objects), None)
    if contents.goal is not None and item is not None:
        _body(axes, outlines[item][0], contents.goal, _GOAL, fill=False, lw=1.6, label="goal")
    axes.legend(loc="upper left", fontsize=7, framealpha=0.9)


def _draw_series(figure: Any, contents: BagContents, grid: Any) -> None:
    s = contents.status
    if not len(s):
        return
    t = s[:, 0]
    panels = [
        ("tracking error [mm]", [(1e3 * s[:, 1], "along"), (1e3 * s[:, 2], "across")]),
        ("heading error [rad]", [(s[:, 3], "heading")]),
        ("curvature margin [1/m]", [(np.where(s[:, 5] < 50, s[:, 5], np.nan), "to the limit")]),
        ("object aside [mm]", [(1e3 * s[:, 7], "y_or")]),
        ("solve [ms CPU]", [(1e3 * s[:, 4], "LTV-MPC")]),
    ]
    for row, (label, lines) in enumerate(panels):
        axes = figure.add_subplot(grid[row])
        for values, name in lines:
            axes.plot(t, values, lw=0.9, label=name)
        axes.set_ylabel(label, fontsize=7)
        axes.tick_params(labelsize=6)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=6, loc="upper right")
        for when, name, _ in contents.states:
            if t[0] <= when <= t[-1]:
                axes.axvline(when, color="#bbbbbb", lw=0.6)
                if row == 0:
                    axes.text(when, axes.get_ylim()[1], name.lower(), fontsize=5, rotation=35)
        if row == len(panels) - 1:
            axes.set_xlabel("sim time [s]", fontsize=7)


def final_error(contents: BagContents) -> tuple[float, float]:
    """Position [m] and orientation [rad] error of the first object at the end."""
    item = next(iter(contents.scenario.objects))
    if contents.goal is None or item not in contents.poses or not len(contents.poses[item]):
        return float("nan"), float("nan")
    local = se2.between(contents.goal, contents.poses[item][-1])
    return float(np.hypot(local[0], local[1])), abs(float(local[2]))


def write_report(bag: Path, out: Path, animate: bool = True) -> dict[str, float]:
    """Write trajectory.png, report.pdf and animation.gif; returns the final errors.

    Raises
    ------
    ValueError: the bag holds no scenario.
    """
    contents = load(bag)
    out.mkdir(parents=True, exist_ok=True)
    position, orientation = final_error(contents)
    figure, axes = plt.subplots(figsize=(9, 6))
    draw_trajectory(axes, contents)
    axes.set_title(
        f"{contents.scenario.name}: {1e3 * position:.1f} mm, {orientation:.3f} rad from the goal",
        color=_INK,
    )
    figure.savefig(out / "trajectory.png", dpi=130, bbox_inches="tight")
    plt.close(figure)
    page = plt.figure(figsize=(8.27, 11.69))
    layout = page.add_gridspec(2, 1, height_ratios=[1.0, 1.35], hspace=0.16)
    draw_trajectory(page.add_subplot(layout[0]), contents)
    _draw_series(page, contents, layout[1].subgridspec(5, 1, hspace=0.25))
    duration = float(contents.time[-1]) if len(contents.time) else 0.0
    page.suptitle(
        f"{contents.scenario.name}   seed {contents.metadata.get('seed', '?')}   revision "
        f"{contents.metadata.get('revision', '?')}\nfinal error {1e3 * position:.1f} mm, "
        f"{orientation:.3f} rad; {duration:.1f} s sim time; wall contacts {contents.collisions}",
        fontsize=10,
    )
    page.savefig(out / "report.pdf")
    plt.close(page)
    if animate and len(contents.time):
        _animate(contents, out / "animation.gif")
    return {"position_error_m": position, "orientation_error_rad": orientation}


def _animate(contents: BagContents, path: Path, frames: int = 90) -> None:
    figure, axes = plt.subplots(figsize=(6, 4.2))
    draw_map(axes, contents.scenario)
    outlines = outlines_of(contents.scenario)
    item = next(iter(contents.scenario.objects))
    if contents.goal is not None:
        _body(axes, outlines[item][0], contents.goal, _GOAL, fill=False, lw=1.4)
    for way in contents.plan:
        axes.plot(*way.T, color=_PLAN, lw=0.8, ls="--")
    patches = {
        name: _body(axes, outline, contents.poses[name][0], color, facecolor=color, alpha=0.7)
        for name, (outline, color) in outlines.items()
        if name in contents.poses
    }
    moments = np.linspace(0, len(contents.time) - 1, frames).astype(int)

    def show(number: int) -> list[Any]:
        i = moments[number]
        for name, patch in patches.items():
            patch.set_xy(se2.transform(contents.poses[name][i], outlines[name][0]))
        axes.set_title(f"{contents.time[i]:5.1f} s", fontsize=9)
        return list(patches.values())

    FuncAnimation(figure, show, frames=frames).save(path, writer=PillowWriter(fps=15), dpi=80)
    plt.close(figure)
