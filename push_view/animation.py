"""A run as a moving picture."""

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.collections import PolyCollection

from push_view.bodies import bodies_of
from push_view.contents import BagContents
from push_view.drawing import body_vertices, draw_jobs, draw_map


def write_animation(contents: BagContents, path: Path, frames: int = 90) -> None:
    """Write a GIF of so many frames, evenly spread over the run.

    Raises
    ------
    ValueError: there is no frame of poses.
    """
    if not len(contents.time):
        raise ValueError("a run without poses cannot be animated")
    bodies = bodies_of(contents.scenario)
    figure, axes = plt.subplots(figsize=(6, 4.2))
    draw_map(axes, contents.scenario.grid)
    draw_jobs(axes, bodies, contents.jobs.values())
    shown = {
        color: PolyCollection([], facecolors=color, edgecolors=color, alpha=0.7)
        for color in {t.color for t in bodies.types}
    }
    for collection in shown.values():
        axes.add_collection(collection, autolim=False)
    moments = np.linspace(0, len(contents.time) - 1, frames).astype(int)

    def show(number: int) -> list[Any]:
        moment = int(moments[number])
        for color, outlines in body_vertices(bodies, contents.poses, moment).items():
            shown[color].set_verts(outlines)
        axes.set_title(f"{contents.time[moment]:5.1f} s", fontsize=9)
        return list(shown.values())

    FuncAnimation(figure, show, frames=frames).save(path, writer=PillowWriter(fps=15), dpi=80)
    plt.close(figure)
