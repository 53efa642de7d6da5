"""What planning gives: plans, where it stands, and why there is no plan."""

from dataclasses import dataclass
from enum import IntEnum

from push_model.arrays import Array
from push_model.push_segment import PushSegment
from push_planner.guide_path import GuidePath


class PlanError(IntEnum):
    """Why there is no plan; the codes of the PlanPush action."""

    NONE = 0
    INVALID_GOAL = 101
    OUTSIDE_MAP = 104
    START_OCCUPIED = 105
    GOAL_OCCUPIED = 106
    NO_GUIDE_PATH = 107
    NO_PUSH_SEQUENCE = 108


class PlanningFailed(Exception):
    """Raised when there is no plan; carries the code."""

    def __init__(self, code: PlanError, message: str) -> None:
        super().__init__(message)
        self.code = code


@dataclass(frozen=True)
class PlanStatistics:
    """How much work a plan took."""

    rrt_iterations: int = 0
    nodes_expanded: int = 0
    nodes_generated: int = 0
    curves_solved: int = 0
    curves_feasible: int = 0
    guide_cost: float = 0.0
    guide_length: float = 0.0
    guide_clearance: float = 0.0
    plan_time: float = 0.0


@dataclass(frozen=True)
class PushPlan:
    """cost [s]: g(q) of (2.10), see plan_time.py; cost_bound [s]: no plan of stable pushes
    costs less, 0 if unknown; clearance [m]; the guide path used; risk [s]: that searches add to the
    cost, see drive_risk.py.

    goal ``(3,)`` and the segments' poses are of the object's geometric frame, the guide path is of
    its centre of mass.
    """

    goal: Array
    segments: tuple[PushSegment, ...]
    cost: float
    cost_bound: float
    clearance: float
    guide: GuidePath
    statistics: PlanStatistics
    risk: float = 0.0

    @property
    def weighed(self) -> float:
        """[s] cost and risk, by which searches compare plans."""
        return self.cost + self.risk

    @property
    def length(self) -> float:
        """[m] pushed in all."""
        return sum(s.length for s in self.segments)


SLICE = 0.005
"""[s] that a slice of planning takes about: half of them 4 ms or less, one in a hundred more than
20 ms."""


@dataclass(frozen=True)
class Progress:
    """Where planning stands: what it is doing and the best plan so far."""

    stage: str
    best: PushPlan | None
