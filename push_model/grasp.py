"""Grasp matrices: from contact forces to the wrench on the object, (2.40)-(2.41), (3.1), (3.12)."""

import math

import numpy as np

from push_model.arrays import Array
from push_model.coulomb import cone_edges


def grasp_matrix(points: Array, centre: Array | None = None) -> Array:
    """G of (3.1) and (3.12): stacked planar contact forces to the wrench about the centre of mass.

    Parameters
    ----------
    points: ``(n, 2)`` [m] contact points.
    centre: ``(2,)`` [m] centre of mass in the same frame; the origin when absent.

    Returns
    -------
    ``(3, 2n)``: rows fx, fy, torque; columns fx and fy of each contact.
    """
    arms = np.asarray(points, dtype=np.float64) - (0.0 if centre is None else centre)
    matrix = np.zeros((3, 2 * len(arms)))
    matrix[0, 0::2] = 1.0
    matrix[1, 1::2] = 1.0
    matrix[2, 0::2] = -arms[:, 1]
    matrix[2, 1::2] = arms[:, 0]
    return matrix


def line_contact_grasp(
    distance: float, right: float, left: float, friction: float, heading: float = 0.0
) -> Array:
    """Grasp matrix of a line contact in friction-cone coordinates, (2.41) for any polygon side.

    The pusher looks along x at the object's centre of mass, which lies ``distance`` ahead of the
    contact line. The columns are the unit wrenches of f_1R, f_1L (contact 1, the robot's right end)
    and f_2R, f_2L (contact 2, its left end), R and L being the right and left edges of the cone.

    Parameters
    ----------
    distance: [m] from the contact line to the centre of mass.
    right, left: [m] lateral coordinates of the contact's ends relative to the centre of mass,
        right < left.
    friction: coefficient of the contact.
    heading: [rad] theta_r; forces are expressed in the frame in which the robot has this heading.

    Returns
    -------
    ``(3, 4)``; for a square of side 2s, (2.41) is ``line_contact_grasp(s, -s, s, mu, theta_r)``.
    """
    edges = cone_edges(np.array([1.0, 0.0]), friction)
    c, s = math.cos(heading), math.sin(heading)
    columns = []
    for lateral in (right, left):
        for fx, fy in edges:
            torque = -distance * fy - lateral * fx
            columns.append([c * fx - s * fy, s * fx + c * fy, torque])
    return np.array(columns).T
