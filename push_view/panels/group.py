"""A group that pushes: where it is from its trajectory, forces, margin."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from push_msgs.msg import GroupStatus
from push_ros.names import Names
from push_ros.qos import STATUS

if TYPE_CHECKING:
    from push_record.contents import BagContents, Job


class LiveGroup:
    """The newest status of a group."""

    def __init__(self, node: Any, names: Names, robots: Sequence[str]) -> None:
        self._node, self._count = node, len(robots)
        self._status: Any = None
        self._subscription = node.create_subscription(
            GroupStatus, names.team("group_status"), self._on_status, STATUS
        )

    def _on_status(self, message: Any) -> None:
        self._status = message

    def rows(self) -> list[tuple[str, str]]:
        """What is not finite is a dash."""
        m = self._status
        if m is None:
            return []
        values = [
            ("pushing", len(m.pushers), f"{{:.0f}} of {self._count}"),
            ("tracking error", 1e3 * m.position_error, "{:.1f} mm"),
            ("heading error", m.orientation_error, "{:.3f} rad"),
            ("grasp margin", m.margin, "{:.2f}"),
            ("wrench not made", 100.0 * m.lacking, "{:.0f} %"),
            ("tick", 1e6 * m.solve_time, "{:.0f} µs"),
        ]
        shown = [(label, unit.format(v) if math.isfinite(v) else "–") for label, v, unit in values]
        for name, x, y in zip(m.pushers, m.force_x, m.force_y, strict=False):
            shown.append((f"force of {name}", f"{math.hypot(x, y):.2f} N"))
        if m.dead:
            shown.append(("does not move", ", ".join(m.dead)))
        return shown

    def close(self) -> None:
        """Leave the graph."""
        self._node.destroy_subscription(self._subscription)


class _Group:
    def live(self, node: Any, names: Names, robots: Sequence[str]) -> LiveGroup:
        return LiveGroup(node, names, robots)

    def draw(self, figure: Any, grid: Any, contents: "BagContents", job: "Job") -> None:
        pushes = [p for p in job.pushes if p.rows]
        if not pushes:
            return
        table = np.vstack([[*p.rows, [math.nan] * len(p.rows[0])] for p in pushes])
        t = table[:, 0]
        inner = grid.subgridspec(5, 1, hspace=0.3)
        panels = (
            ("error [mm]", [(1e3 * table[:, 1], "position")]),
            ("error [rad]", [(table[:, 2], "heading")]),
            ("wrench", [(table[:, 3], "part not made"), (table[:, 4], "grasp margin")]),
            ("tick [ms CPU]", [(1e3 * table[:, 5], "group law")]),
        )
        for row, (label, lines) in enumerate(panels):
            axes = figure.add_subplot(inner[row])
            for values, name in lines:
                axes.plot(t, values, lw=0.9, label=name)
            _dress(axes, label)
        axes = figure.add_subplot(inner[4])
        for i, robot in enumerate(job.robots):
            for push in pushes:
                if robot in push.pushers:
                    k = push.pushers.index(robot)
                    force = [math.hypot(*f[k]) for f in push.forces]
                    axes.plot([r[0] for r in push.rows], force, lw=0.9, color=f"C{i}")
            axes.plot([], [], color=f"C{i}", label=robot)
        _dress(axes, "force asked [N]")
        axes.set_xlabel("sim time [s]", fontsize=7)


def _dress(axes: Any, label: str) -> None:
    axes.set_ylabel(label, fontsize=7)
    axes.tick_params(labelsize=6)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=6, loc="upper right")


PANEL = _Group()
