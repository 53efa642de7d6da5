"""The grasp optimizer as a ROS node: the PlanGroupPush action.

A plan takes from tenths of a second to some seconds, in which the node does nothing else; robots
stand meanwhile.
"""

import sys
import time
from typing import Any

import numpy as np
from nav_msgs.msg import Path
from rclpy.node import Node

from grasp_opt.group_messages import plan_to_ros, trajectory_from_ros
from grasp_opt.placement import PlacementSettings
from grasp_opt.sequencing import NoStep
from grasp_opt.step_planner import GroupPlan, StepPlanner, StepSettings, TooFew
from push_model.belief import Belief
from push_model.occupancy import OccupancyGrid as Grid
from push_model.settings import SettingsError
from push_model.trajectory import Trajectory
from push_msgs.action import PlanGroupPush
from push_msgs.msg import GroupPlan as PlanMessage
from push_ros.actions import GoalServer
from push_ros.belief_feed import BeliefFeed
from push_ros.conversions import circles_from_ros, path_to_ros
from push_ros.diagnostics import Diagnostics
from push_ros.map_feed import MapFeed
from push_ros.names import names_of
from push_ros.parameters import declare_settings
from push_ros.process import run_node
from push_ros.qos import LATCHED
from push_ros.validation import InvalidMessage, planar_pose, stamped_pose
from push_scenario.scenario import Scenario, load_scenario


class OptimizerNode(Node):
    """Plans the next step of a group for whoever asks."""

    def __init__(
        self,
        scenario: Scenario | None = None,
        robots: tuple[str, ...] = (),
        item: str = "",
        namespace: str = "",
        world: str = "",
    ) -> None:
        """robots, item: the group's, all robots of one type. namespace: the team's; world: the
        bridge's, where it is another one."""
        super().__init__("optimizer", namespace=namespace)
        names = names_of(self, world)
        name = self.declare_parameter("scenario", "group-ellipse").value
        scenario = scenario or load_scenario(str(name))
        given = self.declare_parameter("robots", list(robots) or [""]).value
        self.robots = tuple(r for r in given if r) or tuple(scenario.robots)
        item = str(self.declare_parameter("object", item).value)
        _, self._robot = scenario.robot(self.robots[0])
        self.object, self._item = scenario.object(item)
        values = dict(scenario.parameters.get("optimizer", {}))
        weights = values.pop("placement", {})
        self.settings = declare_settings(
            self, StepSettings, values, where="optimizer", apply=self._apply
        )
        self._weights = declare_settings(
            self,
            PlacementSettings,
            weights,
            "placement",
            "optimizer.placement",
        )
        self._grid: Grid | None = None
        self._planner: StepPlanner | None = None
        self.plans = self.failures = 0
        self.last_time = 0.0
        self.planning_time = 0.0
        """[s] CPU time that planning has taken so far."""
        self._diagnostics = Diagnostics(self, names, self._state)
        self._publisher = self.create_publisher(PlanMessage, names.team("group_plan"), LATCHED)
        self._path_publisher = self.create_publisher(Path, names.team("push_path"), LATCHED)
        MapFeed(self, names, self._diagnostics, self._take_map)
        BeliefFeed(self, names, scenario, self._diagnostics, self._take_up)
        self._server = GoalServer(
            self,
            PlanGroupPush,
            names.team("plan_group_push"),
            check=lambda request: None,
            start=self._begin,
            cancel=lambda: self._fail(PlanGroupPush.Result.CANCELED, "canceled"),
            preempt=lambda request: self._preempt(),
        )

    @property
    def ready(self) -> bool:
        """Whether the map is known."""
        return self._grid is not None

    def _apply(self, settings: StepSettings) -> None:
        self.settings = settings
        self._planner = None

    def _take_map(self, grid: Grid) -> None:
        self._grid, self._planner = grid, None

    def _take_up(self, belief: Belief) -> None:
        """Plan with what is believed of the object and the robots now."""
        self._item, self._robot = belief.object(self.object), belief.robot(self.robots[0])
        self._planner = None

    def _preempt(self) -> None:
        if self._server.active:
            self._fail(PlanGroupPush.Result.CANCELED, "a new request replaces this one")

    def _begin(self, request: Any) -> None:
        began, cpu = time.monotonic(), time.thread_time()
        result = PlanGroupPush.Result
        try:
            plan = self._plan(request)
        except TooFew as error:
            self._fail(result.TOO_FEW, str(error))
        except NoStep as error:
            self._fail(result.NO_STEP, str(error))
        except InvalidMessage as error:
            self._fail(result.INVALID_GOAL, str(error))
        except SettingsError as error:
            self._fail(result.UNKNOWN_OBJECT, str(error))
        except _NoMap as error:
            self._fail(result.NO_MAP, str(error))
        else:
            self.plans += 1
            self.last_time = time.monotonic() - began
            now = 1e-9 * int(self.get_clock().now().nanoseconds)
            message = plan_to_ros(plan, self.object, list(request.robots), now)
            self._publisher.publish(message)
            task = plan.trajectory
            speed = np.hypot(task.twist[:, 0], task.twist[:, 1])
            way = Trajectory(task.time, task.pose, np.column_stack([speed, task.twist[:, 2]]))
            self._path_publisher.publish(path_to_ros([way], now))
            self._server.finish(PlanGroupPush.Result(plan=message), success=True)
        self.planning_time += time.thread_time() - cpu

    def _plan(self, request: Any) -> GroupPlan:
        if self._grid is None:
            raise _NoMap("no map has been received on /map")
        if request.object not in ("", self.object):
            raise SettingsError(f"unknown object '{request.object}'")
        if not request.robots or len(request.robots) != len(request.places):
            raise InvalidMessage("each robot needs its place")
        if self._planner is None:
            self._planner = StepPlanner(
                self._grid, self._item, self._robot, self.settings, self._weights
            )
        pose = self._item.mass_pose(planar_pose(request.start, "the start"))
        robots = np.array([planar_pose(p, "a robot") for p in request.places])
        number = {name: i for i, name in enumerate(request.robots)}
        dead = tuple(sorted(number[name] for name in request.dead if name in number))
        others = circles_from_ros(request.obstacles)
        if len(request.time):
            task = trajectory_from_ros(request, self._item)
            return self._planner.along(task, pose, robots, dead, others, request.fewest)
        goal = self._item.mass_pose(stamped_pose(request.goal, "the goal"))
        return self._planner.plan(pose, goal, robots, dead, others, request.fewest)

    def _fail(self, code: int, message: str) -> None:
        self.failures += 1
        self._server.finish(PlanGroupPush.Result(error_code=code, error_msg=message), success=False)

    def _state(self) -> dict[str, Any]:
        return {
            "plans": self.plans,
            "failures": self.failures,
            "last plan time": f"{self.last_time:.3f} s",
            "warning": "" if self._grid is not None else "no map yet",
        }


class _NoMap(Exception):
    """Raised for a request that came before the map."""


def main() -> int:
    """Entry point of the process: ``--ros-args`` on its command line."""
    return run_node(OptimizerNode)


if __name__ == "__main__":
    sys.exit(main())
