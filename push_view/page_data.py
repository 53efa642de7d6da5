"""What the page is sent, as JSON: obstacles, plans, reports. Live and in a playback alike.

Lengths are metres unless a name says otherwise; points of shapes are integers in millimetres.
"""

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from push_job.report import Report
from push_model.arrays import Array
from push_model.occupancy import MapSpec
from push_model.specs import EnvironmentSpec
from push_record.planned import Plan
from push_ros.report_conversions import figure_text
from push_view.palette import layer_colour, robot_colour

_POINTS = 400  # of a path that are sent


def obstacles_json(environment: EnvironmentSpec | MapSpec) -> dict[str, Any] | None:
    """The arena's size, and its obstacles as the shapes that they are, polygons and discs; None if
    there is only a raster."""
    if isinstance(environment, MapSpec):
        return None
    shapes: list[dict[str, Any]] = []
    for box in environment.boxes:
        c, s = np.cos(box.yaw), np.sin(box.yaw)
        half = 0.5 * np.array(box.size)
        corners = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * half
        shapes.append({"points": _rounded(corners @ np.array([[c, s], [-s, c]]) + box.centre)})
    shapes += [{"points": _rounded(np.array(p.vertices))} for p in environment.polygons]
    shapes += [{"centre": list(c.centre), "radius": c.radius} for c in environment.circles]
    return {"size": list(environment.size), "shapes": shapes}


def plan_json(plan: Plan | None) -> dict[str, Any]:
    """Planned pushes, each with name, colour and path, and the ways of robots to their places."""
    if plan is None:
        return {"pushes": [], "ways": []}
    told = {} if math.isnan(plan.gap) else {"cost": round(plan.cost, 3), "gap": round(plan.gap, 3)}
    return {
        **told,
        "pushes": [
            {"name": p.name, "colour": robot_colour(p.number), **_path(p.path)} for p in plan.pushes
        ],
        "ways": [{"robot": robot, **_path(path)} for robot, path in plan.ways],
    }


def rows_json(reports: Iterable[tuple[str, Report]]) -> list[dict[str, Any]]:
    """Rows of a table: name and text of each figure; its value, unit and limit if it is a number.

    reports: name of the method, and what it reported.
    """
    rows: list[dict[str, Any]] = []
    for method, report in reports:
        rows += [{"name": "method", "text": method}, {"name": "phase", "text": report.phase}]
        for figure in report.figures:
            row: dict[str, Any] = {"name": figure.name, "text": figure_text(figure)}
            if np.isfinite(figure.value):
                row.update(value=short(figure.value), unit=figure.unit)
                if np.isfinite(figure.limit):
                    row["limit"] = short(figure.limit)
            rows.append(row)
        if report.solve_time > 0.0:
            text = f"{1e6 * report.solve_time:.0f} µs"
            value = short(report.solve_time, 3)
            rows.append({"name": "CPU time of a step", "text": text, "value": value, "unit": "s"})
    return rows


def shapes_json(reports: Iterable[Report]) -> list[dict[str, Any]]:
    """Layer, kind, colour, radius [m] and points [mm] of each shape."""
    return [
        {
            "layer": s.layer,
            "kind": int(s.kind),
            "colour": layer_colour(s.layer),
            "radius": round(float(s.radius), 4),
            "points": np.round(1e3 * s.points).astype(int).tolist(),
        }
        for report in reports
        for s in report.shapes
        if np.isfinite(s.points).all()
    ]


def short(value: float, digits: int = 5) -> float:
    """A finite number with so many digits; as it is where rounding would exceed all numbers."""
    rounded = float(f"{value:.{digits}g}")
    return rounded if math.isfinite(rounded) else float(value)


def _path(points: Array) -> dict[str, Any]:
    if len(points) > _POINTS:
        points = points[np.linspace(0, len(points) - 1, _POINTS).astype(int)]
    return {"points": _rounded(points)}


def _rounded(points: Array | Sequence[Any]) -> list[list[float]]:
    return np.round(np.asarray(points, dtype=np.float64), 4).tolist()  # type: ignore[no-any-return]
