"""Codes and states of the job of moving an object, by one robot, a group or a swarm.

docs/errors.md says what each code means and what to do.
"""

from enum import IntEnum


class JobError(IntEnum):
    """The codes of the MoveObject action and of JobState."""

    NONE = 0
    INVALID_GOAL = 301
    UNKNOWN_OBJECT = 302
    UNKNOWN_FRAME = 303
    OUTSIDE_MAP = 304
    GOAL_OCCUPIED = 305
    PLANNING_FAILED = 306
    POSITIONING_FAILED = 307
    EXECUTION_FAILED = 308
    POSES_STALE = 309
    CANCELED = 310
    PREEMPTED = 311
    OFF_TARGET = 312
    CLOCK_RESET = 313
    NODE_LOST = 314
    TOO_HEAVY = 315
    OBJECT_MOVED = 316
    JOB_FORGOTTEN = 317
    OWNER_SILENT = 318


class JobPhase(IntEnum):
    """The states of JobState: those of the state machine of section 2.5."""

    IDLE = 1
    PLANNING = 2
    POSITIONING = 3
    APPROACH = 4
    PUSHING = 5
    DETACHING = 6


class GoalRefused(Exception):
    """A goal that is refused; carries the code."""

    def __init__(self, code: JobError, message: str) -> None:
        super().__init__(message)
        self.code = code
