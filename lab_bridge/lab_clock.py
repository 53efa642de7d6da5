"""The time of a lab: that of its poses, carried on between two frames.

Commands carry the stamp of the poses that they answer. Whether one is fresh is therefore judged on
the clock of the poses, whatever that clock is and however late the poses arrive.
"""


class LabClock:
    """Anchored to the newest frame. Times are passed in."""

    def __init__(self) -> None:
        self._stamp, self._at = 0.0, 0.0
        self._running = False

    def set(self, stamp: float, now: float) -> None:
        """A frame of a stamp [s] was published at a monotonic time now [s]."""
        self._stamp, self._at, self._running = stamp, now, True

    def read(self, now: float) -> float:
        """[s] on the clock of the poses at a monotonic time now [s]; 0 before the first frame."""
        return self._stamp + max(0.0, now - self._at) if self._running else 0.0

    def silence(self, now: float) -> float:
        """[s] since the newest frame; inf before the first."""
        return now - self._at if self._running else float("inf")
