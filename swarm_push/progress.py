"""How far the job of a swarm has come: its targets, and when something was last achieved."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from push_model import se2
from push_model.arrays import Array

_CLOSER = 5e-3  # [m] that the object must come closer for it to count as progress


@dataclass
class TargetQueue:
    """The targets of a job, one after the other.

    poses: ``(3,)`` each, of the centre of mass, headings nan where any will do. index: of the one
    that is pursued; the number of targets when all are reached. times: [s] that each took.
    """

    poses: tuple[Array, ...] = ()
    index: int = 0
    times: list[float] = field(default_factory=list)
    begun: float | None = None
    """[s] when the first tick came; None before."""

    @classmethod
    def of(cls, targets: Sequence[Array]) -> "TargetQueue":
        """The targets of a job that begins."""
        return cls(tuple(np.array(t, dtype=np.float64) for t in targets))

    @property
    def current(self) -> Array | None:
        """``(3,)`` that is pursued, or was last."""
        return self.poses[min(self.index, len(self.poses) - 1)] if self.poses else None

    @property
    def finished(self) -> bool:
        """Whether all are reached."""
        return self.index >= len(self.poses)

    def replace_current(self, target: Array) -> None:
        """The target that is pursued was moved."""
        moved = np.array(target, dtype=np.float64)
        self.poses = (*self.poses[: self.index], moved, *self.poses[self.index + 1 :])

    def about(self, point: Array) -> None:
        """Tell them of another point ``(2,)`` [m] of the object, where the centre of mass is
        believed to be. Targets without a heading are places of the centre of mass itself."""
        off = np.array([*point, 0.0])
        self.poses = tuple(p if np.isnan(p[2]) else se2.compose(p, off) for p in self.poses)

    def advance(self, now: float) -> None:
        """The target that is pursued is reached at a time [s]."""
        assert self.begun is not None
        self.times.append(now - self.begun - sum(self.times))
        self.index += 1


@dataclass
class Progress:
    """Progress towards one target.

    nearest: [m] of way that was left at least. closer: [s] when the object last came closer; able:
    [s] when there were last enough robots.
    """

    nearest: float = math.inf
    closer: float = 0.0
    able: float = 0.0

    def begin(self, now: float) -> None:
        """A job begins at a time [s]."""
        self.nearest, self.closer, self.able = math.inf, now, now

    def look(self, now: float, left: float) -> None:
        """[m] of way are left at a time [s]."""
        if left < self.nearest - _CLOSER:
            self.nearest, self.closer = left, now

    def allow(self, left: float) -> None:
        """A longer way was planned: what is left [m] of it is no step back."""
        self.nearest = max(self.nearest, left)

    def forget(self) -> None:
        """What is left is measured to somewhere else from now on."""
        self.nearest = math.inf
