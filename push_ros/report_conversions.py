"""Reports and beliefs as messages, and back: ``x_to_ros`` and ``x_from_ros``."""

import array
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from push_job.report import Drawable, Figure, Report, ShapeKind
from push_model.arrays import Array
from push_model.belief import Belief, BeliefError, Interval
from push_msgs.msg import Belief as BeliefMessage
from push_msgs.msg import BelievedOutline
from push_msgs.msg import Report as ReportMessage
from push_ros.validation import FRAME, InvalidMessage, finite


def report_to_ros(report: Report, stamp: Any, method: str, item: str) -> ReportMessage:
    """stamp: of the poses that the step answered; item: name of the object."""
    message = ReportMessage(method=method, object=item, phase=report.phase)
    message.header.frame_id, message.header.stamp = FRAME, stamp
    message.solve_time = float(report.solve_time)
    message.figures = [f.name for f in report.figures]
    message.units = [f.unit for f in report.figures]
    message.values = _doubles([f.value for f in report.figures])
    message.limits = _doubles([f.limit for f in report.figures])
    shapes = report.shapes
    message.kinds = [int(s.kind) for s in shapes]
    message.layers = [s.layer for s in shapes]
    message.counts = [len(s.points) for s in shapes]
    message.radii = _doubles([s.radius for s in shapes])
    points = np.vstack([np.zeros((0, 2)), *(s.points for s in shapes)])
    message.x, message.y = _doubles(points[:, 0]), _doubles(points[:, 1])
    return message


def report_from_ros(message: ReportMessage) -> Report:
    """The report of a message. A CPU time that is not finite becomes 0: it was not measured.

    Raises
    ------
    InvalidMessage: arrays that should be equally long are not, an unknown kind of shape, or a
        radius that is not finite.
    """
    figures = (message.figures, message.units, message.values, message.limits)
    shapes = (message.kinds, message.layers, message.counts, message.radii)
    if len({len(a) for a in figures}) != 1 or len({len(a) for a in shapes}) != 1:
        raise InvalidMessage("the arrays of a report must have the same length")
    points = np.column_stack([np.asarray(message.x), np.asarray(message.y)])
    ends = np.cumsum([0, *message.counts])
    if len(message.x) != len(message.y) or ends[-1] != len(points):
        raise InvalidMessage("the number of points of a report must be the sum of its counts")
    finite(message.radii, "a radius of a report's shapes")
    try:
        kinds = [ShapeKind(int(k)) for k in message.kinds]
    except ValueError as error:
        raise InvalidMessage(f"a report's shape: {error}") from None
    return Report(
        str(message.phase),
        tuple(
            Figure(str(n), float(v), str(u), float(m)) for n, u, v, m in zip(*figures, strict=True)
        ),
        tuple(
            Drawable(str(layer), kind, points[a:b], float(radius))
            for kind, layer, radius, a, b in zip(
                kinds, message.layers, message.radii, ends[:-1], ends[1:], strict=True
            )
        ),
        float(message.solve_time) if math.isfinite(message.solve_time) else 0.0,
    )


def belief_to_ros(
    source: str,
    values: Mapping[tuple[str, str], Interval],
    outlines: Mapping[str, Array] | None = None,
) -> BeliefMessage:
    """What a source believes: intervals by body and quantity, outlines ``(n, 2)`` [m] by object."""
    message = BeliefMessage(source=source)
    message.bodies = [body for body, _ in values]
    message.quantities = [quantity for _, quantity in values]
    message.values = _doubles([v.value for v in values.values()])
    message.lows = _doubles([v.low for v in values.values()])
    message.highs = _doubles([v.high for v in values.values()])
    message.outlines = [
        BelievedOutline(body=body, x=_doubles(o[:, 0]), y=_doubles(o[:, 1]))
        for body, o in (outlines or {}).items()
    ]
    return message


def belief_from_ros(message: BeliefMessage, base: Belief) -> Belief:
    """``base`` with what a message says.

    Raises
    ------
    InvalidMessage: arrays of different length, no source, a value that cannot be.
    """
    columns = (message.bodies, message.quantities, message.values, message.lows, message.highs)
    if len({len(c) for c in columns}) != 1:
        raise InvalidMessage("the arrays of a belief must have the same length")
    if not message.source:
        raise InvalidMessage("a belief needs a source: set the field 'source'")
    try:
        values = {
            (str(b), str(q)): Interval(float(v), float(low), float(high))
            for b, q, v, low, high in zip(*columns, strict=True)
        }
        outlines = {str(o.body): _outline(o) for o in message.outlines}
        return base.updated(values, outlines)
    except BeliefError as error:
        raise InvalidMessage(str(error)) from None


def _outline(message: BelievedOutline) -> Array:
    if len(message.x) != len(message.y):
        raise InvalidMessage(f"the outline of '{message.body}' must have as many x as y values")
    return np.column_stack([np.asarray(message.x), np.asarray(message.y)])


def _doubles(values: Any) -> "array.array[float]":
    table = np.ascontiguousarray(values, dtype=np.float64)
    return array.array("d", table.tobytes())


def figure_text(figure: Figure) -> str:
    """A figure for a person: in a unit that suits its size; a dash where it is not finite."""
    v, unit = figure.value, figure.unit
    if not math.isfinite(v):
        return "–"
    if unit == "m" and abs(v) < 1.0:
        return f"{round(1e3 * v, 1) + 0.0:.1f} mm"  # no minus before a zero
    if unit == "s" and 0.0 < abs(v) < 1e-3:
        return f"{1e6 * v:.0f} µs"
    if unit == "s" and 0.0 < abs(v) < 1.0:
        return f"{1e3 * v:.1f} ms"
    if unit == "" and float(v).is_integer():
        return f"{v:.0f}"
    return f"{v:.3g} {unit}".strip()
