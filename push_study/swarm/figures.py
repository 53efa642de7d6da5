"""Figures 4.3 to 4.6: what coverage does, densities, and the field that the printed law goes by."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from push_model.arrays import Array
from push_scenario.bodies import load_object, load_robot
from swarm_push.coverage import Coverage
from swarm_push.crescent import crescent
from swarm_push.density import Density, gaussian
from swarm_push.potential import PotentialSettings, swarm_input
from swarm_push.rim import Rim

_HALF = 0.75  # [m] of the pictures
_STEPS, _GAIN = 200, 0.1  # of Lloyd's control


def draw_figures(out: Path) -> None:
    """``coverage.png`` with Figures 4.3 and 4.4 and our density, ``field.png`` with 4.5 and 4.6."""
    item, radius = load_object("swarm_square"), load_robot("epuck_ring").footprint_radius
    rim = Rim(item.geometry.outline, radius, 1.5 * radius)
    ahead = np.array([0.1, 0.0, 0.0])
    behind = crescent(rim, np.zeros(3), rim.approach(ahead), 0.0, 0.3)
    figure, axes = plt.subplots(1, 3, figsize=(12, 4))
    _coverage(axes[0], gaussian(np.array([0.2, 0.1]), 0.2, 0.1, 0.5))
    _density(axes[1], gaussian(np.array([-0.35, 0.0]), 0.2, 0.1, 0.5 * np.pi), item.outline)
    _density(axes[2], behind, item.outline)
    for ax, title in zip(axes, ("coverage", "(4.2), along y twice", "crescent, to go to the right"),
                         strict=True):  # fmt: skip
        ax.set_title(title, fontsize=9)
    figure.tight_layout()
    figure.savefig(out / "coverage.png", dpi=100)
    plt.close(figure)
    figure, axes = plt.subplots(1, 2, figsize=(10, 5))
    _field(axes[0], 0.25, 2.0)
    _field(axes[1], 0.25, 1.2)
    figure.tight_layout()
    figure.savefig(out / "field.png", dpi=100)
    plt.close(figure)


def _coverage(ax: Axes, density: Density) -> None:
    """Robots on their ways to a centroidal partition, and their cells there."""
    region = _HALF * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    coverage = Coverage(region)
    robots = np.random.default_rng(4).uniform(-_HALF, _HALF, (12, 2))
    ways = [robots]
    for _ in range(_STEPS):
        robots = robots + _GAIN * (coverage.centroids(robots, density) - robots)
        ways.append(robots)
    lines = np.array(ways)
    for cell in coverage.cells(robots):
        ax.plot(*np.vstack([cell, cell[:1]]).T, color="C7", lw=0.5)
    for k in range(lines.shape[1]):
        ax.plot(*lines[:, k].T, color="0.4", lw=0.8)
    ax.plot(*lines[0].T, "o", color="C3", ms=4)
    ax.plot(*lines[-1].T, "o", color="C0", ms=4)
    ax.set_aspect("equal")


def _grid(half: float, count: int) -> tuple[Array, Array, Array]:
    x, y = np.meshgrid(np.linspace(-half, half, count), np.linspace(-half, half, count))
    return x, y, np.column_stack([x.ravel(), y.ravel()])


def _density(ax: Axes, density: Density, outline: Array) -> None:
    x, y, points = _grid(_HALF, 120)
    ax.contourf(x, y, density.at(points).reshape(x.shape), 12, cmap="Blues")
    ax.fill(*outline.T, facecolor="C1", edgecolor="k", alpha=0.6)
    ax.set_aspect("equal")


def _field(ax: Axes, radius: float, reach: float) -> None:
    """(4.6) about an object that is to go to the right, in its zones."""
    s = PotentialSettings()
    half = reach * s.attraction * radius
    x, y, points = _grid(half, 29)
    u = swarm_input(points, np.zeros(2), np.array([1.0, 0.0]), radius, s)
    length = np.maximum(np.hypot(*u.T), 1e-12)[:, None]
    ax.quiver(x, y, *(u / length).T, np.hypot(*u.T), cmap="viridis", scale=32, width=0.003)
    for zone, color in ((1.0, "C1"), (s.repulsion, "C3"), (s.attraction, "C2")):
        ax.add_patch(plt.Circle((0.0, 0.0), zone * radius, fill=False, color=color))
    for sign in (1.0, -1.0):
        angle = sign * s.cone * np.pi
        ax.plot([0.0, half * np.cos(angle)], [0.0, half * np.sin(angle)], "k--", lw=0.7)
        ax.plot(0.0, sign * s.wires * radius, "k.", ms=4)
    ax.set(xlim=(-half, half), ylim=(-half, half), aspect="equal")
    ax.set_xlabel("[m], the object is to go to the right")
