"""What a controller's tick looks like to a person: figures with units."""

import math

from push_job.report import Figure, Report
from push_mpc.task import Tick

_LEAST = 10.0  # [rad/s] not less is shown, also where not even a straight push is certified
_FAR = 50.0  # [1/m] a margin above this is free motion


def tick_report(tick: Tick, pushing: bool) -> Report:
    """Errors, margins and speed of a tick. pushing: whether an object is pushed."""
    margin = tick.curvature_margin if tick.curvature_margin < _FAR else math.nan
    figures = [
        Figure("error along the way", float(tick.error[0]), "m"),
        Figure("error across the way", float(tick.error[1]), "m"),
        Figure("heading error", float(tick.error[2]), "rad"),
        Figure("speed", tick.v, "m/s"),
        Figure("turn rate", tick.omega, "rad/s"),
        Figure("obstacle margin", tick.obstacle_margin, "m", 0.0),
        Figure("progress", tick.progress),
    ]
    if pushing:
        figures.append(Figure("curvature margin", margin, "1/m", 0.0))
        figures.append(Figure("object aside", tick.object_offset, "m"))
        if not math.isnan(tick.stick_margin):
            figures.append(Figure("stick margin", max(tick.stick_margin, -_LEAST), "rad/s", 0.0))
        if not math.isnan(tick.slip_in):
            figures.append(Figure("slip expected in", tick.slip_in, "s"))
    solve = 0.0 if tick.solve is None else tick.solve.solve_time
    return Report("push" if pushing else "move", tuple(figures), (), solve)
