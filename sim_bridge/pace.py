"""When the world may step: in real time, or in lockstep with the nodes that command robots."""

import math

import numpy as np

from push_model.arrays import Mask, Rows


class Lockstep:
    """Waits for the answer of every commanded robot to the newest frame. Robots are rows.

    It waits for any time: only an answer, or ``release``, ends the wait for a robot.
    """

    def __init__(self, robots: int) -> None:
        self._waiting = np.zeros(robots, dtype=bool)
        self._frame: int | None = None
        self._since = 0.0
        self._told = False
        self.ready = True
        """Whether nobody is waited for."""

    def expect(self, frame: int, robots: Mask, now: float) -> None:
        """A frame, by its number, was published at monotonic time now [s]; robots must answer it.

        robots: ``(n,)`` mask.
        """
        self._frame, self._since, self._told = frame, now, False
        self._waiting = robots.copy()
        self.ready = not robots.any()

    def answer(self, frame: int, rows: Rows) -> bool:
        """Record that robots answered a frame. Returns whether it is the newest one."""
        if frame != self._frame:
            return False
        self.release(rows)
        return True

    def release(self, rows: Rows) -> None:
        """Stop waiting for some robots."""
        self._waiting[rows] = False
        self.ready = not self._waiting.any()

    @property
    def waiting(self) -> Rows:
        """``(k,)`` rows of robots that have not answered."""
        return np.flatnonzero(self._waiting)

    def waited(self, now: float) -> float:
        """[s] since the newest frame."""
        return now - self._since

    def due_to_tell(self, now: float, limit: float) -> bool:
        """Whether robots have been waited for longer than limit [s]; true once a frame.

        It is for a warning only: in lockstep no wall clock decides anything.
        """
        if self.ready or self._told or self.waited(now) <= limit:
            return False
        self._told = True
        return True


class RealTime:
    """Ticks due by now, at a pace; after a stall it goes on from where it is, never in a burst."""

    def __init__(self, period: float, factor: float, most: int = 5) -> None:
        """period: [s] sim time of a tick; factor: sim time over wall time; most: ticks at once."""
        self._wall_period = period / factor
        self._most = most
        self._next = math.nan
        self.stalls = 0

    def due(self, now: float) -> int:
        """How many ticks to do at monotonic time now [s]."""
        if math.isnan(self._next):
            self._next = now
        count = int((now - self._next) / self._wall_period) + 1 if now >= self._next else 0
        if count > self._most:
            self.stalls += 1
            self._next = now + self._wall_period
            return 1
        self._next += count * self._wall_period
        return count

    def restart(self) -> None:
        """Forget the past, after a pause or a reset."""
        self._next = math.nan
