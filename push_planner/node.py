"""The planner node: the PlanPush action and the PlanRobotPath service."""

import math
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from nav_msgs.msg import Path
from rclpy.node import Node

from push_model.arrays import Array
from push_model.occupancy import OccupancyGrid as Grid
from push_model.push_segment import PushSegment
from push_model.settings import SettingsError
from push_model.specs import ObjectSpec, RobotSpec
from push_model.stick_certificate import ContactBelief
from push_msgs.action import PlanPush
from push_msgs.msg import PushPlan as PlanMessage
from push_msgs.srv import PlanRobotPath
from push_planner import (
    SLICE,
    DistanceField,
    NoRobotPath,
    PlanError,
    PlannerSettings,
    PlanningFailed,
    Progress,
    PushPlan,
    PushPlanner,
    TooHeavy,
    check_under_way,
    going_on,
    joined,
    plan_among_bodies,
    plan_robot_path,
    warm_up,
)
from push_ros.actions import GoalServer
from push_ros.belief_feed import BeliefFeed
from push_ros.conversions import (
    circles_from_ros,
    path_to_ros,
    plan_to_ros,
    segment_from_ros,
    trajectory_to_ros,
)
from push_ros.diagnostics import Diagnostics
from push_ros.map_feed import FirstMap, MapFeed
from push_ros.names import names_of
from push_ros.parameters import declare_settings
from push_ros.process import run_node
from push_ros.qos import LATCHED
from push_ros.scheduling import Urgency
from push_ros.validation import FRAME, InvalidMessage, planar_pose
from push_scenario.scenario import Scenario, load_scenario

_AT_ONCE = round(0.01 / SLICE)  # slices: as many as fit between two frames at 100 Hz
_SIGN_OF_LIFE = 0.5  # [s] wall time between feedback messages at most


