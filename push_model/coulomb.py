"""Coulomb friction at a point contact in the plane."""

import math

import numpy as np

from push_model.arrays import Array


def cone_angle(friction: float) -> float:
    """Half angle theta_mu [rad] of the friction cone, (2.34)."""
    if friction < 0.0:
        raise ValueError(f"friction coefficient must not be negative, got {friction}")
    return math.atan(friction)


def cone_edges(normal: Array, friction: float) -> Array:
    """Unit directions ``(2, 2)`` of the cone's right and left edges (rows), seen along the normal,
    (3.14). Forces in the cone are their sums with coefficients that are not negative, (3.15).

    Parameters
    ----------
    normal: ``(2,)`` unit vector along which the contact can push.
    """
    angle = cone_angle(friction)
    heading = math.atan2(normal[1], normal[0])
    return np.array(
        [
            [math.cos(heading - angle), math.sin(heading - angle)],
            [math.cos(heading + angle), math.sin(heading + angle)],
        ]
    )


def in_cone(force: Array, normal: Array, friction: float, tolerance: float = 1e-9) -> bool:
    """Whether the force ``(2,)`` lies in the closed friction cone about the normal ``(2,)``."""
    along = float(force @ normal)
    across = float(normal[0] * force[1] - normal[1] * force[0])
    return abs(across) <= friction * along + tolerance * float(np.hypot(*force))
