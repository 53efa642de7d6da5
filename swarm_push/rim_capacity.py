"""How much force robots at an object's rim can apply to it, and how many robots a motion needs.

A quasi-static motion needs the wrench of the floor's limit surface. Robots make it by contact
forces within their friction cones, each at most its traction. How much of it they make at best is a
linear programme over the forces at all places of the rim:

    maximise lambda  subject to  G f = lambda w,  f in the cones,
    the normal forces within any 2 R of the rim <= F,  all normal forces together <= n F

for n robots of radius R and traction F. Two robots in contact are at least 2 R apart, so that no
placement of n robots makes more than lambda w: a motion that is called impossible is impossible.
That placement exists which makes as much is not claimed.
"""

import math

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import csr_matrix, hstack, vstack

from push_model.arrays import Array
from push_model.coulomb import cone_edges
from push_model.grasp import grasp_matrix
from push_model.specs import ObjectSpec, RobotSpec
from push_model.traction import traction
from swarm_push.rim import Rim

_PARTS = 4  # places of the rim within a robot's diameter
_EXACT = 1e-6  # of a wrench


class RimCapacity:
    """Forces that round robots of one type can apply to one object.

    traction: [N] with which one robot can push at most. That it leans back as it pushes takes some
    of the load off its wheels (``push_model.traction``); as much as that is not certain, it is left
    out, and so is the load that friction at the bumper puts on the object.
    """

    def __init__(self, item: ObjectSpec, robot: RobotSpec) -> None:
        radius = robot.footprint_radius
        self.traction = traction(robot, 0.0)
        self._surface = item.limit_surface()
        rim = Rim(item.geometry.outline, radius, 2.0 * radius / _PARTS)
        count = len(rim.points)
        edges = np.array([cone_edges(n, item.contact_friction) for n in rim.normals])
        edges *= math.hypot(1.0, item.contact_friction)  # a normal force of 1 N each
        G = grasp_matrix(rim.points + radius * rim.normals).reshape(3, count, 2)
        self._scale = np.array([1.0, 1.0, self._surface.radius])
        columns = np.einsum("ikj,klj->ikl", G, edges).reshape(3, 2 * count)
        self._columns = columns / self._scale[:, None]
        # Places less than a diameter apart along the rim: at most one robot is there.
        reach = math.ceil(2.0 * radius * count / rim.length - 1e-9)
        window = (np.arange(count)[:, None] + np.arange(min(reach, count))[None]) % count
        rows = np.repeat(np.arange(count), 2 * window.shape[1])
        taken = np.stack([2 * window, 2 * window + 1], axis=2).ravel()
        self._windows = csr_matrix((np.ones(len(rows)), (rows, taken)), (count, 2 * count))

    def needed_force(self, twist: Array) -> float:
        """[N] of the wrench that a twist ``(3,)`` in the object's frame takes, its torque divided
        by the limit surface's radius."""
        return float(np.linalg.norm(self._wrench(twist)))

    def available_force(self, twist: Array, robots: int) -> float:
        """[N] that so many robots can make at best along the wrench of a twist ``(3,)``."""
        wrench = self._wrench(twist)
        size = float(np.linalg.norm(wrench))
        if size <= 0.0 or robots <= 0:
            return 0.0
        count = self._windows.shape[0]
        # Unknowns: normal forces over the traction, two of each place, and the force that is made.
        total = csr_matrix(np.ones((1, 2 * count)))
        limits = hstack([vstack([self._windows, total]), csr_matrix((count + 1, 1))])
        equal = np.column_stack([self._columns, -wrench / size])
        cost = np.zeros(2 * count + 1)
        cost[-1] = -1.0
        bounds = np.ones(count + 1)
        bounds[-1] = float(robots)
        found = linprog(cost, limits, bounds, equal, np.zeros(3), method="highs")
        return self.traction * float(found.x[-1]) if found.success else 0.0

    def least_robots(self, twist: Array) -> int | None:
        """The fewest robots that may be able to move the object along a twist ``(3,)``; None where
        no number of them is, because no more find room where it is pushed from."""
        needed = self.needed_force(twist) * (1.0 - _EXACT)
        if needed <= 0.0:
            return 0
        low = max(1, math.ceil(needed / (self.traction * self._steepest())))
        most = self._windows.shape[0]
        if self.available_force(twist, most) < needed:
            return None
        high = low
        while self.available_force(twist, high) < needed:
            low, high = high + 1, min(2 * high, most)
        while low < high:
            middle = (low + high) // 2
            if self.available_force(twist, middle) < needed:
                low = middle + 1
            else:
                high = middle
        return high

    def _wrench(self, twist: Array) -> Array:
        wrench: Array = self._surface.wrench(twist) / self._scale
        return wrench

    def _steepest(self) -> float:
        """The greatest scaled wrench that a normal force of 1 N makes."""
        return float(np.linalg.norm(self._columns, axis=0).max())
