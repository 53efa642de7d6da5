"""The grasp optimizer as a ROS node: the PlanGroupPush action.

A plan takes from tenths of a second to some seconds, while the robots stand. It is made in slices
of some hundredths of a second. Between them the node answers other callbacks, so that a request can
be cancelled at any time.
"""

import sys
import time
import traceback
from dataclasses import asdict
from typing import Any

import numpy as np
from nav_msgs.msg import Path
from rclpy.node import Node

from grasp_opt.contact_outline import convex
from grasp_opt.group_messages import plan_to_ros, trajectory_from_ros
from grasp_opt.placement_settings import PlacementSettings, PlacementWeights
from grasp_opt.sequencing import NoStep
from grasp_opt.slices import Work
from grasp_opt.step_planner import GroupPlan, Scene, StepPlanner, TooFew
from grasp_opt.step_settings import StepSettings
from grasp_opt.warm_up import warm_up
from push_model.belief import Belief
from push_model.occupancy import OccupancyGrid as Grid
from push_model.settings import SettingsError
from push_model.stick_certificate import ContactBelief
from push_model.trajectory import Trajectory
from push_msgs.action import PlanGroupPush
from push_msgs.msg import GroupPlan as PlanMessage
from push_ros.actions import GoalServer
from push_ros.belief_feed import BeliefFeed
from push_ros.conversions import circles_from_ros, path_to_ros
from push_ros.diagnostics import Diagnostics
from push_ros.map_feed import FirstMap, MapFeed
from push_ros.names import names_of
from push_ros.parameters import declare_settings
from push_ros.process import run_node
from push_ros.qos import LATCHED
from push_ros.scheduling import Urgency
from push_ros.validation import InvalidMessage, planar_pose, stamped_pose
from push_scenario.scenario import Scenario, load_scenario

_SIGN_OF_LIFE = 0.5  # [s] of wall time between feedback messages


