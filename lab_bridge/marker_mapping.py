"""From a marker frame, as motion capture tells it, to the planar pose of a body in the map.

With A the rotation of ``axes``, u the unit and O the pose of ``origin``: a measured position p and
rotation R become A p u and A R A^T. Both rows of axes are exchanged alike, because a marker frame
is created parallel to the frame of motion capture. The planar pose of the marker frame is then put
behind O, and the offset of the marker frame in the body frame is taken off.
"""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_scenario.lab import UNITS, LabSettings, axes_matrix


@dataclass(frozen=True)
class Marker:
    """A marker frame as it is measured.

    position: ``(3,)`` in axes and unit of motion capture. quaternion: ``(4,)`` x, y, z, w.
    """

    position: Array
    quaternion: Array


@dataclass(frozen=True)
class Placed:
    """A marker frame in the map: the pose of its body ``(3,)``, height [m], tilt [rad]."""

    pose: Array
    height: float
    tilt: float


class MarkerMapping:
    """The mapping of one lab; tells bodies by their names in motion capture."""

    def __init__(self, lab: LabSettings, bodies: Collection[str]) -> None:
        self._axes = axes_matrix(lab.axes)
        self._unit = UNITS[lab.units]
        self._origin = np.array(lab.origin, dtype=np.float64)
        self.markers: Mapping[str, str] = {body: lab.marker(body) for body in bodies}
        """Names in motion capture by body."""
        self.bodies: Mapping[str, str] = {marker: body for body, marker in self.markers.items()}
        """Bodies by their names in motion capture."""
        self._off = {body: se2.inverse(lab.offset(body)) for body in bodies}

    def place(self, body: str, marker: Marker) -> Placed | None:
        """Where a body is; None where the measurement is no pose: not finite, or no rotation."""
        q = np.asarray(marker.quaternion, dtype=np.float64)
        p = np.asarray(marker.position, dtype=np.float64)
        norm = float(np.linalg.norm(q))
        if not (np.isfinite(p).all() and math.isfinite(norm) and 0.5 < norm < 2.0):
            return None
        turn = self._axes @ _rotation(q / norm) @ self._axes.T
        x, y, z = self._unit * (self._axes @ p)
        yaw = math.atan2(turn[1, 0], turn[0, 0])
        planar = se2.compose(self._origin, np.array([x, y, yaw]))
        pose = se2.compose(planar, self._off[body])
        return Placed(pose, float(z), math.acos(max(-1.0, min(1.0, float(turn[2, 2])))))


def _rotation(q: Array) -> Array:
    """``(3, 3)`` of a unit quaternion x, y, z, w."""
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
