"""How often a robot is told something: at most at a rate, but a stop at once."""

from push_model.arrays import Array


class Throttle:
    """Keeps the newest command until it may be sent. Times [s] are monotonic and passed in."""

    def __init__(self, rate: float) -> None:
        """rate: commands per second at most [Hz]."""
        self._period = 1.0 / rate
        self._last = -float("inf")
        self._waiting: Array | None = None
        self._sent: Array | None = None

    def offer(self, command: Array, now: float) -> Array | None:
        """A new command ``(n,)``; returns what is to be sent now, if anything: a stop only where
        the robot has not been stopped already."""
        self._waiting = command
        if command.any():
            return self.due(now)
        if self._sent is not None and not self._sent.any():
            self._waiting = None
            return None
        return self._take(now)

    def hold(self, command: Array) -> None:
        """A new command that must not be sent yet."""
        self._waiting = command

    def due(self, now: float) -> Array | None:
        """A command that has waited long enough."""
        if self._waiting is None or now - self._last < self._period - 1e-6:
            return None
        return self._take(now)

    def clear(self) -> None:
        """Nothing waits any more, and what the robot does is not known."""
        self._waiting = self._sent = None

    def _take(self, now: float) -> Array | None:
        self._sent, self._waiting, self._last = self._waiting, None, now
        return self._sent
