"""How often a job has tried what, and how often it may."""

from dataclasses import dataclass

from push_supervisor.arrival import Arrival
from push_supervisor.settings import SupervisorSettings


@dataclass
class Attempts:
    """Counts of one job.

    retries: of the way to a side. losses: of the controller, in a row. waits: for other bodies, in
    a row. moves: of the object by others, since the last push that was completed. setbacks: new
    plans since the last progress. least: pushes left to do at the last progress. corrections:
    further plans for an object that had arrived.
    """

    settings: SupervisorSettings
    retries: int = 0
    losses: int = 0
    waits: int = 0
    moves: int = 0
    setbacks: int = 0
    least: int | None = None
    corrections: int = 0

    def renew(self) -> None:
        """The bounds on new plans start anew: others have moved the object, or stand in its way."""
        self.setbacks, self.least = 0, None

    def progress(self, left: int) -> None:
        """A push is done; left: pushes of the plan that are still to do. It is progress if they are
        fewer than ever before."""
        self.moves = self.waits = 0
        if self.least is None or left < self.least:
            self.least, self.setbacks = left, 0

    def may_wait(self) -> bool:
        """Count another wait for other bodies; False when there have been enough."""
        self.waits += 1
        return self.waits <= self.settings.max_waits

    @property
    def correcting(self) -> bool:
        """Whether the object has arrived before, and only its error is corrected."""
        return self.corrections > 0

    def worth_correcting(self, arrived: Arrival) -> bool:
        """Whether the error of an object that has arrived is to be corrected."""
        return not arrived.close and self.corrections < self.settings.max_corrections
