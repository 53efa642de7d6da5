"""A density fitted to an object's outline and to its desired motion.

It lies along the object's rim and is larger where the outline recedes faster from a robot there.
For an object that is to move ahead it is a crescent behind it; for one that is to turn it has a
maximum at every side from which the object can be turned. Robots that find no room on the rim queue
behind it.
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
