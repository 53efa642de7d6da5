"""Limit surfaces: the friction wrench between a sliding object and its support.

Goyal, Ruina & Papadopoulos (1991); ellipsoid after Howe & Cutkosky (1996). All twists and wrenches
are taken at the centre of mass: twist ``(vx, vy, omega)`` in [m/s, m/s, rad/s], wrench
``(fx, fy, torque)`` in [N, N, Nm]. The wrench is the one that a pusher must apply to keep the
motion going, i.e. minus the friction on the object.
"""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from push_model.arrays import Array
from push_model.shapes import Shape

GRAVITY = 9.81
"""[m/s^2]."""


class LimitSurface(Protocol):
    """Maps a sliding direction to the wrench that sustains it."""

    def wrench(self, twist: Array) -> Array:
        """Quasi-static wrench ``(3,)`` for a twist ``(3,)``; zero for a zero twist."""
        ...


@dataclass(frozen=True)
class EllipsoidLimitSurface:
    """The ellipsoid (fx/f)^2 + (fy/f)^2 + (torque/m)^2 = 1.

    max_force: [N] f, mu m g.
    max_torque: [Nm] m, about the centre of mass.
    """

    max_force: float
    max_torque: float

    def __post_init__(self) -> None:
        if not (self.max_force > 0.0 and self.max_torque > 0.0):
            raise ValueError("a limit surface needs a positive force and a positive torque")

    @property
    def radius(self) -> float:
        """[m] c, the ratio of greatest torque to greatest force."""
        return self.max_torque / self.max_force

    @property
    def wrench_metric(self) -> Array:
        """``(3, 3)`` H of (2.42): the twist is proportional to H w."""
        return np.diag([self.max_force**-2.0, self.max_force**-2.0, self.max_torque**-2.0])

    @property
    def twist_metric(self) -> Array:
        """``(3, 3)`` the inverse of H, which (3.4) needs: w = metric v / sqrt(v' metric v)."""
        return np.diag([self.max_force**2.0, self.max_force**2.0, self.max_torque**2.0])

    def wrench(self, twist: Array) -> Array:
        """(3.4), (3.21): wrench ``(3,)`` that keeps up a twist ``(3,)`` against the floor."""
        twist = _direction(twist)
        weighted: Array = self.twist_metric @ twist
        power = float(twist @ weighted)
        return np.zeros(3) if power <= 0.0 else weighted / math.sqrt(power)

    def twist_direction(self, wrench: Array) -> Array:
        """(2.42): a twist ``(3,)`` with the direction that the wrench on the surface causes."""
        twist: Array = self.wrench_metric @ wrench
        return twist


@dataclass(frozen=True)
class PressureLimitSurface:
    """Exact limit surface of a pressure distribution given as weighted points.

    points: ``(n, 2)`` [m] about the centre of mass.
    weights: ``(n,)`` share of the load, sums to 1.
    max_force: [N] mu m g.
    """

    points: Array
    weights: Array
    max_force: float

    @classmethod
    def uniform(cls, shape: Shape, max_force: float, points: int = 4000) -> "PressureLimitSurface":
        """Uniform pressure over the shape, by a mid-point rule on a fan of triangles."""
        vertices = shape.outline
        m = max(2, round(math.sqrt(points / len(vertices))))
        rows, columns = np.meshgrid(np.arange(m), np.arange(m), indexing="ij")
        i, j = rows.ravel(), columns.ravel()
        up = np.column_stack([i + 1.0 / 3.0, j + 1.0 / 3.0])[i + j < m] / m
        down = np.column_stack([i + 2.0 / 3.0, j + 2.0 / 3.0])[i + j < m - 1] / m
        cells = np.vstack([up, down])
        a, b = vertices, np.roll(vertices, -1, axis=0)
        grid = cells[None, :, :1] * a[:, None, :] + cells[None, :, 1:] * b[:, None, :]
        area = (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2.0
        weights = np.repeat(area / area.sum() / len(cells), len(cells))
        return cls(grid.reshape(-1, 2), weights, max_force)

    def wrench(self, twist: Array) -> Array:
        """The wrench of Coulomb friction, summed over the points."""
        twist = _direction(twist)
        vx = twist[0] - twist[2] * self.points[:, 1]
        vy = twist[1] + twist[2] * self.points[:, 0]
        speed = np.hypot(vx, vy)
        share = self.max_force * self.weights / np.where(speed > 0.0, speed, np.inf)
        fx, fy = share * vx, share * vy
        torque = self.points[:, 0] @ fy - self.points[:, 1] @ fx
        return np.array([fx.sum(), fy.sum(), torque])

    def ellipsoid(self) -> EllipsoidLimitSurface:
        """The ellipsoid with the same greatest force and pure-spin torque."""
        torque = self.max_force * float(self.weights @ np.hypot(*self.points.T))
        return EllipsoidLimitSurface(self.max_force, torque)


def _direction(twist: Array) -> Array:
    """The twist scaled to unit size; zero if it is too small to have a direction."""
    size = float(np.abs(twist).max())
    direction: Array = twist / size if size > 1e-100 else np.zeros(3)
    return direction


def uniform_pressure_radius(shape: Shape) -> float:
    """[m] c: pure-spin torque over greatest force for uniform pressure (0.7652 a for a square)."""
    return PressureLimitSurface.uniform(shape, 1.0, points=20000).ellipsoid().radius
