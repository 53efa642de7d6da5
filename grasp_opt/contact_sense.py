"""Whether robots touch an object whose outline is not known exactly. No ROS.

A robot that is commanded to close its gap to the object closes it, until it touches. From then on
the gap stays the same: the robot stands, or the object moves along with it. So contact is told from
the gap over time, wherever the believed outline is.
"""

from collections import deque

import numpy as np

from push_model.arrays import Array, Mask


class ContactSense:
    """Gaps of ``count`` robots and the closing that they were commanded, over the last moments.

    window: [s] over which both are compared. part: of the commanded closing; less than that is
    contact. Robots that were commanded to close less than ``least`` [m] in the window say nothing.
    """

    def __init__(
        self, count: int, window: float = 0.8, part: float = 0.5, least: float = 1.5e-3
    ) -> None:
        self._window, self._part, self._least = window, part, least
        self._seen: deque[tuple[float, Array, Array]] = deque()
        self._closed = np.zeros(count)
        self._last: float | None = None

    def reset(self) -> None:
        """Forget everything: nobody has seen anything for a while."""
        self._seen.clear()
        self._last = None

    def recent(self, seconds: float) -> Array:
        """Means ``(n,)`` [m] of the gaps over the last so many seconds, with at least one frame."""
        since = self._seen[-1][0] - seconds
        found: Array = np.mean([gap for t, gap, _ in self._seen if t >= since], axis=0)
        return found

    def step(self, now: float, gaps: Array, closing: Array) -> tuple[Mask, Array]:
        """One frame.

        Parameters
        ----------
        now: [s]. gaps: ``(n,)`` [m] as measured in the frame. closing: ``(n,)`` [m/s] commanded
        since the last frame.

        Returns
        -------
        Which robots touch the object, and the gaps ``(n,)`` [m] at which they do: means over the
        window.
        """
        if self._last is not None:
            self._closed = self._closed + (now - self._last) * closing
        self._last = now
        self._seen.append((now, gaps.copy(), self._closed.copy()))
        while self._seen[0][0] < now - self._window - 1e-9:
            self._seen.popleft()
        times = np.array([t for t, _, _ in self._seen])
        gap = np.array([g for _, g, _ in self._seen])
        mean = gap.mean(axis=0)
        if len(times) < 8 or times[-1] - times[0] < 0.9 * self._window:
            return np.zeros(len(gaps), dtype=bool), mean
        told = self._seen[-1][2] - self._seen[0][2]
        t = times - times.mean()
        slope = (t[:, None] * gap).sum(axis=0) / (t @ t)
        scatter = np.sqrt(((gap - mean - t[:, None] * slope) ** 2).sum(axis=0) / (len(t) - 2))
        span = times[-1] - times[0]
        # What was closed, at its upper end: two standard deviations of the slope.
        done = span * (-slope + 2.0 * scatter / np.sqrt(t @ t))
        touching: Mask = (told >= self._least) & (done <= self._part * told)
        return touching, mean
