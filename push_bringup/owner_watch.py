"""Whether the node that owns a job is still there, as a client sees it in the ROS graph.

A node that was killed, and one that is frozen, look alike for a while: the graph loses both when
they have not announced themselves for some seconds. A frozen one comes back as the same publisher
and continues its job. A restarted node is another publisher. What it publishes about the job
decides whether the job continues. No ROS here.
"""

from dataclasses import dataclass
from enum import Enum

SILENCE = 20.0
"""[s] Wall time that the owner may be missing while the world is there."""
_END = 2.0  # [s] wall time that everything may be missing


class Owner(Enum):
    """How it stands with the owner of a job."""

    PRESENT = "it is there"
    MISSING = "it is not in the graph; it may come back"
    RETURNED = "it was missing and is there again"
    REPLACED = "another node is in its place"
    SILENT = "it has been missing for too long"
    ENDED = "it is gone, and the world with it"


@dataclass
class OwnerWatch:
    """Of one job. owners: publishers of the state of the job when the goal was sent."""

    owners: frozenset[bytes]
    _since: float | None = None

    def look(self, now: float, publishers: frozenset[bytes], world: bool) -> Owner:
        """Judge what is in the graph at a wall time [s]; world: whether anybody publishes poses."""
        if not self.owners:  # nobody was known yet
            self.owners = publishers
        if self.owners & publishers:
            returned, self._since = self._since is not None, None
            return Owner.RETURNED if returned else Owner.PRESENT
        if publishers:
            return Owner.REPLACED
        if self._since is None:
            self._since = now
        if not world and now - self._since > _END:
            return Owner.ENDED
        return Owner.SILENT if now - self._since > SILENCE else Owner.MISSING
