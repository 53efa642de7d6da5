"""Lower bounds on the way of a point among obstacles, from one pose to all places of a map."""

import math
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np

from push_model.arrays import Array
from push_model.distance_field import DistanceField
from push_model.flood import Flood

_STRIDE, _PLACES = 2, 100000  # [lattice spacings] between places of a flood; so many about at most
_OCTAGON = math.cos(math.pi / 8.0)  # of a path of straight and diagonal steps: the shortest one
_ENDS = 1.0  # [strides] that such a path may be longer than that (tested: none was)


@numba.njit(cache=True)  # infinities: no fast mathematics
def way_at(ways: Any, x: float, y: float, half: float, ox: float, oy: float, scale: float) -> float:
    """Least value [m] at the places in and about a square; infinite if it has none.

    The square is ``2 half`` [m] wide. The values at both sides of a wall differ by more than the
    square is wide, so that the value in the middle says nothing of the others.

    ways, ox, oy, scale: those of a ``LeastWays``.
    """
    levels, rows, columns = ways.shape
    bottom = max(0, int(math.floor((y - half - oy) * scale)))
    left = max(0, int(math.floor((x - half - ox) * scale)))
    top = min(rows - 1, int(math.floor((y + half - oy) * scale)) + 1)
    right = min(columns - 1, int(math.floor((x + half - ox) * scale)) + 1)
    if top < bottom or right < left:
        return math.inf
    level = min(levels - 1, int(math.log2(min(top - bottom, right - left) + 1)))
    size = 1 << level
    least = math.inf
    i = bottom
    while True:
        j = left
        while True:
            least = min(least, ways[level, i, j])
            if j + size > right:
                break
            j = min(j + size, right - size + 1)
        if i + size > top:
            break
        i = min(i + size, top - size + 1)
    return float(least)


def _windows(ways: Array) -> Array:
    """``(levels, rows, columns)`` least values of windows ``(2**level, 2**level)``, each at its
    first row and column; windows at the end are cut off."""
    levels = [ways]
    size = 1
    while 2 * size <= min(ways.shape):
        pairs = levels[-1].copy()
        pairs[:-size] = np.minimum(pairs[:-size], levels[-1][size:])
        whole = pairs.copy()
        whole[:, :-size] = np.minimum(whole[:, :-size], pairs[:, size:])
        levels.append(whole)
        size *= 2
    return np.array(levels)


@dataclass(frozen=True)
class LeastWays:
    """Lower bounds [m] of the way of a point between one position and the others on a map.

    levels: ``(levels, rows, columns)`` [m], for ``way_at``. ox, oy: [m] the first place. scale:
    [1/m] places per metre.
    """

    levels: Array
    ox: float
    oy: float
    scale: float

    @property
    def places(self) -> tuple[float, float, float]:
        """ox, oy, scale."""
        return self.ox, self.oy, self.scale

    def at(self, position: Array, half: float = 0.0) -> float:
        """[m] to a position ``(2,)``, or to the nearest one in a square about it."""
        return float(
            way_at(self.levels, position[0], position[1], half, self.ox, self.oy, self.scale)
        )


def least_ways(field: DistanceField, pose: Array, least: float) -> LeastWays:
    """Ways between a pose and the places of a flood; the point keeps ``least`` [m] from obstacles.

    Every point with the clearance ``least`` has a place about it with less than half a diagonal
    less.
    """
    ox, oy, scale = field.args
    stride = max(_STRIDE, math.ceil(math.sqrt(field.values.size / _PLACES)))
    need = max(0.0, least * scale - stride / math.sqrt(2.0))
    flood = Flood(field.values, np.zeros((0, 5)), need, stride)
    rows, columns = flood.state.shape
    u, v = (pose[0] - ox) * scale / stride, (pose[1] - oy) * scale / stride
    about = [(i, j) for i in (int(v), int(v) + 1) for j in (int(u), int(u) + 1)]
    flood.begin(np.array([(i, j, 0) for i, j in about if i < rows and j < columns]))
    flood.step(rows * columns)
    ways = _windows(np.maximum(_OCTAGON * flood.lengths - _ENDS * stride, 0.0) / scale)
    return LeastWays(ways, ox, oy, scale / stride)