class PlannerNode(Node):
    """Plans in slices between which its executor serves others, so that a goal can be cancelled."""

    def __init__(
        self, scenario: Scenario | None = None, namespace: str = "", world: str = ""
    ) -> None:
        """namespace: the team's; world: the bridge's, where it is another one."""
        super().__init__("planner", namespace=namespace)
        names = names_of(self, world)
        name = self.declare_parameter("scenario", "env1-target1").value
        self._scenario = scenario or load_scenario(str(name))
        self.settings = declare_settings(
            self,
            PlannerSettings,
            self._scenario.parameters.get("planner", {}),
            where="planner",
            apply=self._apply,
        )
        self._planners: dict[tuple[str, str], PushPlanner] = {}
        self._grid: Grid | None = None
        self._field: DistanceField | None = None  # of the grid
        self._work: Iterator[Progress] | None = None
        self._best: PushPlan | None = None
        self._under_way: list[PushSegment] = []  # at most one, with which the plan begins
        self._queued = False  # whether slices wait for their turn
        self._draws = 0  # requests for pre-emptive pushes: each draws others
        self.plans = self.failures = 0
        self.last_time = 0.0  # [s] wall time of the last plan
        self.planning_time = 0.0
        """[s] CPU time of all plans so far."""
        self._diagnostics = Diagnostics(self, names, self._state)
        self._plan_publisher = self.create_publisher(PlanMessage, names.team("push_plan"), LATCHED)
        self._path_publisher = self.create_publisher(Path, names.team("push_path"), LATCHED)
        MapFeed(self, names, self._diagnostics, self._take_map)
        self._beliefs = BeliefFeed(
            self, names, self._scenario, self._diagnostics, lambda belief: self._believe()
        )
        self._server = GoalServer(
            self,
            PlanPush,
            names.team("plan_push"),
            check=lambda request: None,
            start=self._begin,
            cancel=self._canceled,
            preempt=lambda request: self._preempt(),
        )
        self._paths = names.team("plan_robot_path")
        self._first_map = FirstMap(self, names, self._on_no_map)
        self._warm_up()

    @property
    def ready(self) -> bool:
        """Whether the map is known."""
        return self._grid is not None

    def _apply(self, settings: PlannerSettings) -> None:
        if self._work is not None:
            raise SettingsError("the planner is busy; change its parameters when it is idle")
        self.settings = settings
        self._planners.clear()

    def _take_map(self, grid: Grid) -> None:
        """Another map than before. Paths are offered from the first one on."""
        if self._grid is None:
            self.create_service(PlanRobotPath, self._paths, self._on_robot_path)
        self._grid, self._field = grid, None
        self._plan_anew(self._first_map.awaited)

    def _plan_anew(self, waiting: bool = False) -> None:
        """The map is another one: a plan under way is dropped and begun anew.

        waiting: whether a request waits that can begin now.
        """
        self._planners.clear()
        if waiting or self._work is not None:
            self._begin(self._request)

    def _believe(self) -> None:
        """Another belief: a plan under way that it concerns is dropped and begun anew."""
        for pair, planner in list(self._planners.items()):
            scene = planner.scene
            if self._specs(*pair) != (scene.robot, scene.item, scene.believed):
                del self._planners[pair]
        if self._work is None:
            return
        request = self._request
        if self._pair(request.robot, request.object) not in self._planners:
            self._begin(request)

    def _on_no_map(self, reason: str) -> None:
        self._fail(PlanPush.Result.NO_MAP, reason)

    def _distances(self) -> DistanceField:
        assert self._grid is not None
        if self._field is None:
            self._field = DistanceField(self._grid)
        return self._field

    def _planner(self, robot: str, item: str) -> PushPlanner:
        """Raises SettingsError for names that are not known, PlanningFailed for a robot that is not
        made for pushing."""
        pair = robot, item = self._pair(robot, item)
        if pair not in self._planners:
            specs = self._specs(robot, item)
            try:
                planner = PushPlanner(self.settings, self._distances(), *specs)
            except SettingsError as error:
                why = f"robot '{robot}' cannot push '{item}': {error}"
                raise PlanningFailed(PlanError.NO_PUSH_SEQUENCE, why) from None
            self._planners[pair] = planner
        return self._planners[pair]

    def _specs(self, robot: str, item: str) -> tuple[RobotSpec, ObjectSpec, ContactBelief | None]:
        """What is believed now of a robot, an object and their contact."""
        belief = self._beliefs.current
        return belief.robot(robot), belief.object(item), ContactBelief.of(belief, item)

    def _pair(self, robot: str, item: str) -> tuple[str, str]:
        """Names in the place of empty ones; raises SettingsError for names that are not known."""
        return self._scenario.robot(robot)[0], self._scenario.object(item)[0]

    def _warm_up(self) -> None:
        """Load what is compiled before the first request."""
        if not self._scenario.objects:
            return
        try:
            warm_up(self.settings, self._scenario.robot()[1], self._scenario.object()[1])
        except (PlanningFailed, SettingsError) as error:
            self.get_logger().debug(f"warm-up: {error}")

    def _begin(self, request: Any) -> None:
        self._started, self._told = time.monotonic(), 0.0
        self._best = None
        self._work = None
        try:
            self._request = request
            self._first_map.awaited = False
            if self._grid is None:
                self._first_map.wait()
                return
            for stamped in (request.start, request.goal, request.robot_pose):
                if stamped is request.robot_pose and not stamped.header.frame_id:
                    continue
                if stamped.header.frame_id != FRAME:
                    self._fail(
                        PlanPush.Result.UNKNOWN_FRAME,
                        f"frame '{stamped.header.frame_id}' is not known, expected '{FRAME}'",
                    )
                    return
            start = planar_pose(request.start.pose, "the start")
            goal = planar_pose(request.goal.pose, "the goal")
            here = request.robot_pose
            robot = planar_pose(here.pose, "the robot's pose") if here.header.frame_id else None
            if len(request.under_way) > 1:
                raise InvalidMessage("at most one push can be under way")
            self._under_way = [segment_from_ros(segment) for segment in request.under_way]
            for push in self._under_way:
                check_under_way(push, start)
            self._work = self._plan(request, start, goal, robot)
            self._continue()
        except TooHeavy as error:
            self._fail(PlanPush.Result.TOO_HEAVY, str(error))
        except InvalidMessage as error:
            self._fail(PlanPush.Result.INVALID_GOAL, str(error))
        except SettingsError as error:
            self._fail(PlanPush.Result.UNKNOWN_OBJECT, str(error))
        except PlanningFailed as error:
            self._fail(int(error.code), str(error))

    def _plan(
        self, request: Any, start: Array, goal: Array, robot: Array | None
    ) -> Iterator[Progress]:
        """The work on a request, in slices.

        Raises
        ------
        InvalidMessage, SettingsError, PlanningFailed, TooHeavy: at once, of what is wrong with the
            request.
        """
        planner = self._planner(request.robot, request.object)
        circles = circles_from_ros(request.obstacles)
        if len(circles) and circles[:, 2].min() < 0.0:
            raise InvalidMessage("an obstacle's radius must not be negative")
        if request.mode not in (PlanPush.Goal.DIRECT, PlanPush.Goal.PREEMPTIVE):
            raise InvalidMessage(f"unknown mode {request.mode}; expected DIRECT or PREEMPTIVE")
        preemptive = request.mode == PlanPush.Goal.PREEMPTIVE
        self._draws += preemptive
        draw = self._draws * preemptive
        sides = [segment.side for segment in self._under_way]
        return plan_among_bodies(planner, start, goal, circles, draw, robot, *sides)

    def _continue(self) -> None:
        """Queue the next slices behind whatever else the executor has to do."""
        if not self._queued:
            assert self.executor is not None
            self._queued = True
            self.executor.create_task(self._on_slices)

    def _on_slices(self) -> None:
        self._queued = False
        for _ in range(_AT_ONCE):
            if self._work is not None:
                self._slice(self._work)
        if self._work is not None:
            self._continue()

    def _slice(self, work: Iterator[Progress]) -> None:
        cpu = time.thread_time()
        try:
            progress = next(work)
        except StopIteration:
            self._succeed()
            return
        except PlanningFailed as error:
            self._fail(int(error.code), str(error))
            return
        finally:
            self.planning_time += time.thread_time() - cpu
        elapsed = time.monotonic() - self._started
        improved = progress.best is not self._best
        self._best = progress.best
        if improved and self._best is not None:
            self._publish(self._best)
        if improved or elapsed - self._told > _SIGN_OF_LIFE:
            self._told = elapsed
            cost = math.inf if self._best is None else self._best.cost
            told = PlanPush.Feedback(elapsed=elapsed, best_cost=cost, stage=progress.stage)
            told.plan = [self._plan_message] if improved and self._best and self._under_way else []
            self._server.feedback(told)
        if self._best is not None and 0.0 < self._request.time_budget < elapsed:
            self._succeed()

    def _publish(self, plan: PushPlan) -> None:
        robot, spec = self._scenario.robot(self._request.robot)
        item, _ = self._scenario.object(self._request.object)
        now = self._now()
        pushes = joined(plan.segments, spec.differential, self.settings)
        for under_way in self._under_way:
            pushes = going_on(under_way, pushes, spec.differential, self.settings)
        plan = replace(plan, segments=pushes)
        self._plan_message = plan_to_ros(plan, robot, item, now)
        self._plan_publisher.publish(self._plan_message)
        self._path_publisher.publish(path_to_ros([s.trajectory for s in plan.segments], now))

    def _now(self) -> float:
        return 1e-9 * int(self.get_clock().now().nanoseconds)

    def _succeed(self) -> None:
        self._work = None
        self.plans += 1
        self.last_time = time.monotonic() - self._started
        self._server.finish(PlanPush.Result(plan=self._plan_message), success=True)

    def _fail(self, code: int, message: str) -> None:
        self._work = None
        self.failures += 1
        self._server.finish(PlanPush.Result(error_code=code, error_msg=message), success=False)

    def _preempt(self) -> None:
        if self._server.active:
            self._canceled("a new request replaces this one")

    def _canceled(self, why: str = "canceled") -> None:
        self._first_map.awaited = False
        self._fail(PlanPush.Result.CANCELED, why)

    def _on_robot_path(self, request: Any, response: Any) -> Any:
        try:
            start, goal = planar_pose(request.start, "start"), planar_pose(request.goal, "goal")
            trajectory = plan_robot_path(
                self._distances(),
                self._scenario.robot(request.robot)[1],
                self.settings,
                start,
                goal,
                circles_from_ros(request.obstacles),
            )
            response.error_code = response.NONE
            response.trajectory = trajectory_to_ros(trajectory)
        except NoRobotPath as error:
            response.error_code, response.message = int(error.code), str(error)
        except (InvalidMessage, SettingsError) as error:
            response.error_code, response.message = response.INVALID, str(error)
        return response

    def _state(self) -> dict[str, Any]:
        return {
            "plans": self.plans,
            "failures": self.failures,
            "planning": self._work is not None,
            "last plan time": f"{self.last_time:.3f} s",
            "warning": "" if self._grid is not None else "no map yet",
        }


def main() -> int:
    """Entry point of the process: ``--ros-args`` on its command line."""
    return run_node(PlannerNode, urgency=Urgency.BACKGROUND)


if __name__ == "__main__":
    sys.exit(main())
