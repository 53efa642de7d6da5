"""Whether an object is at its goal."""

from dataclasses import dataclass

from push_supervisor.settings import SupervisorSettings


@dataclass(frozen=True)
class Arrival:
    """there: within the tolerances. close: so close that no correction is worth it. text: the
    error."""

    there: bool
    close: bool
    text: str


def arrival(settings: SupervisorSettings, away: float, turned: float) -> Arrival:
    """Of an object that is so far [m], [rad] from its goal."""
    s = settings
    there = away <= s.position_tolerance and turned <= s.orientation_tolerance
    close = away <= s.correct_position and turned <= s.correct_orientation
    return Arrival(there, close, f"{1e3 * away:.1f} mm, {turned:.3f} rad")
