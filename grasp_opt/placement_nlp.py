"""(3.16)-(3.19) as one nonlinear programme, by CasADi and IPOPT from a start: the thesis's way.

A local method: where it ends depends on where it starts. ``placement.py`` searches globally; this
is its rival in ``benchmarks/placement.py``, and a check by other means.
"""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from grasp_opt.placement import Placer
from push_model.arrays import Array

_SAMPLES = 240  # of the outline, between which splines lie


@dataclass(frozen=True)
class LocalPlacement:
    """way ``(n,)`` [m] along the outline; solved: whether IPOPT says so; objective: its cost."""

    way: Array
    solved: bool
    objective: float


class LocalPlacer:
    """The programme of one ``Placer``'s task; can be solved from many starts."""

    def __init__(self, placer: Placer) -> None:
        self.placer = placer
        outline, count, steps = placer.outline, placer.count, len(placer.steps)
        point, normal = _splines(placer)
        s = ca.MX.sym("s", count)
        u = ca.MX.sym("u", 2 * count, steps)
        x = ca.MX.sym("x", 3, steps)
        sine, cosine = placer.cone
        scale = ca.DM(placer.scale)
        columns, centres = [], []
        for i in range(count):
            p, n = point(s[i]), normal(s[i])
            n = n / ca.norm_2(n)
            centres.append(p - placer.radius * n)
            for sign in (-1.0, 1.0):
                f = ca.vertcat(
                    cosine * n[0] - sign * sine * n[1], sign * sine * n[0] + cosine * n[1]
                )
                columns.append(scale * ca.vertcat(f, p[0] * f[1] - p[1] * f[0]))
        C = ca.horzcat(*columns)
        q, r = ca.DM(placer.weights), placer.force_weight
        cost: Any = 0
        rows: list[Any] = []
        before: Any = ca.DM.zeros(3)
        for k in range(steps):
            c, d, pace = placer.turn[k]
            turn = ca.DM([[c, -d, 0.0], [d, c, 0.0], [0.0, 0.0, pace]])
            rows.append(x[:, k] - before - turn @ (C @ u[:, k]) + ca.DM(placer.steps[k]))
            before = x[:, k]
            cost += 0.5 * ca.dot(q * x[:, k], x[:, k]) + 0.5 * r * ca.dot(u[:, k], u[:, k])
        apart = [ca.sumsqr(centres[i] - centres[j]) for i in range(count) for j in range(i)]
        self._apart = (2.0 * placer.radius + placer.settings.gap) ** 2
        variables = ca.vertcat(s, ca.vec(u), ca.vec(x))
        programme: dict[str, Any] = {"x": variables, "f": cost, "g": ca.vertcat(*rows, *apart)}
        quiet: dict[str, Any] = {
            "print_time": False,
            "ipopt": {"print_level": 0, "sb": "yes", "max_iter": 400},
        }
        self._solver = ca.nlpsol("placement", "ipopt", programme, quiet)
        self._shape = (count, steps, len(apart))
        self._length = outline.length

    def solve(self, way: Array) -> LocalPlacement:
        """Solve, starting at the arc lengths ``(n,)`` [m] with forces of equal size."""
        count, steps, apart = self._shape
        start = np.concatenate(
            [way, np.full(2 * count * steps, self.placer.size), np.zeros(3 * steps)]
        )
        low = np.concatenate(
            [way - 0.5 * self._length, np.zeros(2 * count * steps), np.full(3 * steps, -np.inf)]
        )
        high = np.concatenate([way + 0.5 * self._length, np.full(len(low) - count, np.inf)])
        g = np.zeros(3 * steps)
        answer = self._solver(
            x0=start,
            lbx=low,
            ubx=high,
            lbg=np.concatenate([g, np.full(apart, self._apart)]),
            ubg=np.concatenate([g, np.full(apart, np.inf)]),
        )
        found = np.array(answer["x"]).ravel()[:count]
        solved = bool(self._solver.stats()["success"])
        return LocalPlacement(np.mod(found, self._length), solved, float(answer["f"]))


def _splines(placer: Placer) -> tuple[ca.Function, ca.Function]:
    """Point and normal over the way, through three rounds of the outline; corners are rounded."""
    outline = placer.outline
    way = (np.arange(3 * _SAMPLES + 1) / _SAMPLES - 1.0) * outline.length
    contacts = outline.at(way)
    grid = [way.tolist()]
    return (
        ca.interpolant("point", "bspline", grid, contacts.points.ravel().tolist()),
        ca.interpolant("normal", "bspline", grid, contacts.normals.ravel().tolist()),
    )
