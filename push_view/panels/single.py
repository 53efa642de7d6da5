"""One robot with a predictive controller: errors, margins, solve time."""

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from push_msgs.msg import ControllerStatus
from push_ros.names import Names
from push_ros.qos import STATUS

if TYPE_CHECKING:
    from push_view.contents import BagContents, Job

_FAR = 50.0  # [1/m] margins above are no margins but free motion
_REST = 1.0  # [s] without status after which the controller has rested

_ROWS: tuple[tuple[str, Callable[[Any], float], str], ...] = (
    ("tracking error", lambda m: 1e3 * math.hypot(m.error_x, m.error_y), "{:.1f} mm"),
    ("speed", lambda m: 1e3 * m.v, "{:.0f} mm/s"),
    ("curvature margin", lambda m: m.curvature_margin, "{:.2f} 1/m"),
    ("obstacle margin", lambda m: 1e3 * m.obstacle_margin, "{:.1f} mm"),
    ("solve time", lambda m: 1e6 * m.solve_time, "{:.0f} µs"),
    ("failed solves", lambda m: m.failures, "{:.0f}"),
)


class LiveController:
    """The newest status of a robot's controller."""

    def __init__(self, node: Any, names: Names, robots: Sequence[str]) -> None:
        self._node = node
        self._status: Any = None
        self._subscriptions = [
            node.create_subscription(
                ControllerStatus, names.robot(robot, "controller/status"), self._on_status, STATUS
            )
            for robot in robots[:1]
        ]

    def _on_status(self, message: Any) -> None:
        self._status = message

    def rows(self) -> list[tuple[str, str]]:
        """What is not finite, e.g. a margin to nothing, is a dash."""
        if self._status is None:
            return []
        values = [(label, value(self._status), unit) for label, value, unit in _ROWS]
        return [(label, unit.format(v) if math.isfinite(v) else "–") for label, v, unit in values]

    def close(self) -> None:
        """Leave the graph."""
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)


class _Single:
    def live(self, node: Any, names: Names, robots: Sequence[str]) -> LiveController:
        return LiveController(node, names, robots)

    def draw(self, figure: Any, grid: Any, contents: "BagContents", job: "Job") -> None:
        status = [contents.status[r] for r in job.robots if r in contents.status]
        if not status or not len(status[0]["time"]):
            return
        s = status[0]
        t, free = s["time"], s["curvature_margin"] > _FAR
        rests = np.diff(t, append=t[-1]) > _REST  # no line across
        panels = [
            (
                "tracking error [mm]",
                [(1e3 * s["error_x"], "along"), (1e3 * s["error_y"], "across")],
            ),
            ("heading error [rad]", [(s["error_theta"], "heading")]),
            (
                "curvature margin [1/m]",
                [(np.where(free, np.nan, s["curvature_margin"]), "to the limit")],
            ),
            ("object aside [mm]", [(1e3 * s["object_offset_y"], "y_or")]),
            ("solve [ms CPU]", [(1e3 * s["solve_time"], "controller")]),
        ]
        inner = grid.subgridspec(len(panels), 1, hspace=0.25)
        for row, (label, lines) in enumerate(panels):
            axes = figure.add_subplot(inner[row])
            for values, name in lines:
                axes.plot(t, np.where(rests, np.nan, values), lw=0.9, label=name)
            axes.set_xlim(t[0], max(t[-1], t[0] + 1e-3))
            axes.set_ylabel(label, fontsize=7)
            axes.tick_params(labelsize=6)
            axes.grid(alpha=0.3)
            axes.legend(fontsize=6, loc="upper right")
            _mark_states(axes, job, t[0], t[-1], named=row == 0)
        axes.set_xlabel("sim time [s]", fontsize=7)


def _mark_states(axes: Any, job: "Job", begin: float, end: float, named: bool) -> None:
    """A line where the state changed, within times [s]."""
    before = ""
    for state in job.states:
        if state.name != before and begin <= state.time <= end:
            axes.axvline(state.time, color="#bbbbbb", lw=0.6)
            if named:
                top = axes.get_ylim()[1]
                axes.text(state.time, top, state.name.lower(), fontsize=5, rotation=35)
        before = state.name


PANEL = _Single()
