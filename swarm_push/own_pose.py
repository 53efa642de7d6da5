"""Where a robot believes that it is on its map: odometry, corrected by its scan of the walls.

An extended Kalman filter of the pose [m, m, rad]. Its prediction is odometry. Each point of the
scan is compared with the side of a wall that it probably lies on: the nearest one that faces the
robot. Its distance from that side is the innovation (point to line).
"""

import math
from typing import Any

import numba
import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.settings import bounded, settings

# Standard deviations of the odometry of a robot that stands, one step: they keep the filter open
# to the scan after a long rest.
_LEAST_SLIP = 2e-4  # [m]
_LEAST_TURN = 5e-4  # [rad]


@settings
class OwnPoseSettings:
    """Errors of what a robot is told and of its scan, as standard deviations that it knows."""

    start_position: float = bounded(
        0.01,
        low=0.0,
        high=1.0,
        doc="Standard deviation of the error of the position that a robot is told at the start (m)",
    )
    start_heading: float = bounded(
        0.02,
        low=0.0,
        high=1.0,
        doc="Standard deviation of the error of the heading that a robot "
        "is told at the start (rad)",
    )
    gate: float = bounded(
        0.1,
        low=0.01,
        high=10.0,
        doc="Distance from all sides of walls on the map above which a scanned point is not used "
        "for the pose estimate of a robot (m)",
    )
    scan_error: float = bounded(
        0.02,
        low=1e-3,
        high=1.0,
        doc="Standard deviation of the distance of a scanned point from its wall that the pose "
        "estimate of a robot assumes (m). It is greater than that of the sensor, because the "
        "errors of points on the same wall are not independent",
    )


class OwnPose:
    """The estimate of one robot. pose ``(3,)`` [m, m, rad] on the map; covariance ``(3, 3)``."""

    def __init__(
        self, sides: Array, pose: Array, odometry_error: float, settings: OwnPoseSettings
    ) -> None:
        """sides ``(n, 2, 2)`` [m]: see ``wall_sides``; pose: as told. odometry_error: as a fraction
        of the motion."""
        self.pose = np.array(pose, dtype=np.float64)
        s = self._settings = settings
        self._sides, self._slip = sides, odometry_error
        self.covariance = np.diag(
            np.square([s.start_position, s.start_position, s.start_heading]) + 1e-12
        )

    def step(self, moved: Array, scan: Array) -> None:
        """moved ``(3,)``: pose in the robot's frame before; scan ``(k, 2)`` [m] in its frame."""
        s = self._settings
        _predict(self.pose, self.covariance, moved, self._slip)
        if len(scan):
            _correct(self.pose, self.covariance, self._sides, scan, s.gate, s.scan_error)
        self.pose[2] = se2.wrap(float(self.pose[2]))


@numba.njit(cache=True, error_model="numpy")
def _predict(pose: Any, covariance: Any, moved: Any, slip: float) -> None:
    c, s = math.cos(pose[2]), math.sin(pose[2])
    dx, dy = c * moved[0] - s * moved[1], s * moved[0] + c * moved[1]
    turn = np.eye(3)
    turn[0, 2], turn[1, 2] = -dy, dx
    along = _LEAST_SLIP + slip * math.hypot(moved[0], moved[1])
    covariance[:] = turn @ covariance @ turn.T
    covariance[0, 0] += along * along
    covariance[1, 1] += along * along
    covariance[2, 2] += (_LEAST_TURN + slip * abs(moved[2])) ** 2
    pose[0] += dx
    pose[1] += dy
    pose[2] += moved[2]


@numba.njit(cache=True, error_model="numpy")
def _facing(pose: Any, sides: Any, most: float) -> Any:
    """``(m, 5)``: start, direction and length of the sides that face a robot and come closer to it
    than ``most`` [m]."""
    found = np.empty((sides.shape[0], 5))
    count = 0
    for j in range(sides.shape[0]):
        ax, ay = sides[j, 0, 0], sides[j, 0, 1]
        ex, ey = sides[j, 1, 0] - ax, sides[j, 1, 1] - ay
        length = math.hypot(ex, ey)
        ex, ey = ex / length, ey / length
        x, y = pose[0] - ax, pose[1] - ay
        along, across = x * ex + y * ey, ex * y - ey * x
        if across > 0.0 and math.hypot(across, max(0.0, -along, along - length)) < most:
            found[count] = ax, ay, ex, ey, length
            count += 1
    return found[:count]


@numba.njit(cache=True, error_model="numpy")
def _correct(pose: Any, covariance: Any, sides: Any, scan: Any, gate: float, error: float) -> None:
    """One step of the filter in its information form: all points of a scan at once."""
    information, pull = np.linalg.inv(covariance), np.zeros(3)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    h = np.empty(3)
    weight = 1.0 / (error * error)
    reach = 0.0
    for k in range(scan.shape[0]):
        reach = max(reach, math.hypot(scan[k, 0], scan[k, 1]))
    near = _facing(pose, sides, reach + gate + 1e-9)
    for k in range(scan.shape[0]):
        rx, ry = c * scan[k, 0] - s * scan[k, 1], s * scan[k, 0] + c * scan[k, 1]
        x, y = pose[0] + rx, pose[1] + ry
        best, off, nx, ny = gate, 0.0, 0.0, 0.0
        for j in range(near.shape[0]):
            ax, ay, ex, ey, length = near[j]
            along = (x - ax) * ex + (y - ay) * ey
            across = ex * (y - ay) - ey * (x - ax)
            beyond = max(0.0, -along, along - length)
            away = math.hypot(across, beyond)
            if away < best:
                best, off, nx, ny = away, across, -ey, ex
        if best >= gate:
            continue
        h[0], h[1], h[2] = nx, ny, nx * -ry + ny * rx
        for a in range(3):
            pull[a] -= weight * h[a] * off
            for b in range(3):
                information[a, b] += weight * h[a] * h[b]
    covariance[:] = np.linalg.inv(information)
    pose += covariance @ pull
