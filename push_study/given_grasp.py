"""The group method with a grasp that a study has chosen: random, selected, optimised or given.

It runs in the graph by the name ``NAME``. Choosing is planning.
"""

import time
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from grasp_opt.group_method import SECTIONS, GroupMethod, check_team
from grasp_opt.job_state import Request
from grasp_opt.object_trajectory import ObjectTrajectory
from grasp_opt.placement import NoPlacement
from grasp_opt.plan_source import PlanFailed
from grasp_opt.robust_placement import robust_placement
from grasp_opt.selection import GraspSelector, NoGraspFound, Selection
from grasp_opt.sequencing import NoStep
from grasp_opt.step_planner import GroupPlan, StepPlanner
from grasp_opt.warm_up import warm_up
from push_job.method import Arena, Certificate, MethodSpec, Refusal, Seen, Task, Told
from push_model.arrays import Array
from push_model.belief import Belief
from push_model.jobs import JobError, JobPhase
from push_model.occupancy import OccupancyGrid
from push_model.settings import bounded, settings
from push_model.specs import ObjectSpec, RobotSpec
from push_model.traction import lift_share, standing_traction

NAME = f"{__name__}:METHOD"
"""As ``run_team`` takes it."""


@settings
class GraspSettings:
    """Where the robots push, and who chooses it."""

    choice: Literal["given", "optimised", "selected", "random"] = bounded(
        "optimised",
        doc="Choice of the grasp: 'given' (the places of 'ways'), 'optimised' (the placement of "
        "section 3.2), 'selected' (the best of random grasps by MHD, refined) or 'random' (the "
        "first random grasp that passes the test).",
    )
    ways: tuple[float, ...] = bounded(
        (), low=0.0, high=1e3, doc="Places of the robots along the outline with choice 'given' (m)."
    )
    force_share: float = bounded(
        0.9,
        low=0.1,
        high=1.0,
        doc="Fraction of its traction that a robot may use with choice 'optimised' "
        "(dimensionless).",
    )
    tries: int = bounded(
        500,
        low=1,
        high=1_000_000,
        doc="Number of random grasps that are drawn with choice 'selected' or 'random'.",
    )
    seed: int = bounded(
        0,
        low=0,
        high=2**32 - 1,
        doc="Seed of the random grasps with choice 'selected' or 'random'.",
    )
    margin: float = bounded(
        0.02,
        low=0.0,
        high=1.0,
        doc="Least margin of the compatibility test with choice 'selected' or 'random', the sine "
        "of an angle (dimensionless).",
    )
    gap: float = bounded(
        0.015,
        low=0.0,
        high=1.0,
        doc="Least gap between robots with choice 'selected' or 'random' (m).",
    )


@dataclass(frozen=True)
class Grasp:
    """Places ``(n,)`` [m] along the outline, and the selection that they come from, if any."""

    way: Array
    selection: Selection | None = None


def choose(
    s: GraspSettings, item: ObjectSpec, robot: RobotSpec, count: int, trajectory: ObjectTrajectory
) -> Grasp:
    """The grasp of so many robots for a trajectory of the centre of mass.

    Raises
    ------
    NoGraspFound, NoPlacement: there is none. ValueError: as many places must be given as robots.
    """
    radius = robot.footprint_radius
    if s.choice == "given":
        if len(s.ways) != count:
            raise ValueError(f"{len(s.ways)} places are given for {count} robots")
        return Grasp(np.array(s.ways))
    if s.choice == "optimised":
        most = s.force_share * standing_traction(robot, lift_share(robot, item))
        return Grasp(robust_placement(item, trajectory, count, radius, most).way)
    selector = GraspSelector(item, trajectory, count, radius, least_margin=s.margin, gap=s.gap)
    pick = selector.select if s.choice == "selected" else selector.first
    found = pick(s.tries, s.seed)
    return Grasp(found.way, found)


class GraspPlans:
    """A PlanSource: the chosen grasp, and moves to its places.

    grasp: of the last request; None before the first one.
    """

    def __init__(self, grid: OccupancyGrid, names: tuple[str, str], s: GraspSettings) -> None:
        """names: of the object and of one of the robots."""
        self._grid, self._names, self._settings = grid, names, s
        self._asked: tuple[Request, ObjectSpec, RobotSpec] | None = None
        self.grasp: Grasp | None = None
        self.cost = 0.0

    def ask(self, request: Request, seen: Seen, belief: Belief) -> None:
        """See PlanSource."""
        item, robot = self._names
        self._asked = request, belief.object(item), belief.robot(robot)

    def answer(self, seen: Seen) -> GroupPlan | None:
        """See PlanSource."""
        if self._asked is None:
            return None
        (request, item, robot), self._asked = self._asked, None
        began = time.thread_time()
        try:
            return self._plan(request, item, robot)
        except (NoGraspFound, NoPlacement, NoStep, ValueError) as error:
            raise PlanFailed(JobError.PLANNING_FAILED, str(error)) from None
        finally:
            self.cost = time.thread_time() - began

    def _plan(self, request: Request, item: ObjectSpec, robot: RobotSpec) -> GroupPlan:
        if request.trajectory is None or request.dead:
            raise NoStep(
                "a grasp can be chosen only for a trajectory, and only if no robot is dead"
            )
        count = len(request.robots)
        self.grasp = choose(self._settings, item, robot, count, request.trajectory)
        planner = StepPlanner(self._grid, item, robot)
        return planner.taking(self.grasp.way, request.trajectory, request.pose, request.robots)

    def forget(self) -> None:
        """See PlanSource."""
        self._asked = None


class GivenGrasp(GroupMethod):
    """Pushes along a trajectory from chosen places by the group law."""

    def __init__(self, arena: Arena) -> None:
        self._chosen: GraspSettings = arena.section("grasp", GraspSettings)
        names = (arena.object, next(iter(arena.robots)))
        self.plans = GraspPlans(arena.grid, names, self._chosen)
        super().__init__(replace(arena, partners=self.plans))
        warm_up(arena.item, arena.robot)
        self._frame = 0.0  # [s] stamp of the last frame

    def assess(self, task: Task, belief: Belief, seen: Seen | None) -> Certificate | Refusal:
        """See Method: only trajectories are taken."""
        if not task.times:
            return Refusal(
                JobError.INVALID_GOAL,
                "a grasp can be chosen only for a trajectory; send a trajectory",
            )
        return super().assess(task, belief, seen)

    def step(self, seen: Seen, belief: Belief) -> Told:
        """See Method."""
        self._frame = seen.time
        return super().step(seen, belief)

    def along(self, now: float) -> float | None:
        """[s] along the trajectory at a time [s] of the world; None when nobody pushes.

        The last tick says where the object is to be when its commands take effect.
        """
        last = self.job.last
        if self.job.state is not JobPhase.PUSHING or last is None:
            return None
        return last.time + now - self._frame - self.job.pose_delay


def task_along(trajectory: ObjectTrajectory, item: ObjectSpec) -> Task:
    """The task of a trajectory of an object's centre of mass."""
    frames = np.array([item.geometric_pose(pose) for pose in trajectory.pose])
    targets = np.column_stack([frames[:, :2], trajectory.pose[:, 2]])
    return Task(tuple(targets), tuple(trajectory.time.tolist()))


GRASP_SECTIONS: dict[str, type[Any]] = {**SECTIONS, "grasp": GraspSettings}
METHOD = MethodSpec("given-grasp", GivenGrasp, GRASP_SECTIONS, check_team, "group-ellipse")
