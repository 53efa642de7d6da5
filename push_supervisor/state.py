"""The states of a job of one robot."""

from enum import IntEnum


class State(IntEnum):
    """S1-S6 of Fig. 2.24b."""

    IDLE = 1
    PLANNING = 2
    POSITIONING = 3
    APPROACH = 4
    PUSHING = 5
    DETACHING = 6


MOVING = frozenset({State.POSITIONING, State.APPROACH, State.PUSHING, State.DETACHING})
"""In which the robot moves."""
