"""Time along the reference, which waits for a robot that lags behind."""

import math

import numpy as np

from push_model.arrays import Array
from push_model.trajectory import Trajectory
from push_mpc.controller import Held, Reference
from push_mpc.settings import TrackerSettings

# Of the nominal pace. A slower reference is stopped; otherwise it would approach lag_end for ever
# in front of a robot that does not move.
_HALTED = 0.02
_SHORTEST = 1e-3  # [s] over which an acceleration is told


class ReferenceClock:
    """Time along a trajectory, which runs slower than the clock while the robot lags behind.

    time: [s] along the trajectory; halted: [s] since it last advanced.
    """

    def __init__(self, settings: TrackerSettings, trajectory: Trajectory) -> None:
        self._settings = settings
        self.trajectory = trajectory
        self.time = 0.0
        self.halted = 0.0
        self._rate = 0.0
        self._passed = 0.0  # [s] of the trajectory, since the last command

    def moved_to(self, trajectory: Trajectory) -> "ReferenceClock":
        """A clock of another trajectory, which begins like this one, at the same place."""
        old, new = self.trajectory, trajectory
        way = float(np.interp(self.time, old.time, old.travelled))
        clock = ReferenceClock(self._settings, new)
        clock.time = float(np.interp(way, new.travelled, new.time))
        clock._rate, clock._passed = self._rate, self._passed
        return clock

    @property
    def ended(self) -> bool:
        """Whether the trajectory is over."""
        return self.time >= self.trajectory.duration

    @property
    def progress(self) -> float:
        """Completed fraction of the trajectory, 0 to 1."""
        return min(1.0, self.time / self.trajectory.duration)

    def advance(self, dt: float, lag: float) -> None:
        """Advance by dt [s], with the robot lag [m] behind."""
        s = self._settings
        self._rate = min(1.0, max(0.0, (s.lag_end - lag) / (s.lag_end - s.lag_begin)))
        self.halted = self.halted + dt if self._rate < _HALTED and not self.ended else 0.0
        before = self.time
        self.time = min(before + self._rate * dt, self.trajectory.duration)
        self._passed = self.time - before

    def reference(self, horizon: int, step: float, shift: Array, dt: float) -> Reference:
        """The reference from now on, at the present pace, in frames moved by shift ``(3,)``.

        dt: [s] between two commands. shift: pose of the wanted robot frame in the trajectory's
        frame; its twist is that of a frame fixed to the trajectory's, so that it slides sideways
        when it sits ahead in a bend.
        """
        rate = self._rate
        dt = max(dt, _SHORTEST)
        times = self.time + rate * step * np.arange(horizon + 3)
        # A command is held: the means are the velocities in the middle.
        times[-2:] = self.time - 0.5 * self._passed, self.time + 0.5 * rate * dt
        pose, twist = self.trajectory.sample(times)
        v, omega = rate * twist[:, 0], rate * twist[:, 1]
        c, sn = np.cos(pose[:, 2]), np.sin(pose[:, 2])
        moved = pose.copy()
        moved[:, 0] += c * shift[0] - sn * shift[1]
        moved[:, 1] += sn * shift[0] + c * shift[1]
        moved[:, 2] += shift[2]
        ahead, across = v - omega * shift[1], omega * shift[0]
        ct, st = math.cos(shift[2]), math.sin(shift[2])
        body = np.column_stack([ct * ahead + st * across, -st * ahead + ct * across, omega])
        ahead, _, turning = (body[-1] - body[-2]) / dt
        held = Held((float(body[-2, 0]), float(body[-2, 2])), (float(ahead), float(turning)))
        return Reference(moved[:-2], body[:-2], held)
