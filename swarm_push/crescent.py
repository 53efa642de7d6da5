"""A density fitted to an object's outline and to the way that the object is to move.

It lies along the line of the robots that touch the object, more of it where the outline flees
inward faster: behind an object that is to go ahead it is a crescent, about one that is to turn it
has a horn at every side that can turn it. Robots that find no room on the line press from behind.
"""

import numpy as np

from push_model import se2
from push_model.arrays import Array, Mask
from swarm_push.density import Density
from swarm_push.rim import Rim

_WIDTH = 0.7  # of the points' distance: the standard deviation of their Gaussians


def crescent(
    rim: Rim, pose: Array, drive: Array, off: float, least: float, free: Mask | None = None
) -> Density:
    """About an object at a pose ``(3,)``, by how well ``(m,)`` each of the rim's places drives it.

    off: [m] by which it lies outside of the line of contact. least: part of the best drive
    from which on a place counts. free: ``(m,)`` which of the rim's places can be taken; all, where
    none can.
    """
    part = drive / max(float(drive.max()), 1e-12)
    if not drive.max() > 0.0:  # nothing is to move: all round
        part = np.ones(len(part))
    there = part >= least
    if free is not None and (there & free).any():
        there &= free
    means = se2.transform(pose, rim.points[there] - off * rim.normals[there])
    root = np.eye(2) * len(rim.points) / (_WIDTH * rim.length)
    return Density(part[there], means, np.repeat(root[None], len(means), axis=0))
