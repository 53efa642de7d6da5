"""Moving obstacles of a controller: other bodies, where they are now."""

import math

import numpy as np

from push_model.arrays import Array


def kept_off(me: Array, bodies: Array) -> Array:
    """Bodies to keep away from ``(n, 3)``: x, y, least distance of the axle midpoint [m].

    One that came closer than that is not fled from: it must come no closer.

    Parameters
    ----------
    me: pose ``(3,)`` of the robot. bodies: ``(n, 3)`` x, y, and the distance that is wanted.
    """
    rows = [(x, y, min(reach, math.hypot(x - me[0], y - me[1]))) for x, y, reach in bodies]
    return np.array(rows, dtype=np.float64).reshape(-1, 3)
