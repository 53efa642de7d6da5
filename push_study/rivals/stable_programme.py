"""The nonlinear programme of stable pushing: robot and object as one body on a map.

See ``stable_nmpc.py`` for whose method it is, and for what had to be filled in.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.ndimage import distance_transform_edt, uniform_filter1d

from push_model.arrays import Array
from push_model.occupancy import OccupancyGrid
from push_model.shapes import densified
from push_model.specs import ObjectSpec, RobotSpec
from push_model.stable_push import CurvatureLimits

STEPS = 40
"""Number of predicted steps."""
MARGIN = 0.008
"""[m] that robot and object keep from obstacles."""
ACCELERATION = 0.3
"""[m/s^2] of the robot."""
_RESERVE = 0.04  # part of the wheel speed that is not used
_WEIGHTS = 1e4, 500.0, 3.0  # of last position [s/m^2], last heading [s/rad^2], changes of omega
_SHORT = 1e3, 1e4  # of margin that is used up [s/m], [s/m^2]
_PACE = 0.9  # part of the greatest speed that it keeps
_LONGEST = 2.0  # [s] of a step
_SPACING = 0.05  # [m] between points of the object's outline
_COARSER = 2  # cells between points of the spline through distances


@dataclass(frozen=True)
class Plan:
    """poses ``(n + 1, 3)`` of the robot; twists ``(n, 2)`` v, omega; step: [s]. slack: [m] of the
    margin that it uses up. solved: whether IPOPT says so. z, multipliers: to begin the next with.
    """

    poses: Array
    twists: Array
    step: float
    slack: float
    solved: bool
    z: Array
    multipliers: tuple[Any, Any] | None = None

    @property
    def duration(self) -> float:
        """[s]."""
        return self.step * len(self.twists)

    def later(self, dt: float) -> Array:
        """What the programme begins with, dt [s] later."""
        n, poses = len(self.twists), self.poses.copy()
        poses[:-1] += min(1.0, dt / self.step) * np.diff(poses, axis=0)
        step = max(self.step - dt / n, 2e-3)
        return np.concatenate([poses.ravel(), self.twists.ravel(), [step, 0.0]])


class StableProgramme:
    """The programme for a map, a robot and an object."""

    def __init__(self, grid: OccupancyGrid, robot: RobotSpec, item: ObjectSpec) -> None:
        import casadi as ca  # not before it is needed: nodes of other methods do not load it

        n = self.steps = STEPS
        drive, bumper, self.outline = robot.differential, robot.flat_bumper, item.geometry.outline
        top = self.top = (1.0 - _RESERVE) * drive.max_speed
        X, U, h, s = (ca.MX.sym(*a) for a in (("X", 3, n + 1), ("U", 2, n), ("h",), ("s",)))
        P = ca.MX.sym("P", 13)
        start, goal, grasp, low, high, last = P[:3], P[3:6], P[6:9], P[9], P[10], P[11:]
        v, omega = U[0, :], U[1, :]
        middle = X[2, :-1] + 0.5 * h * omega
        moved = h * ca.vertcat(v * ca.cos(middle), v * ca.sin(middle), omega)
        change = ca.horzcat(v, 0.0) - ca.horzcat(last[0], v)  # it ends at rest
        face = [(bumper.distance, sign * bumper.width / 2.0, 0.0) for sign in (1.0, -1.0)]
        own_points = np.array([(0.0, 0.0, robot.body_radius), *face])
        room = _room(ca, grid, own_points, densified(item.geometry.outline, _SPACING))
        equal = ca.vertcat(X[:, 0] - start, ca.vec(X[:, 1:] - X[:, :-1] - moved))
        least = [
            high * v - omega,  # the stable push
            omega - low * v,
            top - v - drive.half_track * omega,  # the wheels
            top - v + drive.half_track * omega,
            ACCELERATION * h - change[1:],  # the first one is left to the commands
            ACCELERATION * h + change[1:],
            room.map(n)(X[:, 1:], ca.repmat(grasp, 1, n)) - MARGIN + s,
        ]
        g = ca.vertcat(equal, *(ca.vec(part) for part in least))
        place, heading, turning = _WEIGHTS
        off, turns = X[:, -1] - goal, omega - ca.horzcat(last[1], omega[:-1])
        cost = n * h + _SHORT[0] * s + _SHORT[1] * s**2 + turning / n * ca.sumsqr(turns)
        cost += place * ca.sumsqr(off[:2]) + heading * off[2] ** 2
        z = ca.vertcat(ca.vec(X), ca.vec(U), h, s)
        first = 3 * (n + 1)
        low_z, high_z = np.full(z.shape[0], -np.inf), np.full(z.shape[0], np.inf)
        low_z[-2:], high_z[-2] = (1e-3, 0.0), _LONGEST
        top_g = np.concatenate(
            [np.zeros(equal.shape[0]), np.full(g.shape[0] - equal.shape[0], np.inf)]
        )
        self._bounds = {"lbx": low_z, "ubx": high_z, "lbg": np.zeros(g.shape[0]), "ubg": top_g}
        self._first, self._half_track = first, drive.half_track
        common: dict[str, Any] = {"print_level": 0, "sb": "yes", "acceptable_tol": 1e-3}
        warm: dict[str, Any] = {f"warm_start_{k}_bound_push": 1e-6 for k in ("slack", "mult")}
        warm |= {"warm_start_bound_push": 1e-6, "warm_start_init_point": "yes"}
        warm |= {"mu_init": 1e-4, "mu_target": 1e-4, "tol": 1e-3, "max_iter": 40}
        cold: dict[str, Any] = {"mu_strategy": "adaptive", "tol": 1e-4, "max_iter": 120}
        problem: dict[str, Any] = {"x": z, "f": cost, "g": g, "p": P}
        quiet: dict[str, Any] = {"print_time": False}
        self._cold, self._warm = (
            ca.nlpsol("push", "ipopt", problem, {**quiet, "ipopt": common | own})
            for own in (cold, warm)
        )

    def solve(
        self,
        robot: Array,
        goal: Array,
        grasp: Array,
        limits: CurvatureLimits,
        last: tuple[float, float],
        begin: Array,
        multipliers: tuple[Any, Any] | None = None,
    ) -> Plan:
        """A plan.

        Parameters
        ----------
        robot, goal: ``(3,)`` poses of the robot, headings not wrapped; now, and with the object at
            its goal. grasp: ``(3,)`` of the object in the robot's frame. last: command in force.
        begin: variables to begin with; multipliers: likewise, of a plan for a similar state.
        """
        p = np.concatenate([robot, goal, grasp, [limits.minimum, limits.maximum], last])
        solver, known = (self._cold, {}) if multipliers is None else (self._warm, multipliers)
        self._bounds["lbx"][self._first : -2 : 2] = self._pace(limits, last[0], float(begin[-2]))
        given = dict(zip(("lam_x0", "lam_g0"), known, strict=False))
        answer = solver(x0=begin, p=p, **self._bounds, **given)
        z, k = np.array(answer["x"]).ravel(), self._first
        return Plan(
            z[:k].reshape(-1, 3),
            z[k:-2].reshape(-1, 2),
            float(z[-2]),
            float(z[-1]),
            bool(solver.stats()["success"]),
            z,
            (answer["lam_x"], answer["lam_g"]),
        )

    def _pace(self, limits: CurvatureLimits, v: float, step: float) -> Array:
        """``(n,)`` least v [m/s]: never astern; and, where it need not speed up or brake, nearly as
        fast as the wheels allow on the tightest bend. It would otherwise wait where its steps skip
        the corner of an obstacle."""
        k, gain = np.arange(self.steps), 0.5 * ACCELERATION * step
        fastest = self.top / (1.0 + self._half_track * max(limits.maximum, -limits.minimum))
        reached = np.minimum(v + gain * (k + 1), gain * k[::-1])
        pace: Array = _PACE * np.minimum(fastest, reached)
        return pace

    def along(self, points: Array, robot: Array, grasp: Array) -> tuple[Array, float]:
        """What to begin with where the object ``(3,)`` ahead of a robot goes along points
        ``(m, 2)``; and the robot's heading at the end."""
        n, speed = self.steps, 0.9 * self.top
        way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
        t = np.linspace(0.0, way[-1], n + 1)
        places = np.column_stack([np.interp(t, way, points[:, i]) for i in range(2)])
        places = uniform_filter1d(places, 7, axis=0, mode="nearest")
        d = np.gradient(places, axis=0)
        heading = np.unwrap(np.arctan2(d[:, 1], d[:, 0]))
        heading += 2.0 * math.pi * round((robot[2] - heading[0]) / (2.0 * math.pi))
        places -= grasp[0] * np.column_stack([np.cos(heading), np.sin(heading)])
        poses = np.column_stack([places, heading])
        poses[0] = robot
        step = [way[-1] / n / speed, 0.0]
        z = np.concatenate([poses.ravel(), np.tile([speed, 0.0], n), step])
        return z, float(heading[-1])


