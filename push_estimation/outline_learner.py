"""The outline of an object that robots press on, from poses and commands. No ROS, no clock."""

import math
from collections.abc import Collection, Mapping

import numpy as np

from push_estimation.outline_estimate import OutlineEstimate, OutlineSettings
from push_estimation.stopped_robots import StoppedRobots, StoppedSettings
from push_model import se2
from push_model.arrays import Array


class OutlineLearner:
    """Takes commands and frames; gives an outline now and then."""

    def __init__(
        self,
        first: Array,
        radius: float,
        period: float,
        outline: OutlineSettings | None = None,
        stopped: StoppedSettings | None = None,
    ) -> None:
        """first: ``(n, 2)`` [m] outline that is believed before. radius: [m] of the robots.
        period: [s] between estimates."""
        self.estimate = OutlineEstimate(first, radius, outline)
        self._stopped = StoppedRobots(radius, stopped)
        self._period, self._next = period, -math.inf

    def command(self, name: str, stamp: float, vx: float, vy: float, world: bool) -> None:
        """See StoppedRobots."""
        self._stopped.command(name, stamp, vx, vy, world)

    def interrupted(self) -> None:
        """The stream of poses was interrupted, or its clock was reset; what was learned stays."""
        self._stopped.reset()
        self._next = -math.inf

    def frame(
        self,
        stamp: float,
        item: Array,
        robots: Mapping[str, Array],
        others: Array,
        unsure: Collection[str] = (),
    ) -> bool:
        """Poses ``(3,)`` of a frame, and places ``(k, 2)`` [m] of other bodies; whether there is a
        new estimate. unsure: see ``StoppedRobots.frame``."""
        if not robots:
            return False
        for stop in self._stopped.frame(stamp, item, robots, others, self.estimate, unsure):
            self.estimate.stopped(stop.place, stop.way if stop.on_its_way else None)
        points = np.array([p[:2] for p in robots.values()])
        self.estimate.been(se2.transform(se2.inverse(item), points))
        if stamp < self._next:
            return False
        self._next = stamp + self._period
        return self.estimate.fit()
