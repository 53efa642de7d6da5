"""A swarm that moves an object: its phase, how far it has to go, its density and cells."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from push_msgs.msg import SwarmStatus
from push_ros.names import Names
from push_ros.qos import STATUS
from push_view.bodies import bodies_of
from push_view.drawing import GOAL, INK, draw_body
from swarm_push.coverage import Coverage
from swarm_push.swarm_messages import density_from_ros

if TYPE_CHECKING:
    from push_record.contents import BagContents, Job

_PHASES = ("gather", "go round", "realign", "push")
_SHOWN = 3  # moments of which density and cells are drawn
_FINE = 120  # points of the density's picture, along each axis
_ABOUT = 0.75  # [m] about the object that is drawn


class LiveSwarm:
    """The newest status of a swarm."""

    def __init__(self, node: Any, names: Names, robots: Sequence[str]) -> None:
        self._node, self._count = node, len(robots)
        self._status: Any = None
        self._subscription = node.create_subscription(
            SwarmStatus, names.team("swarm_status"), self._on_status, STATUS
        )

    def _on_status(self, message: Any) -> None:
        self._status = message

    def rows(self) -> list[tuple[str, str]]:
        """What is not finite is a dash."""
        m = self._status
        if m is None:
            return []
        values = [
            ("to the target", 1e3 * m.position_error, "{:.0f} mm"),
            ("heading error", m.orientation_error, "{:.3f} rad"),
            ("tick", 1e6 * m.solve_time, "{:.0f} µs"),
        ]
        shown = [
            ("law", str(m.law)),
            ("phase", str(m.phase)),
            ("target", f"{m.target + 1} of {m.targets}"),
            ("taking part", f"{len(m.robots)} of {self._count}"),
        ]
        shown += [(label, unit.format(v) if math.isfinite(v) else "–") for label, v, unit in values]
        if m.dead:
            shown.append(("does not move", ", ".join(m.dead)))
        return shown

    def close(self) -> None:
        """Leave the graph."""
        self._node.destroy_subscription(self._subscription)


class _Swarm:
    def live(self, node: Any, names: Names, robots: Sequence[str]) -> LiveSwarm:
        return LiveSwarm(node, names, robots)

    def draw(self, figure: Any, grid: Any, contents: "BagContents", job: "Job") -> None:
        rows = job.swarm.rows
        if not rows:
            return
        table = np.array([r[:4] for r in rows])
        inner = grid.subgridspec(4, _SHOWN, hspace=0.35, height_ratios=(1, 1, 1, 2.4))
        t = table[:, 0]
        lines = (
            ("to the target [mm]", 1e3 * table[:, 1]),
            ("heading error [rad]", table[:, 2]),
            ("tick [ms CPU]", 1e3 * table[:, 3]),
        )
        for k, (label, values) in enumerate(lines):
            axes = figure.add_subplot(inner[k, :])
            axes.plot(t, values, lw=0.9)
            axes.set_ylabel(label, fontsize=7)
            axes.tick_params(labelsize=6)
            axes.grid(alpha=0.3)
            if k == 0:
                _strip(axes, t, [r[4] for r in rows])
        moments = job.swarm.moments
        for k, i in enumerate(np.linspace(0, len(moments) - 1, _SHOWN).astype(int)):
            draw_moment(figure.add_subplot(inner[3, k]), contents, moments[i])


def _strip(axes: Any, time: Any, phases: Sequence[str]) -> None:
    """Colours of phases behind a curve."""
    begin = 0
    for k in range(1, len(phases) + 1):
        if k == len(phases) or phases[k] != phases[begin]:
            colour = f"C{1 + _PHASES.index(phases[begin])}" if phases[begin] in _PHASES else "k"
            axes.axvspan(time[begin], time[k - 1], color=colour, alpha=0.15, lw=0)
            begin = k
    for i, name in enumerate(_PHASES):
        axes.plot([], [], color=f"C{1 + i}", alpha=0.4, lw=5, label=name)
    axes.legend(fontsize=6, loc="upper right", ncols=4)


def draw_moment(axes: Any, contents: "BagContents", message: Any) -> None:
    """Density, cells, centroids and bodies at the time of a status."""
    stamp = message.header.stamp
    time = stamp.sec + 1e-9 * stamp.nanosec
    k = int(np.argmin(np.abs(contents.time - time)))
    here = contents.poses[message.object][k]
    known = [contents.poses[n][k] for n in message.robots if n in contents.poses]
    robots = np.array([p[:2] for p in known if np.isfinite(p).all()]).reshape(-1, 2)
    region = np.column_stack([message.region_x, message.region_y])
    x, y = (np.linspace(c - _ABOUT, c + _ABOUT, _FINE) for c in here[:2])
    plane = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    values = density_from_ros(message).at(plane).reshape(_FINE, _FINE)
    axes.contourf(x, y, values, levels=8, cmap="Purples", alpha=0.8)
    if len(robots):
        for cell in Coverage(region).cells(robots):
            axes.plot(*np.vstack([cell, cell[:1]]).T, color="0.6", lw=0.5)
        axes.plot(*robots.T, "o", ms=4, color="C0")
    axes.plot(message.centroid_x, message.centroid_y, "x", ms=3, color="C3")
    outline = bodies_of(contents.scenario).type(message.object).outline
    draw_body(axes, outline, here, INK, fill=False, lw=1.2)
    axes.plot(message.target_x, message.target_y, "+", ms=8, color=GOAL)
    axes.set_xlim(x[0], x[-1])
    axes.set_ylim(y[0], y[-1])
    axes.set_aspect("equal")
    axes.tick_params(labelsize=6)
    axes.set_title(f"{time:.0f} s: {message.phase}", fontsize=7)


PANEL = _Swarm()
