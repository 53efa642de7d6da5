"""Whether the suite that a page shows is still running."""

from dataclasses import dataclass

SILENCE = 0.6
"""[s] wall time without a frame of poses after which the suite counts as gone."""

_TO_DO = "choose a system under Start a suite, or use planar-push launch"
_STUCK = 1.0  # [s] wall time within which the viewer must have checked the graph


@dataclass
class SuiteWatch:
    """Decides by the poses, the graph and the viewer's own activity.

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
        """A frame of poses has arrived."""
        self.poses_at = now

    def looked(self, now: float, pose_publishers: int) -> None:
        """The graph has been checked: number of publishers of poses."""
        self._looked_at = now
        self._published = pose_publishers > 0

    def trouble(self, now: float) -> str:
        """Why the suite counts as gone; empty if it is running.

        During a pause no poses arrive, so only the graph decides.
        """
        if now - (self.started if self._looked_at is None else self._looked_at) > _STUCK:
            return "the viewer hangs"
        if not self._published:
            what = "no suite yet" if self.poses_at is None else "the suite is gone"
            return f"{what}: nobody publishes {self.poses_topic}; {_TO_DO}"
        if self.paused:
            return ""
        if self.poses_at is None:
            return f"nothing has come on {self.poses_topic} yet"
        silence = now - self.poses_at
        if silence > SILENCE:
            return f"the suite is silent: nothing on {self.poses_topic} for {silence:.1f} s"
        return ""
