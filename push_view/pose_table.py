"""The newest pose of every body in the form for the page: integers in a few arrays."""

from typing import Any

import numpy as np

from push_model.arrays import Array
from push_ros.conversions import time_from_ros
from push_ros.validation import FARTHEST
from push_view.bodies import Bodies

_LENGTH, _ANGLE = 1e4, 1e3  # units per metre and per radian: 0.1 mm, 1 mrad
_STALE = 1.0  # [s] of pose time after which a body that is not seen counts as lost


class PoseTable:
    """poses: ``(n, 3)`` [m, m, rad] by body, nan where it was never seen."""

    def __init__(self, bodies: Bodies) -> None:
        self.bodies = bodies
        self.poses: Array = np.full((len(bodies), 3), np.nan)
        self.time = 0.0
        self._seen = np.full(len(bodies), -np.inf)
        self._index = {name: i for i, name in enumerate(bodies.names)}
        self._names: list[str] = []
        self._rows = np.zeros(0, dtype=np.intp)
        self._columns = np.zeros(0, dtype=np.intp)

    def take(self, message: Any) -> None:
        """Add a frame of push_msgs/Poses; unknown bodies and implausible poses are left out.

        Raises
        ------
        ValueError: the arrays' lengths differ.
        """
        columns = (message.x, message.y, message.theta)
        if {len(c) for c in columns} != {len(message.names)}:
            raise ValueError("a frame's arrays must have the same length")
        names = list(message.names)
        if names != self._names:
            known = [(self._index[n], i) for i, n in enumerate(names) if n in self._index]
            pairs = np.array(known, dtype=np.intp).reshape(-1, 2)
            self._names, self._rows, self._columns = names, pairs[:, 0], pairs[:, 1]
        frame = np.column_stack([np.asarray(c, dtype=np.float64) for c in columns])
        frame = frame[self._columns]
        with np.errstate(invalid="ignore"):
            good = np.abs(frame).max(axis=1, initial=0.0) < FARTHEST  # false for nan
        time = time_from_ros(message.header.stamp)
        if time < self.time:  # the world was reset
            self._seen[:] = -np.inf
        self.time = time
        self.poses[self._rows[good]] = frame[good]
        self._seen[self._rows[good]] = time

    def as_json(self) -> dict[str, Any]:
        """t [s]; x, y [0.1 mm], a [mrad] by body, None where never seen; lost: index of bodies."""
        with np.errstate(invalid="ignore"):
            lost = np.flatnonzero(~(self.time - self._seen <= _STALE))
        scaled = np.round(self.poses * (_LENGTH, _LENGTH, _ANGLE))
        known = np.isfinite(scaled.sum(axis=1))
        whole = np.where(known[:, None], scaled, 0.0).astype(np.int64)
        x, y, a = (column.tolist() for column in whole.T)
        for i in np.flatnonzero(~known).tolist():
            x[i] = y[i] = a[i] = None
        return {"t": round(self.time, 3), "x": x, "y": y, "a": a, "lost": lost.tolist()}