def _room(ca: Any, grid: OccupancyGrid, robot: Array, item: Array) -> Any:
    """Distances [m] from obstacles of discs ``(m, 3)`` of the robot and points ``(k, 2)`` of the
    object, as a function of the robot's pose and of the object's in its frame."""
    r, pad = grid.resolution, 8
    occupied = np.pad(grid.occupied, pad, constant_values=True)
    away = (distance_transform_edt(~occupied) - distance_transform_edt(occupied) - 0.5) * r
    x, y = (grid.origin[i] + (np.arange(occupied.shape[1 - i]) + 0.5 - pad) * r for i in range(2))
    axes = [x[::_COARSER].tolist(), y[::_COARSER].tolist()]
    field = ca.interpolant("away", "bspline", axes, away[::_COARSER, ::_COARSER].ravel().tolist())

    def placed(pose: Any, px: Any, py: Any) -> tuple[Any, Any]:
        c, s = ca.cos(pose[2]), ca.sin(pose[2])
        return pose[0] + c * px - s * py, pose[1] + s * px + c * py

    pose, grasp = ca.MX.sym("pose", 3), ca.MX.sym("grasp", 3)
    rows = [field(ca.vertcat(*placed(pose, px, py))) - radius for px, py, radius in robot]
    rows += [field(ca.vertcat(*placed(pose, *placed(grasp, px, py)))) for px, py in item]
    return ca.Function("room", [pose, grasp], [ca.vertcat(*rows)])


def cubic(start: Array, end: Array, turn: float) -> Array:
    """``(n, 2)`` points of a cubic between two poses ``(3,)``, tangents as long as the way; it
    goes in the direction that lies ``turn`` [rad] to the right of the headings."""
    s = np.linspace(0.0, 1.0, 101)[:, None]
    tangents = np.hypot(*(end - start)[:2]) * np.array(
        [[math.cos(p[2] - turn), math.sin(p[2] - turn)] for p in (start, end)]
    )
    ease, away = 3.0 * s**2 - 2.0 * s**3, s**3 - 2.0 * s**2 + s
    points: Array = (1.0 - ease) * start[:2] + ease * end[:2]
    points += away * tangents[0] + (s**3 - s**2) * tangents[1]
    return points
