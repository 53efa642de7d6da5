"""Densities that a swarm spreads over: sums of Gaussians, (4.2)-(4.3).

Whatever a swarm is to cover is written as such a sum; a further density is a function that returns
one, as ``gaussian`` here and ``crescent`` in ``crescent.py`` do.
"""

import math
from dataclasses import dataclass

import numpy as np

from push_model.arrays import Array


@dataclass(frozen=True)
class Density:
    """weights ``(k,)`` positive factors; means ``(k, 2)`` [m]; roots ``(k, 2, 2)`` [1/m].

    With d = q - mean, the value is the sum of weight * exp(-|root d|^2 / 2): root' root is the
    inverse of the covariance, that is 2 B of (4.2). Determinants of roots are positive.
    """

    weights: Array
    means: Array
    roots: Array

    def at(self, points: Array) -> Array:
        """Values ``(n,)`` at points ``(n, 2)`` [m]."""
        d = np.einsum("kij,nkj->nki", self.roots, points[:, None] - self.means)
        values: Array = (self.weights * np.exp(-0.5 * (d**2).sum(axis=2))).sum(axis=1)
        return values

    @property
    def mean(self) -> Array:
        """``(2,)`` [m] of the whole plane's mass."""
        mass = self.weights / np.linalg.det(self.roots)
        mean: Array = mass @ self.means / mass.sum()
        return mean


def gaussian(mean: Array, sigma_x: float, sigma_y: float, angle: float) -> Density:
    """(4.2)-(4.3): one Gaussian about mean ``(2,)`` [m].

    sigma_x, sigma_y: [m] standard deviations along its own axes, of which the first is turned by
    ``angle`` [rad]. The printed (4.2) lacks the minus sign, and (4.3) has 2 where 4 belongs.
    """
    c, s = math.cos(angle), math.sin(angle)
    root = np.array([[c / sigma_x, s / sigma_x], [-s / sigma_y, c / sigma_y]])
    return Density(np.ones(1), np.asarray(mean, dtype=np.float64)[None], root[None])


def tangential(mean: Array, item: Array, across: float, along: float) -> Density:
    """The Gaussian of the lower layer: ``across`` [m] is its deviation tangential to the object at
    ``item (2,)``, ``along`` [m] that towards it. Defined also where both are at one place."""
    d = item - mean
    return gaussian(mean, across, along, math.atan2(d[1], d[0]) - 0.5 * math.pi)