class OptimizerNode(Node):
    """Plans the next step of a group, one request at a time; a new one replaces it."""

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
        self._believed: ContactBelief | None = None
        values = dict(scenario.parameters.get("optimizer", {}))
        weights = values.pop("placement", {})
        self.settings = declare_settings(
            self, StepSettings, values, where="optimizer", apply=self._apply
        )
        self._weights = declare_settings(
            self,
            PlacementWeights,
            weights,
            "placement",
            "optimizer.placement",
        )
        self._grid: Grid | None = None
        self._planner: StepPlanner | None = None
        self._work: Work[GroupPlan] | None = None
        self._queued = False  # whether a slice waits for its turn
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
            cancel=self._canceled,
            preempt=lambda request: self._preempt(),
        )
        self._first_map = FirstMap(self, names, self._on_no_map)
        if failure := warm_up(self._item, self._robot, self._placement):
            self.get_logger().debug(f"warm-up: {failure}")

    @property
    def ready(self) -> bool:
        """Whether the map is known."""
        return self._grid is not None

    def _apply(self, settings: StepSettings) -> None:
        if self._work is not None:
            raise SettingsError("the optimizer is busy; change its parameters when it is idle")
        self.settings = settings
        self._planner = None

    @property
    def _placement(self) -> PlacementSettings:
        return PlacementSettings(**asdict(self._weights))

    def _take_map(self, grid: Grid) -> None:
        """A request that waits is begun; a plan under way on another map is begun anew."""
        self._grid, self._planner = grid, None
        if self._first_map.awaited or self._work is not None:
            self._begin(self._request)

    def _on_no_map(self, reason: str) -> None:
        self._fail(PlanGroupPush.Result.NO_MAP, reason)

    def _take_up(self, belief: Belief) -> None:
        """Plan with what is believed of the object and the robots now."""
        self._item = convex(belief.object(self.object))
        self._robot = belief.robot(self.robots[0])
        self._believed = ContactBelief.of(belief, self.object)
        self._planner = None

    def _preempt(self) -> None:
        if self._server.active:
            self._canceled("a new request replaces this one")

    def _canceled(self, why: str = "canceled") -> None:
        self._first_map.awaited = False
        self._fail(PlanGroupPush.Result.CANCELED, why)

    def _begin(self, request: Any) -> None:
        self._request = request
        self._began = self._told = time.monotonic()
        self._first_map.awaited, self._work = False, None
        if self._grid is None:
            self._first_map.wait()
            return
        self._work = self._plan(request, self._grid)
        self._continue()

    def _continue(self) -> None:
        """Queue the next slice behind whatever else the executor has to do."""
        if not self._queued:
            assert self.executor is not None
            self._queued = True
            self.executor.create_task(self._on_slice)

    def _on_slice(self) -> None:
        self._queued = False
        if self._work is None:
            return
        result, cpu = PlanGroupPush.Result, time.thread_time()
        try:
            next(self._work)
        except StopIteration as end:
            self._succeed(end.value)
        except TooFew as error:
            self._fail(result.TOO_FEW, str(error))
        except NoStep as error:
            self._fail(result.NO_STEP, str(error))
        except InvalidMessage as error:
            self._fail(result.INVALID_GOAL, str(error))
        except SettingsError as error:
            self._fail(result.UNKNOWN_OBJECT, str(error))
        except Exception as error:  # an unexpected one ends the request, not the node
            self.get_logger().error(f"planning failed: {error!r}\n{traceback.format_exc()}")
            self._fail(result.NO_STEP, f"an error of the optimizer, see its log: {error!r}")
        else:
            now = time.monotonic()
            if now - self._told > _SIGN_OF_LIFE:
                self._told = now
                self._server.feedback(PlanGroupPush.Feedback(elapsed=now - self._began))
            self._continue()
        self.planning_time += time.thread_time() - cpu

    def _succeed(self, plan: GroupPlan) -> None:
        self._work = None
        self.plans += 1
        self.last_time = time.monotonic() - self._began
        now = 1e-9 * int(self.get_clock().now().nanoseconds)
        message = plan_to_ros(plan, self.object, list(self._request.robots), now)
        self._publisher.publish(message)
        task = plan.trajectory
        speed = np.hypot(task.twist[:, 0], task.twist[:, 1])
        way = Trajectory(task.time, task.pose, np.column_stack([speed, task.twist[:, 2]]))
        self._path_publisher.publish(path_to_ros([way], now))
        self._server.finish(PlanGroupPush.Result(plan=message), success=True)

    def _plan(self, request: Any, grid: Grid) -> Work[GroupPlan]:
        """The work on a request.

        Raises
        ------
        SettingsError, InvalidMessage: in the first slice, of what is wrong with it. NoStep.
        """
        if request.object not in ("", self.object):
            raise SettingsError(f"unknown object '{request.object}'")
        if not request.robots or len(request.robots) != len(request.places):
            raise InvalidMessage("the request needs one pose for each robot")
        pose = self._item.mass_pose(planar_pose(request.start, "the start"))
        robots = np.array([planar_pose(p, "a robot") for p in request.places])
        number = {name: i for i, name in enumerate(request.robots)}
        dead = tuple(sorted(number[name] for name in request.dead if name in number))
        scene = Scene(pose, robots, dead, circles_from_ros(request.obstacles), request.fewest)
        task = trajectory_from_ros(request, self._item) if len(request.time) else None
        goal = None if task else self._item.mass_pose(stamped_pose(request.goal, "the goal"))
        if self._planner is None:
            self._planner = StepPlanner(
                *(grid, self._item, self._robot, self.settings, self._placement),
                self._believed,
            )
            yield
        if task is not None:
            return (yield from self._planner.planning_along(scene, task))
        assert goal is not None
        return (yield from self._planner.planning(scene, goal))

    def _fail(self, code: int, message: str) -> None:
        self._work = None
        self.failures += 1
        self._server.finish(PlanGroupPush.Result(error_code=code, error_msg=message), success=False)

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
    return run_node(OptimizerNode, urgency=Urgency.BACKGROUND)


if __name__ == "__main__":
    sys.exit(main())
