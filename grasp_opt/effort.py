"""What a push will cost: the least contact forces that a task needs, and the energy (3.3) of them.

Which forces rigid pushers really exert is not determined by statics: they may squeeze the object
for nothing. The least forces (in the sense of squares) are the ones that compliant pushers share,
and squeezing does no work on a rigid object, so that the energy is nearly theirs.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from grasp_opt.contact_outline import Contacts
from push_model.arrays import Array
from push_model.coulomb import cone_edges
from push_model.grasp import grasp_matrix
from push_model.limit_surface import EllipsoidLimitSurface

_WEIGHT = 1e-3  # of forces beside what they leave of the wrench


@dataclass(frozen=True)
class Effort:
    """forces ``(m, n, 2)`` [N] of each contact for each twist, in the object's frame.

    energy: E of (3.3) [N] that they make. lacking: the greatest part of a wrench that no forces
    within the friction cones make up.
    """

    forces: Array
    energy: float
    lacking: float


def least_effort(
    contacts: Contacts, friction: float, twists: Array, surface: EllipsoidLimitSurface
) -> Effort:
    """Least effort of a grasp that moves the object with twists ``(m, 3)``, given at even times in
    the frame of the object."""
    n = len(contacts.points)
    edges = np.array([cone_edges(normal, friction) for normal in contacts.normals])
    scale = np.array([1.0, 1.0, surface.radius])
    G = grasp_matrix(contacts.points) / scale[:, None]
    spread = np.zeros((2 * n, 2 * n))
    for i in range(n):
        spread[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = edges[i].T
    A = np.vstack([G @ spread, _WEIGHT * spread])
    forces = np.zeros((len(twists), n, 2))
    lacking = 0.0
    for k, twist in enumerate(twists):
        wrench = surface.wrench(twist) / scale
        size = float(np.linalg.norm(wrench))
        if size == 0.0:
            continue
        answer, _ = nnls(A, np.concatenate([wrench, np.zeros(2 * n)]))
        forces[k] = (spread @ answer).reshape(n, 2)
        left = wrench - G @ forces[k].ravel()
        lacking = max(lacking, float(np.linalg.norm(left)) / size)
    x, y = contacts.points.T
    v = np.stack([twists[:, :1] - twists[:, 2:] * y, twists[:, 1:2] + twists[:, 2:] * x], axis=-1)
    ways = np.linalg.norm(v, axis=-1).sum(axis=0)
    work = (forces * v).sum(axis=(0, 2))
    return Effort(forces, float((work[ways > 0.0] / ways[ways > 0.0]).sum()), lacking)
