"""Lower bounds on single runs, and where bodies can stand: what bounds of plans are made of."""

import math
from typing import Any

import numba

from push_model.distance_field import lookup, points_clearance
from push_planner.dubins_bound import least_length


@numba.njit(cache=True)
def wrapped(angle: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@numba.njit(cache=True)
def run_time(length: float, turn: float, speeds: Any) -> float:
    """Lower bound [s] of the time of a run that is at least so long [m] and turns so much [rad].

    speeds: [s/m] of a straight push; [m] half the track; [m/s] of a wheel. On a bend the outer
    wheel is the faster one: it drives half the track times the turn farther than the middle.
    """
    pace, half, top = speeds
    return float(max(pace * length, (length + half * turn) / top))


@numba.njit(cache=True)
def stands(
    points: Any, radius: float, x: float, y: float, theta: float, least: float,
    field: Any, ox: float, oy: float, scale: float,
) -> bool:  # fmt: skip
    """Whether a body has the clearance ``least`` [m] at a pose."""
    if least <= 0.0 or lookup(field, x, y, ox, oy, scale) - radius >= least:
        return True
    return bool(points_clearance(field, points, x, y, theta, ox, oy, scale) >= least)


@numba.njit(cache=True)
def part_of_run(
    x: float, y: float, theta: float, bx: float, by: float, angle: float, radii: Any, way: float,
    off: float, slack: float,
) -> tuple[float, float]:  # fmt: skip
    """Least length [m] and turn [rad] of a run from (x, y, theta) to about (bx, by, angle).

    radii: [m] smallest turning radii to the left and to the right. way: [m] it is at least so long.
    off, slack: [m], [rad] how far the last pose may be from (bx, by, angle).
    """
    length = run_length(x, y, theta, bx, by, angle, radii, off, slack)
    return max(length, way), max(0.0, abs(wrapped(angle - theta)) - slack)


@numba.njit(cache=True)
def run_length(
    x: float, y: float, theta: float, bx: float, by: float, angle: float, radii: Any,
    off: float, slack: float,
) -> float:  # fmt: skip
    """``least_length`` from the pose (x, y, theta) to about the pose (bx, by, angle)."""
    c, s = math.cos(theta), math.sin(theta)
    dx, dy = bx - x, by - y
    return float(
        least_length(
            c * dx + s * dy, c * dy - s * dx, angle - theta, radii[0], radii[1], off, slack
        )
    )
