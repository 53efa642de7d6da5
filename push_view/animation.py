"""A run as an animation."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from PIL import Image

from push_record.contents import BagContents
from push_view.bodies import bodies_of
from push_view.drawing import body_vertices, draw_jobs, draw_map
from push_view.palette import INK

_RATE = 15.0  # [Hz] pictures


def write_animation(contents: BagContents, path: Path, frames: int = 90) -> None:
    """Write a GIF with frames evenly spread over the run.

    Bodies that do not move are drawn once.

    Raises
    ------
    ValueError: the run has no poses.
    """
    if not len(contents.time):
        raise ValueError("a run without poses cannot be animated")
    bodies = bodies_of(contents.scenario)
    figure = Figure(figsize=(6, 4.2), dpi=80)
    canvas: Any = FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    draw_map(axes, contents.scenario)
    draw_jobs(axes, bodies, contents.jobs.values())
    canvas.draw()
    still = canvas.copy_from_bbox(figure.bbox)
    shown = {
        color: PolyCollection([], facecolors=color, edgecolors=color, alpha=0.7)
        for color in dict.fromkeys(bodies.colours)
    }
    for collection in shown.values():
        axes.add_collection(collection, autolim=False)
    clock = figure.text(0.5, 0.92, "", ha="center", fontsize=9, color=INK)
    pictures = []
    for moment in np.linspace(0, len(contents.time) - 1, frames).astype(int).tolist():
        canvas.restore_region(still)
        for color, outlines in body_vertices(bodies, contents.poses, moment).items():
            shown[color].set_verts(outlines)
            axes.draw_artist(shown[color])
        clock.set_text(f"{contents.time[moment]:5.1f} s")
        figure.draw_artist(clock)
        image = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
        pictures.append(image.quantize(64))
    rest = pictures[1:]
    pictures[0].save(path, save_all=True, append_images=rest, duration=1e3 / _RATE, loop=0)
