"""Bags as the page plays them back: everything that is drawn, over the time of the bag."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from push_model.arrays import Array
from push_record.bag import ending
from push_record.contents import BagContents, Job, ReportSeries, load
from push_record.planned import merged
from push_view.bodies import bodies_of
from push_view.page_data import obstacles_json, plan_json, rows_json, shapes_json, short

_MOMENTS = 0.25  # [s] between two reports
_FRAMES = 20_000  # frames that are sent at most
VALUES = 3_000_000
"""Numbers of poses that are sent at most."""

_POINTS = 3000  # of a series


def playback_json(bag: Path, name: str = "") -> dict[str, Any]:
    """A bag as JSON for the page.

    name: to call it; that of its folder if it is not given. Poses are integers, in units of 0.1 mm
    and 1 mrad, as in the live page. Times are seconds of the bag. trouble:
    ``cut off`` or ``damaged``, empty if the file is whole.

    Raises
    ------
    ValueError: the bag holds no scenario. FileNotFoundError: it is none.
    """
    sent = contents_json(load(bag, _MOMENTS), name or bag.name, VALUES)
    return {**sent, "trouble": ending(bag).trouble}


def contents_json(contents: BagContents, name: str, values: int) -> dict[str, Any]:
    """The contents of a bag as JSON for the page. values: numbers of poses at most."""
    bodies = bodies_of(contents.scenario)
    frames = _frames(len(contents.time), len(bodies), values)
    jobs = [job for job in contents.jobs.values() if job.states]
    return {
        "name": name,
        "scenario": contents.scenario.name,
        "metadata": {k: v for k, v in contents.metadata.items() if k != "scenario"},
        "extent": [float(v) for v in contents.scenario.grid.extent],
        "bodies": {
            "revision": 0,
            "obstacles": obstacles_json(contents.scenario.environment) or _cells(contents),
            **bodies.as_json(),
        },
        "t": np.round(contents.time[frames], 3).tolist(),
        "poses": [_columns(contents.poses.get(n), frames) for n in bodies.names],
        "teams": [_team(contents, job) for job in jobs],
    }


def _frames(count: int, bodies: int, values: int) -> Array:
    """Indices of the frames that are sent."""
    most = min(count, _FRAMES, max(2, values // (3 * max(bodies, 1))))
    return np.unique(np.linspace(0, max(count - 1, 0), most).astype(int)) if count else _NONE


_NONE = np.zeros(0, dtype=int)


def _columns(poses: Array | None, frames: Array) -> list[list[int | None]]:
    """x, y [0.1 mm] and angle [mrad] of a body in each frame; None where it is not known."""
    if poses is None:
        return [[None] * len(frames)] * 3
    table = np.round(poses[frames] * (1e4, 1e4, 1e3))
    return [[int(v) if np.isfinite(v) else None for v in column] for column in table.T.tolist()]


def _cells(contents: BagContents) -> dict[str, Any]:
    """A raster as squares, row by row: for a map that is an image."""
    grid = contents.scenario.grid
    x0, x1, y0, y1 = grid.extent
    rows, columns = grid.occupied.shape
    dx, dy = (x1 - x0) / columns, (y1 - y0) / rows
    shapes = []
    for i, row in enumerate(grid.occupied):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], row.astype(int), [0]])))
        for a, b in edges.reshape(-1, 2):
            left, right, low = x0 + a * dx, x0 + b * dx, y0 + i * dy
            box = [[left, low], [right, low], [right, low + dy], [left, low + dy]]
            shapes.append({"points": np.round(box, 4).tolist()})
    return {"size": [0.0, 0.0], "shapes": shapes}


def _team(contents: BagContents, job: Job) -> dict[str, Any]:
    series = list(job.reports.values())
    return {
        "space": job.space,
        "robots": list(job.robots),
        "object": job.object,
        "system": job.system,
        "states": [
            {
                "t": round(s.time, 3),
                "state": s.name,
                "reason": s.reason,
                "code": s.code,
                "job": s.job,
                "goal": None if s.goal is None else s.goal.tolist(),
                "step": [s.step[0] + 1, s.step[1]],
            }
            for s in job.states
        ],
        "plans": [
            {"t": round(plan.time, 3), **plan_json(merged(job.plans[: i + 1]))}
            for i, plan in enumerate(job.plans)
        ],
        "moments": _moments(series),
        "series": _series(contents, job, series),
    }


def _moments(series: Sequence[ReportSeries]) -> list[list[dict[str, Any]]]:
    """Of each report's source: its moments, with rows of the table and shapes."""
    return [
        [
            {
                "t": round(time, 3),
                "rows": rows_json([(s.method, report)]),
                "shapes": shapes_json([report]),
            }
            for time, report in s.moments
        ]
        for s in series
    ]


def _series(
    contents: BagContents, job: Job, reports: Sequence[ReportSeries]
) -> dict[str, dict[str, Any]]:
    """Errors of the object while it had a goal, and all figures of reports, by name."""
    found: dict[str, dict[str, Any]] = {}
    poses, time = contents.poses.get(job.object), contents.time
    goals = [(s.time, s.goal) for s in job.states if s.goal is not None]
    if poses is not None and goals:
        begun = np.array([t for t, _ in goals])
        which = np.searchsorted(begun, time, side="right") - 1
        aims = np.array([goal for _, goal in goals])[np.maximum(which, 0)]
        gap = poses - aims
        angle = np.abs(np.arctan2(np.sin(gap[:, 2]), np.cos(gap[:, 2])))
        good = (which >= 0) & np.isfinite(gap).all(axis=1)
        errors = (
            ("position error", "m", np.hypot(*gap[:, :2].T)),
            ("orientation error", "rad", angle),
        )
        for name, unit, values in errors:
            found[name] = _one(unit, time[good], values[good])
    for report in reports:
        for name, (unit, times, values) in report.figures.items():
            t, v = np.array(times), np.array(values)
            good = np.isfinite(v)
            label = name if name not in found else f"{name} ({report.method})"
            found[label] = _one(unit, t[good], v[good], report.limits.get(name, np.nan))
    return found


def _one(unit: str, times: Array, values: Array, limit: float = np.nan) -> dict[str, Any]:
    kept = _thinned(values)
    told = {} if not np.isfinite(limit) else {"limit": short(limit)}
    return {
        "unit": unit,
        "t": np.round(times[kept], 3).tolist(),
        "v": [short(v) for v in values[kept]],
        **told,
    }


def _thinned(values: Array) -> Array:
    """Indices of at most ``_POINTS`` values: the least and the greatest of each stretch."""
    if len(values) <= _POINTS:
        return np.unique(np.arange(len(values)))
    edges = np.linspace(0, len(values), _POINTS // 2 + 1).astype(int)
    ends = [
        begin + extreme
        for begin, end in zip(edges, edges[1:], strict=False)
        for extreme in (int(values[begin:end].argmin()), int(values[begin:end].argmax()))
    ]
    return np.unique(ends)
