"""The data of a report in HTML: plain numbers and texts, few enough for one file."""

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from push_job.report import Drawable
from push_model import se2
from push_model.arrays import Array
from push_model.occupancy import MapSpec
from push_model.specs import EnvironmentSpec
from push_record.contents import BagContents, Job
from push_record.faults import Fault
from push_view.bodies import bodies_of
from push_view.palette import OBJECT, SERIES, robot_colours
from push_view.report_panel import layer_colour

_NUMBERS = 240_000  # poses of all bodies that are kept
_FRAMES = 900
_POINTS = 600  # of a line of a chart
_MOMENTS = 60
_GAP = 1.0  # [s] without a value across which a line is not drawn
_SCALES = {"m": ("mm", 1e3), "s": ("ms", 1e3)}
_LINES = len(SERIES)  # of a chart
_SPREAD = 15.0  # largest over smallest of the lines of a chart


def report_data(contents: BagContents, faults: Sequence[Fault]) -> dict[str, Any]:
    """All that the page draws: map, bodies, frames, plans, moments, charts, states, faults."""
    jobs = list(contents.jobs.values())
    times, keep = _kept(contents)
    return {
        "map": _map(contents),
        "bodies": _bodies(contents),
        "times": _numbers(times, 3),
        "poses": _poses(contents, keep),
        "jobs": [_job(job) for job in jobs],
        "moments": _moments(jobs),
        "charts": charts(contents),
        "faults": [
            {"time": _number(f.time, 3), "kind": f.kind, "where": f.where, "text": f.text}
            for f in faults
        ],
    }


