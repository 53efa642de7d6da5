"""How well a grasp did: (3.2) and (3.3), from recorded poses and contact forces."""

import numpy as np

from push_model import se2
from push_model.arrays import Array


def displacement(objects: Array, agents: Array) -> float:
    """delta of (3.2) [-]: how far the agents slid about the object, over how far it went.

    Parameters
    ----------
    objects: ``(t, 3)`` poses of the object. agents: ``(t, n, 2)`` [m], world frame.
    """
    c, s = np.cos(objects[:, 2])[:, None], np.sin(objects[:, 2])[:, None]
    away = agents - objects[:, None, :2]
    local = np.stack(
        [c * away[..., 0] + s * away[..., 1], -s * away[..., 0] + c * away[..., 1]], axis=-1
    )
    slid = float(np.linalg.norm(np.diff(local, axis=0), axis=-1).sum())
    return slid / path_length(objects[:, :2])


def energy(objects: Array, contacts: Array, forces: Array) -> float:
    """E of (3.3) [N]: work of each contact over the length of its way, added up.

    Parameters
    ----------
    objects: ``(t, 3)`` poses. contacts: ``(n, 2)`` [m] contact points in the object's frame.
    forces: ``(t - 1, n, 2)`` [N] on the object, world frame, mean between two poses.
    """
    total = 0.0
    for i, point in enumerate(contacts):
        way = np.array([se2.transform(pose, point[None])[0] for pose in objects])
        step = np.diff(way, axis=0)
        length = float(np.hypot(*step.T).sum())
        if length > 0.0:
            total += float((forces[:, i] * step).sum()) / length
    return total


def path_length(points: Array) -> float:
    """[m] of a way through points ``(t, 2)``."""
    return float(np.hypot(*np.diff(points, axis=0).T).sum())
