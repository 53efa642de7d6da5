"""A density fitted to an object's outline and to the way that the object is to move.

It lies along the line of the robots that touch the object, more of it where the outline flees
inward faster: behind an object that is to go ahead it is a crescent, about one that is to turn it
has a horn at every side that can turn it. Robots that find no room on the line press from behind.
"""

import numpy as np

from push_model import se2
from push_model.arrays import Array
from swarm_push.density import Density
from swarm_push.rim import Rim

_WIDTH = 0.7  # of the points' distance: the standard deviation of their Gaussians


def crescent(rim: Rim, pose: Array, twist: Array, off: float, least: float) -> Density:
    """About an object at a pose ``(3,)`` that is to move with a twist ``(3,)`` in its frame.

    off: [m] by which it lies outside of the line of contact. least: part of the greatest approach
    from which on a place counts.
    """
    approach = rim.approach(twist)
    part = approach / max(float(approach.max()), 1e-12)
    there = part >= least
    if not there.any():  # nothing is to move: all round
        there, part = np.ones(len(part), dtype=np.bool_), np.ones(len(part))
    means = se2.transform(pose, rim.points[there] - off * rim.normals[there])
    root = np.eye(2) * len(rim.points) / (_WIDTH * rim.length)
    return Density(part[there], means, np.repeat(root[None], len(means), axis=0))
