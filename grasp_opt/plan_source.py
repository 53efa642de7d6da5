"""Where the plans of a group come from: planned at once, or asked of the grasp optimizer's node."""

import time
from typing import Protocol

from grasp_opt.contact_outline import convex
from grasp_opt.job_state import Request
from grasp_opt.placement import PlacementSettings
from grasp_opt.sequencing import NoStep
from grasp_opt.step_planner import GroupPlan, StepPlanner, TooFew
from grasp_opt.step_settings import StepSettings
from push_job.method import Seen
from push_model.belief import Belief
from push_model.jobs import JobError
from push_model.occupancy import OccupancyGrid
from push_model.specs import ObjectSpec, RobotSpec
from push_model.stick_certificate import ContactBelief


class PlanFailed(Exception):
    """A request that cannot be met; carries the code."""

    def __init__(self, code: JobError, message: str) -> None:
        super().__init__(message)
        self.code = code


class PlanSource(Protocol):
    """Plans the steps of a group."""

    cost: float
    """[s] CPU time of the last answer, where it was planned in this process; else 0."""

    def ask(self, request: Request, seen: Seen, belief: Belief) -> None:
        """Request a step. It replaces an earlier request."""
        ...

    def answer(self, seen: Seen) -> GroupPlan | None:
        """The plan, None as long as there is none.

        Raises
        ------
        PlanFailed
        """
        ...

    def forget(self) -> None:
        """Drop the request."""
        ...


class InlinePlans:
    """Plans in the calling process, when the answer is asked for."""

    def __init__(
        self,
        grid: OccupancyGrid,
        item: str,
        robot: str,
        settings: StepSettings | None = None,
        placement: PlacementSettings | None = None,
    ) -> None:
        """item: name of the object; robot: name of one of the robots."""
        self._grid, self._names, self._settings = grid, (item, robot), settings
        self._placement = placement
        self._planner: StepPlanner | None = None
        self._specs: tuple[ObjectSpec, RobotSpec, ContactBelief | None] | None = None
        self._asked: tuple[Request, Seen] | None = None
        self.cost = 0.0

    def ask(self, request: Request, seen: Seen, belief: Belief) -> None:
        """See PlanSource."""
        item, robot = self._names
        specs = convex(belief.object(item)), belief.robot(robot), ContactBelief.of(belief, item)
        if specs != self._specs:
            self._specs, self._planner = specs, None
        self._asked = request, seen

    def answer(self, seen: Seen) -> GroupPlan | None:
        """See PlanSource."""
        if self._asked is None or self._specs is None:
            return None
        (request, at), self._asked = self._asked, None
        began = time.thread_time()
        if self._planner is None:
            item, robot, believed = self._specs
            self._planner = StepPlanner(
                self._grid, item, robot, self._settings, self._placement, believed
            )
        rest = (request.robots, request.dead, at.obstacles, request.fewest)
        try:
            if request.trajectory is not None:
                return self._planner.along(request.trajectory, request.pose, *rest)
            return self._planner.plan(request.pose, request.goal, *rest)
        except TooFew as error:
            raise PlanFailed(JobError.TOO_HEAVY, str(error)) from None
        except NoStep as error:
            raise PlanFailed(JobError.PLANNING_FAILED, str(error)) from None
        finally:
            self.cost = time.thread_time() - began

    def forget(self) -> None:
        """See PlanSource."""
        self._asked = None
