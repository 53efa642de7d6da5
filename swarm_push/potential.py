"""The middle layer of 4.2.2: where the mean of the swarm is to go, by an artificial potential.

Four zones about the object, (4.5)-(4.8), whose sizes are multiples of its rough radius; the parts
that act at a place are unit vectors, added up.
"""

import math

import numpy as np

from push_model.arrays import Array
from push_model.settings import bounded, settings

_ZERO = 1e-12


@settings
class PotentialSettings:
    """Sizes of the zones, in radii of the object, as printed."""

    repulsion: float = bounded(
        1.4,
        low=1.0,
        high=10.0,
        doc="Radius d_rep of the repulsive zone around the object, as a multiple of the radius of "
        "the object (dimensionless)",
    )
    attraction: float = bounded(
        1.8,
        low=1.0,
        high=10.0,
        doc="Radius d_att of the attractive zone around the object, as a multiple of the radius of "
        "the object (dimensionless)",
    )
    cone: float = bounded(
        0.8,
        low=0.5,
        high=0.99,
        doc="Angle gamma_lim from the desired direction of motion above which a robot counts "
        "as behind the object, as a fraction of pi (dimensionless)",
    )
    wires: float = bounded(
        0.7,
        low=0.1,
        high=1.0,
        doc="Distance of the two wires W_in and W_out of the magnetic zone from the object's "
        "centre, as a multiple of the radius of the object (dimensionless)",
    )
    overlap: float = bounded(
        0.1,
        low=0.0,
        high=0.5,
        doc="Fraction by which zones 3 and 4 of the potential field are widened so that "
        "neighbouring zones overlap (dimensionless)",
    )


def direction_to(item: Array, target: Array) -> Array:
    """(4.5): unit direction ``(2,)`` of the object to its target; zero where it is there."""
    way = np.asarray(target[:2]) - item[:2]
    length = float(np.hypot(*way))
    unit: Array = way / length if length > _ZERO else np.zeros(2)
    return unit


def swarm_input(
    means: Array,
    item: Array,
    direction: Array,
    radius: float,
    settings: PotentialSettings | None = None,
) -> Array:
    """(4.6): u_swarm ``(k, 2)`` of swarms whose means are at ``(k, 2)`` [m].

    item: ``(2,)`` [m] of the object; direction: ``(2,)`` unit, where it is to go; radius: [m] of
    the circle about it. Parts that are zero add nothing. In front of the object, where (4.8) is
    zero, the swarm goes round counter-clockwise.
    """
    s = settings or PotentialSettings()
    d = np.asarray(means, dtype=np.float64).reshape(-1, 2) - item
    away = np.hypot(*d.T)
    cosine = d @ direction / np.maximum(away, _ZERO)
    ahead = np.arccos(np.clip(cosine, -1.0, 1.0)) <= s.cone * math.pi
    repel, attract = s.repulsion * radius, s.attraction * radius
    outer = (1.0 + s.overlap) * attract
    u = np.zeros_like(d)
    u += np.where((ahead & (away < repel))[:, None], _units(d), 0.0)
    u -= np.where((away >= attract)[:, None], _units(d), 0.0)
    magnetic = _units(_magnetic(d, direction, s, radius))
    u += np.where((~ahead & (away <= outer))[:, None], magnetic, 0.0)
    beside = ahead & (away >= (1.0 - s.overlap) * repel) & (away <= outer)
    u += np.where(beside[:, None], _units(_tangential(d, direction)), 0.0)
    return u


def _magnetic(d: Array, direction: Array, s: PotentialSettings, radius: float) -> Array:
    """(4.7): the field of two wires beside the object."""
    across = np.array([-direction[1], direction[0]])
    r_in, r_out = (d + sign * s.wires * radius * across for sign in (1.0, -1.0))
    inner, outer = (np.maximum(np.hypot(*r.T), _ZERO)[:, None] ** 3 for r in (r_in, r_out))
    turned_in = np.column_stack([r_in[:, 1], -r_in[:, 0]])
    turned_out = np.column_stack([-r_out[:, 1], r_out[:, 0]])
    field: Array = turned_in / inner + turned_out / outer
    return field


def _tangential(d: Array, direction: Array) -> Array:
    """(4.8): round the object to its back."""
    cross = direction[0] * d[:, 1] - direction[1] * d[:, 0]
    sign = np.where(np.abs(cross) > 1e-9, cross, 1.0)
    return np.column_stack([-d[:, 1], d[:, 0]]) * sign[:, None]


def _units(vectors: Array) -> Array:
    length = np.hypot(*vectors.T)[:, None]
    units: Array = np.where(length > _ZERO, vectors / np.maximum(length, _ZERO), 0.0)
    return units
