"""Whether the suite that a page shows is still there."""

from dataclasses import dataclass

SILENCE = 0.6
"""[s] wall time without a frame of poses after which the suite counts as gone."""

_STUCK = 1.0  # [s] wall time in which the viewer must have looked at the graph


@dataclass
class SuiteWatch:
    """Judges by the poses, by the graph and by the viewer's own pulse.

    Times are readings of one monotonic clock [s], passed in. ``trouble`` may be called from any
    thread.
    """

    poses_topic: str
    started: float
    paused: bool = False
    poses_at: float | None = None
    _looked_at: float | None = None
    _published: bool = False

    def poses_came(self, now: float) -> None:
        """A frame of poses has come."""
        self.poses_at = now

    def looked(self, now: float, pose_publishers: int) -> None:
        """The graph has been looked at: so many publish poses."""
        self._looked_at = now
        self._published = pose_publishers > 0

    def trouble(self, now: float) -> str:
        """Why the suite counts as gone; empty when it is there.

        In a pause no poses come; then the graph alone tells.
        """
        if now - (self.started if self._looked_at is None else self._looked_at) > _STUCK:
            return "the viewer hangs"
        if not self._published:
            what = "no suite yet" if self.poses_at is None else "the suite is gone"
            return f"{what}: nobody publishes {self.poses_topic}"
        if self.paused:
            return ""
        if self.poses_at is None:
            return f"nothing has come on {self.poses_topic} yet"
        silence = now - self.poses_at
        if silence > SILENCE:
            return f"the suite is silent: nothing on {self.poses_topic} for {silence:.1f} s"
        return ""
