"""When the world may step: in real time, or in lockstep with those who command it."""

import math
from collections.abc import Iterable


class Lockstep:
    """Waits for the answer of every commanded robot to the newest frame."""

    def __init__(self) -> None:
        self._waiting: set[str] = set()
        self._frame: int | None = None
        self._since = 0.0

    def expect(self, frame: int, robots: Iterable[str], now: float) -> None:
        """A frame (tick number) was published at monotonic time now [s]; robots must answer it."""
        self._frame, self._waiting, self._since = frame, set(robots), now

    def answer(self, frame: int, robot: str) -> None:
        """A robot answered a frame."""
        if frame == self._frame:
            self._waiting.discard(robot)

    @property
    def ready(self) -> bool:
        """Whether nobody is waited for."""
        return not self._waiting

    def overdue(self, now: float, limit: float) -> list[str]:
        """Robots that have not answered for longer than limit [s]."""
        return sorted(self._waiting) if now - self._since > limit else []


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
