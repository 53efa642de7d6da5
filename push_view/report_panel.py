"""What page and report show of a method: its figures and its shapes. Knows no method by name."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from push_job.report import Drawable, Report, ShapeKind
from push_msgs.msg import Report as ReportMessage
from push_ros.names import Names
from push_ros.qos import STATUS
from push_ros.report_conversions import report_from_ros
from push_ros.validation import InvalidMessage
from push_view.bodies import bodies_of
from push_view.drawing import draw_body
from push_view.page_data import rows_json, shapes_json
from push_view.palette import INK, layer_colour

if TYPE_CHECKING:
    from push_record.contents import BagContents, Job, ReportSeries

_FOLLOWED = 5  # robots whose own reports are shown beside their team's
_SHOWN = 3  # moments that are drawn
_ABOUT = 0.75  # [m] about the object that is drawn
_CHARTS = 5  # units of figures that are drawn
_NAMES = {"m": ("[mm]", 1e3), "s": ("[ms]", 1e3), "rad": ("[rad]", 1.0)}


class LivePanel:
    """The newest reports of a team: its method's, and its robots' controllers'."""

    def __init__(self, node: Any, names: Names, robots: Sequence[str]) -> None:
        self._node, self._reports = node, dict[str, tuple[ReportMessage, Report]]()
        topics = [names.team("report"), *(names.robot(r, "report") for r in robots[:_FOLLOWED])]
        self._subscriptions = [
            node.create_subscription(ReportMessage, topic, self._taker(topic), STATUS)
            for topic in topics
        ]

    def _taker(self, topic: str) -> Any:
        def take(message: ReportMessage) -> None:
            try:
                self._reports[topic] = message, report_from_ros(message)
            except InvalidMessage:
                self._reports.pop(topic, None)

        return take

    def rows(self) -> list[dict[str, Any]]:
        """What each figure is, and its value with a unit; what is not finite is a dash."""
        return rows_json((str(m.method), report) for m, report in self._reports.values())

    def shapes(self) -> list[dict[str, Any]]:
        """For the page: layer, kind, colour, radius [m] and points [mm] of each shape."""
        return shapes_json(report for _, report in self._reports.values())

    def close(self) -> None:
        """Leave the graph."""
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)


def draw_shapes(axes: Any, shapes: Sequence[Drawable], alpha: float = 1.0) -> None:
    """Shapes into a map's axes [m]; a layer is named once in the legend."""
    named: set[str] = set()
    for shape in shapes:
        colour = layer_colour(shape.layer)
        label = None if shape.layer in named else shape.layer
        named.add(shape.layer)
        points = shape.points
        if shape.kind is ShapeKind.ARROWS:
            tails, heads = points[::2], points[1::2]
            axes.quiver(
                *tails.T,
                *(heads - tails).T,
                color=colour,
                angles="xy",
                scale_units="xy",
                scale=1.0,
                width=0.004,
                alpha=alpha,
                label=label,
            )
        elif shape.kind is ShapeKind.DISCS:
            for k, point in enumerate(points):
                circle = _circle(point, max(shape.radius, 1e-3))
                axes.fill(*circle.T, color=colour, alpha=0.6 * alpha, label=None if k else label)
        else:
            closed = shape.kind is ShapeKind.POLYGON
            line = np.vstack([points, points[:1]]) if closed else points
            axes.plot(*line.T, color=colour, lw=0.8, alpha=alpha, label=label)


def _circle(middle: Any, radius: float) -> Any:
    angle = np.linspace(0.0, 2.0 * np.pi, 24)
    return middle + radius * np.column_stack([np.cos(angle), np.sin(angle)])


def draw_report(figure: Any, grid: Any, contents: "BagContents", job: "Job") -> None:
    """Figures over time by unit, with the phases behind them, and a few moments, into a part of a
    matplotlib figure (a SubplotSpec)."""
    drawn = [s for s in job.reports.values() if s.times]
    if not drawn:
        return
    charts = _charts(drawn)
    moments = [m for s in drawn for m in s.moments if m[1].shapes]
    heights = [1.0] * len(charts) + [0.3, 2.4] * bool(moments)  # 0.3: titles and labels of time
    rows = len(heights)
    inner = grid.subgridspec(rows, _SHOWN, hspace=0.35, height_ratios=heights)
    for row, (unit, lines) in enumerate(charts.items()):
        axes = figure.add_subplot(inner[row, :])
        label, factor = _NAMES.get(unit, (f"[{unit}]" if unit else "", 1.0))
        for name, (times, values) in lines.items():
            axes.plot(times, factor * np.array(values), lw=0.9, label=name)
        axes.set_ylabel(label, fontsize=7)
        axes.tick_params(labelsize=6)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=6, loc="upper right", ncols=2)
        if row == 0:
            _strip(axes, drawn[0])
        if row == len(charts) - 1:
            axes.set_xlabel("sim time [s]", fontsize=7)
    if moments:
        for k, i in enumerate(np.linspace(0, len(moments) - 1, _SHOWN).astype(int)):
            _draw_moment(figure.add_subplot(inner[rows - 1, k]), contents, job, *moments[i])


def _charts(drawn: Sequence["ReportSeries"]) -> dict[str, dict[str, Any]]:
    """Figures by unit: name to times and values; a gap of a second has no line across."""
    charts: dict[str, dict[str, Any]] = {}
    for series in drawn:
        for name, (unit, times, values) in series.figures.items():
            chart = charts.setdefault(unit, {})
            t, v = np.array(times), np.array(values)
            gaps = np.flatnonzero(np.diff(t) > 1.0) + 1
            chart[name] = np.insert(t, gaps, t[gaps]), np.insert(v, gaps, np.nan)
    most = sorted(charts, key=lambda u: (u == "", -len(charts[u])))[:_CHARTS]
    return {unit: charts[unit] for unit in most}


def _strip(axes: Any, series: "ReportSeries") -> None:
    """Colours of phases behind a chart."""
    begin, known = 0, list(dict.fromkeys(series.phases))
    for k in range(1, len(series.phases) + 1):
        if k == len(series.phases) or series.phases[k] != series.phases[begin]:
            colour = f"C{known.index(series.phases[begin]) % 10}"
            axes.axvspan(series.times[begin], series.times[k - 1], color=colour, alpha=0.12, lw=0)
            begin = k
    axes.set_title("phases: " + ", ".join(known), fontsize=6, loc="left")


def _draw_moment(
    axes: Any, contents: "BagContents", job: "Job", time: float, report: Report
) -> None:
    k = int(np.argmin(np.abs(contents.time - time))) if len(contents.time) else 0
    bodies = bodies_of(contents.scenario)
    for name, poses in contents.poses.items():
        if k < len(poses) and np.isfinite(poses[k]).all() and name in bodies.names:
            colour = INK if name == job.object else bodies.colour(name)
            draw_body(axes, bodies.type(name).outline, poses[k], colour, fill=False, lw=0.9)
    draw_shapes(axes, report.shapes)
    if job.object in contents.poses and k < len(contents.poses[job.object]):
        x, y = contents.poses[job.object][k][:2]
        if np.isfinite([x, y]).all():
            axes.set_xlim(x - _ABOUT, x + _ABOUT)
            axes.set_ylim(y - _ABOUT, y + _ABOUT)
    axes.set_aspect("equal")
    axes.tick_params(labelsize=6)
    axes.set_title(f"{time:.0f} s: {report.phase}", fontsize=7)