def _kept(contents: BagContents) -> tuple[Array, Any]:
    """Times and indices of the frames that are kept; the last one is among them."""
    count = len(contents.time)
    most = max(2, min(_FRAMES, _NUMBERS // max(1, 3 * len(contents.poses))))
    keep = np.unique(np.linspace(0, count - 1, min(count, most)).astype(int))
    return contents.time[keep] if count else contents.time, keep


def _map(contents: BagContents) -> dict[str, Any]:
    grid, place = contents.scenario.grid, contents.scenario.environment
    x0, x1, y0, y1 = grid.extent
    shapes: dict[str, Any] = {"extent": [x0, x1, y0, y1], "polygons": [], "circles": []}
    if isinstance(place, MapSpec):
        for a, b, c, d in place.grid.rectangles().tolist():
            shapes["polygons"].append(_rounded([[a, c], [b, c], [b, d], [a, d]]))
        return shapes
    assert isinstance(place, EnvironmentSpec)
    w, h = place.size[0] / 2.0, place.size[1] / 2.0
    shapes["room"] = [-w, w, -h, h]
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) / 2.0
    for box in place.boxes:
        pose = np.array([*box.centre, box.yaw])
        shapes["polygons"].append(_rounded(se2.transform(pose, corners * box.size)))
    shapes["polygons"] += [_rounded(p.vertices) for p in place.polygons]
    shapes["circles"] = [[*map(float, c.centre), float(c.radius)] for c in place.circles]
    return shapes


def _bodies(contents: BagContents) -> list[dict[str, Any]]:
    bodies, robots = bodies_of(contents.scenario), tuple(contents.scenario.robots)
    colours = robot_colours(robots)
    outlines = [_rounded(t.outline) for t in bodies.types]
    found = []
    for name, kind in zip(bodies.names, bodies.type_of.tolist(), strict=True):
        if name in contents.poses:
            robot = name in colours
            found.append(
                {
                    "name": name,
                    "robot": robot,
                    "colour": colours.get(name, OBJECT),
                    "outline": outlines[kind],
                }
            )
    return found


def _poses(contents: BagContents, keep: Any) -> list[list[list[float | None]]]:
    """By body: x, y [0.1 mm] and theta [mrad] at each frame."""
    names = [n for n in bodies_of(contents.scenario).names if n in contents.poses]
    found = []
    for name in names:
        scaled = contents.poses[name][keep] * (1e4, 1e4, 1e3)
        found.append([[None if math.isnan(v) else round(v) for v in c] for c in scaled.T.tolist()])
    return found


def _job(job: Job) -> dict[str, Any]:
    return {
        "space": job.space,
        "object": job.object,
        "states": [
            {"time": round(s.time, 3), "name": s.name, "reason": s.reason} for s in job.states
        ],
        "goals": [{"time": round(t, 3), "pose": _numbers(g, 4)} for t, g in job.goals],
        "plan": [_rounded(way[:: max(1, len(way) // 100)]) for way in job.plan if len(way)],
    }


def _moments(jobs: Iterable[Job]) -> list[dict[str, Any]]:
    """Shapes of the reports, at some times."""
    found = [m for job in jobs for series in job.reports.values() for m in series.moments]
    found = sorted((m for m in found if m[1].shapes), key=lambda m: m[0])
    keep = found[:: max(1, math.ceil(len(found) / _MOMENTS))]
    return [{"time": round(t, 2), "shapes": [_shape(s) for s in r.shapes]} for t, r in keep]


def _shape(shape: Drawable) -> dict[str, Any]:
    good = np.isfinite(shape.points).all()
    return {
        "layer": shape.layer,
        "kind": int(shape.kind),
        "colour": layer_colour(shape.layer),
        "radius": round(float(shape.radius), 4),
        "points": _rounded(shape.points) if good else [],
    }


def charts(contents: BagContents) -> list[dict[str, Any]]:
    """Errors of every object, then what methods and controllers report, by unit."""
    found = []
    titles = ("distance of the object from the goal", "angle of the object from the goal")
    for axis, (title, unit) in enumerate(zip(titles, ("mm", "rad"), strict=True)):
        lines: list[Any] = []
        for job in contents.jobs.values():
            errors = errors_over_time(contents, job)
            if len(errors):
                name = job.object if job.space == "/" else f"{job.space.strip('/')}: {job.object}"
                factor = 1e3 if axis == 0 else 1.0
                lines.append((name, contents.time, factor * errors[:, axis], math.nan))
        found += _chart(title, unit, lines)
    units: dict[str, list[Any]] = {}
    for job in contents.jobs.values():
        for topic, series in job.reports.items():
            prefix = f"{topic.split('/')[-2]}: " if len(job.reports) > 1 else ""
            for name, (unit, times, values) in series.figures.items():
                label, factor = _SCALES.get(unit, (unit, 1.0))
                limit = factor * series.limits.get(name, math.nan)
                values_ = factor * np.array(values)
                units.setdefault(label, []).append((prefix + name, np.array(times), values_, limit))
    for unit, lines in units.items():
        for alike in _by_size(lines):
            found += _chart(", ".join(line[0] for line in alike[:2]), unit, alike)
    for title, unit, column, factor in (
        ("obstacle margin of the controller", "mm", "obstacle_margin", 1e3),
        ("curvature margin of the controller", "1/m", "curvature_margin", 1.0),
        ("CPU time of a solve", "ms", "solve_time", 1e3),
    ):
        lines = [
            (robot, s["time"], factor * s[column], math.nan) for robot, s in contents.status.items()
        ]
        if column == "solve_time":
            lines += [
                (t.strip("/"), np.array(s.times), 1e3 * np.array(s.solve_times), math.nan)
                for job in contents.jobs.values()
                for t, s in job.reports.items()
                if any(s.solve_times) and not contents.status
            ]
        found += _chart(title, unit, lines)
    return found


def _by_size(lines: Sequence[Any]) -> list[list[Any]]:
    """Lines that can be read in one chart: their greatest values are not far apart."""
    sizes = []
    for line in lines:
        values = np.abs(line[2][np.isfinite(line[2])])
        if len(values):
            sizes.append((float(values.max()), line))
    sizes.sort(key=lambda pair: pair[0])
    groups: list[list[Any]] = []
    least = 0.0
    for size, line in sizes:
        if not groups or size > _SPREAD * least > 0.0 or len(groups[-1]) >= len(SERIES):
            groups.append([])
            least = size
        groups[-1].append(line)
        least = least or size
    return groups


def errors_over_time(contents: BagContents, job: Job) -> Array:
    """``(n, 2)`` [m], [rad] of a team's object from the goal of the time; nan without one."""
    poses = contents.poses.get(job.object)
    goals = job.goals or ([(-math.inf, job.goal)] if job.goal is not None else [])
    if poses is None or not goals:
        return np.zeros((0, 2))
    errors = np.full((len(contents.time), 2), np.nan)
    for time, goal in goals:
        later = contents.time >= time - 1e-9
        gap = poses[later] - goal
        turned = np.abs((gap[:, 2] + np.pi) % (2.0 * np.pi) - np.pi)
        errors[later] = np.column_stack([np.hypot(gap[:, 0], gap[:, 1]), turned])
    return errors


def _chart(title: str, unit: str, lines: Sequence[Any]) -> list[dict[str, Any]]:
    """A chart, if any line has a finite value."""
    drawn: list[dict[str, Any]] = []
    for name, times, values, limit in lines:
        good = np.isfinite(values)
        if good.any() and len(drawn) < _LINES:
            t, v = _thinned(np.asarray(times)[good], np.asarray(values)[good])
            colour = SERIES[len(drawn) % len(SERIES)]
            line = {"name": name, "colour": colour, "t": _numbers(t, 3), "v": _numbers(v, 4)}
            drawn.append({**line, "limit": _number(limit, 4)})
    return [{"title": title, "unit": unit, "lines": drawn}] if drawn else []


def _thinned(times: Array, values: Array) -> tuple[Array, Array]:
    """At most ``_POINTS`` points: least and greatest value of each bin, so that no peak is lost.
    A gap becomes nan."""
    if len(times) > _POINTS:
        bins = np.array_split(np.arange(len(times)), _POINTS // 2)
        keep = [k for b in bins for k in (b[np.argmin(values[b])], b[np.argmax(values[b])])]
        order = np.unique(keep)
        times, values = times[order], values[order]
    gaps = np.flatnonzero(np.diff(times) > _GAP) + 1
    return np.insert(times, gaps, times[gaps]), np.insert(values, gaps, np.nan)


def _rounded(points: Any) -> list[list[float]]:
    rounded: list[list[float]] = np.round(np.asarray(points, dtype=np.float64), 4).tolist()
    return rounded


def _number(value: float, digits: int) -> float | None:
    return round(float(value), digits) if math.isfinite(value) else None


def _numbers(values: Iterable[float], digits: int) -> list[float | None]:
    return [_number(v, digits) for v in values]
