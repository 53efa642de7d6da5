"""How long a command takes from the poses that it answers, as the viewer sees both arrive."""

import struct
from collections import deque

import numpy as np

_STAMP = struct.Struct("<iI")  # sec and nanosec at the beginning of a header, after four bytes
_KEPT = 200  # frames and delays


def stamp_of(data: bytes) -> int:
    """[ns] Stamp of a serialised message whose first field is a header."""
    seconds, nanoseconds = _STAMP.unpack_from(data, 4)
    return int(seconds) * 1_000_000_000 + int(nanoseconds)


class GraphDelay:
    """Times are readings of one monotonic clock [s], passed in."""

    def __init__(self) -> None:
        self._seen: dict[int, float] = {}
        self._delays: deque[float] = deque(maxlen=_KEPT)

    def poses(self, data: bytes, now: float) -> None:
        """A serialised frame of poses has arrived."""
        self._seen[stamp_of(data)] = now
        if len(self._seen) > _KEPT:
            del self._seen[next(iter(self._seen))]

    def command(self, data: bytes, now: float) -> None:
        """A serialised command has arrived; the first that answers a frame counts."""
        begun = self._seen.pop(stamp_of(data), None)
        if begun is not None:
            self._delays.append(now - begun)

    def summary(self) -> tuple[float, float] | None:
        """Median and longest delay [s] of the newest commands; None if there are none."""
        if not self._delays:
            return None
        return float(np.median(self._delays)), max(self._delays)
