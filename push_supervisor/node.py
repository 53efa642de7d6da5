"""The supervisor node: goals in, plans and trajectories out, one state machine in between."""

import sys
import time
from typing import Any

import numpy as np
from nav_msgs.msg import OccupancyGrid
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from std_msgs.msg import Header

from push_estimation.pose_gate import PoseGateSettings, Stamp
from push_model import se2
from push_model.arrays import Array
from push_model.jobs import GoalRefused
from push_model.occupancy import OccupancyGrid as Grid
from push_model.push_segment import PushSegment
from push_model.settings import SettingsError
from push_model.trajectory import Trajectory
from push_msgs.action import FollowTrajectory, MoveObject, PlanPush
from push_msgs.msg import PushPlan
from push_msgs.srv import PlanRobotPath
from push_planner import PlannerSettings, PushPlanner, preemptive_pushes
from push_ros.actions import GoalClient
from push_ros.conversions import (
    circles_to_ros,
    grid_from_ros,
    pose_stamped_to_ros,
    pose_to_ros,
    segment_from_ros,
    trajectory_from_ros,
    trajectory_to_ros,
)
from push_ros.diagnostics import Diagnostics
from push_ros.job_intake import JobIntake
from push_ros.names import names_of
from push_ros.parameters import declare_settings
from push_ros.pose_feed import Frame, PoseFeed
from push_ros.process import run_node
from push_ros.qos import LATCHED, STREAM
from push_ros.validation import FRAME, InvalidMessage
from push_scenario.scenario import Scenario, load_scenario
from push_supervisor import (
    Command,
    Event,
    JobError,
    Machine,
    State,
    SupervisorSettings,
    motions,
)

_PLAN_ERRORS = {
    PlanPush.Result.INVALID_GOAL: JobError.INVALID_GOAL,
    PlanPush.Result.UNKNOWN_OBJECT: JobError.UNKNOWN_OBJECT,
    PlanPush.Result.UNKNOWN_FRAME: JobError.UNKNOWN_FRAME,
    PlanPush.Result.OUTSIDE_MAP: JobError.OUTSIDE_MAP,
    PlanPush.Result.GOAL_OCCUPIED: JobError.GOAL_OCCUPIED,
}
_RETRY_CODES = (PlanPush.Result.NO_PUSH_SEQUENCE,)
_ASKS = 3  # times that the planner is asked the same
_POSE_PERIOD = 0.045  # [s] of the frames that are looked at


class SupervisorNode(Node):
    """One robot, one object, one job at a time."""

    def __init__(
        self,
        scenario: Scenario | None = None,
        robot: str = "",
        item: str = "",
        namespace: str = "",
        world: str = "",
    ) -> None:
        """namespace: the team's; world: the bridge's, where it is another one."""
        super().__init__("supervisor", namespace=namespace)
        self.names = names_of(self, world)
        name = self.declare_parameter("scenario", "env1-target1").value
        robot = str(self.declare_parameter("robot", robot).value)
        item = str(self.declare_parameter("object", item).value)
        self._scenario = scenario or load_scenario(str(name))
        self.robot, self._robot_spec = self._scenario.robot(robot)
        self.object, self._object_spec = self._scenario.object(item)
        values = dict(self._scenario.parameters.get("supervisor", {}))
        poses = {"persistence": 3, **values.pop("poses", {})}
        self.settings = declare_settings(
            self, SupervisorSettings, values, where="supervisor", apply=self._apply
        )
        self._planner_settings = declare_settings(
            self,
            PlannerSettings,
            self._scenario.parameters.get("planner", {}),
            "planner",
            "planner",
        )
        gate = declare_settings(self, PoseGateSettings, poses, "poses", "supervisor.poses")
        self._object_radius = self._object_spec.geometry.circumradius
        self.machine = Machine(self.settings, self._at_goal)
        self._obstacles = np.zeros((0, 3))
        self._planner: PushPlanner | None = None  # for pre-emptive pushes; made when first needed
        self._grid: Grid | None = None
        self._ticks = 0
        self._seed = 0
        self._lost_since: float | None = None
        self._displaced = 0
        self._following = False
        self._last_sign = self._last_sign_wall = 0.0
        self._path_token = 0
        self._asked: tuple[Command, dict[str, Any]] | None = None  # of the planner, not answered
        self._asked_wall = 0.0
        self._asks = 0
        self._queue: list[tuple[Event, dict[str, Any]]] = []
        self._handling = False
        self._waiting: tuple[Command, dict[str, Any]] | None = None
        self._diagnostics = Diagnostics(self, self.names, self._diagnose)
        self._connect(gate)
        self._publish_state()

    def _connect(self, gate: PoseGateSettings) -> None:
        names, diagnostics = self.names, self._diagnostics
        heartbeat = names.robot(self.robot, "heartbeat")
        self._heartbeat_publisher = self.create_publisher(Header, heartbeat, STREAM)
        self._plan_client = GoalClient(self, PlanPush, names.team("plan_push"))
        self._follow_client = GoalClient(
            self, FollowTrajectory, names.robot(self.robot, "follow_trajectory")
        )
        self._path_client = self.create_client(PlanRobotPath, names.team("plan_robot_path"))
        self._intake = JobIntake(
            self, names, diagnostics, self, "single", [self.robot], self.object
        )
        self.create_subscription(
            OccupancyGrid,
            names.world("map"),
            self._on_map,
            LATCHED,
            event_callbacks=diagnostics.subscription_events(names.world("map")),
        )
        bodies = list(self._scenario.radii)
        self._poses = PoseFeed(self, names, gate, bodies, diagnostics, self._on_frame, _POSE_PERIOD)
        self._watchdog = self.create_timer(
            0.1, self._on_watchdog, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    @property
    def ready(self) -> bool:
        """Whether a goal could be worked on: the map is known, and the other nodes are there."""
        return (
            self._grid is not None
            and self._plan_client.ready
            and self._follow_client.ready
            and self._path_client.service_is_ready()
        )

    def _apply(self, settings: SupervisorSettings) -> None:
        if self.machine.busy:
            raise SettingsError("the supervisor is busy; change its parameters when it is idle")
        self.settings = settings
        self.machine.settings = settings
        if self._grid is not None:
            self._take_grid(self._grid)

    # Inputs

    def _on_map(self, message: OccupancyGrid) -> None:
        try:
            grid = grid_from_ros(message)
        except InvalidMessage as error:
            self._diagnostics.refuse("/map", str(error))
            return
        self._take_grid(grid)

    def _take_grid(self, grid: Grid) -> None:
        self._grid, self._planner = grid, None
        margin = self.settings.obstacle_margin
        self._obstacles = motions.wall_circles(grid, self._robot_spec.body_radius, margin)

    @property
    def busy(self) -> bool:
        """See JobOwner."""
        return self.machine.busy

    @property
    def plan_ready(self) -> bool:
        """See JobOwner."""
        return self.machine.plan_ready

    def check_goal(self, goal: Array) -> None:
        """See JobOwner."""
        if self._grid is not None and not self._grid.contains(goal[0], goal[1]):
            text = f"({goal[0]:.2f}, {goal[1]:.2f}) lies outside the map"
            raise GoalRefused(JobError.OUTSIDE_MAP, text)

    def take_goal(self, goal: Array, plan_only: bool) -> None:
        """See JobOwner."""
        self._fire(Event.GOAL, goal=goal, plan_only=plan_only)

    def end_job(self, code: JobError, message: str) -> None:
        """See JobOwner."""
        self._fire(Event.ABORT, code=code, message=message)

    def execute(self) -> None:
        """See JobOwner."""
        self._fire(Event.EXECUTE)

    def _on_frame(self, frame: Frame) -> None:
        """Frames come every 50 ms."""
        if frame.verdict is Stamp.REFUSED:
            return
        if frame.verdict is Stamp.RESET:
            self._fire(Event.CLOCK_RESET)
        self._ticks += 1
        self._heartbeat_publisher.publish(Header(stamp=frame.stamp, frame_id=FRAME))
        self._retry_waiting()
        if self._ticks % 2 == 0:
            self._watch_displacement()
            if self._intake.waited_for:
                self._intake.feedback(self._feedback())

    def _watch_displacement(self) -> None:
        """Whether somebody moved the object while the robot was on its way to it."""
        machine = self.machine
        if machine.state not in (State.POSITIONING, State.APPROACH) or not machine.segments:
            self._displaced = 0
            return
        item = self._poses.pose(self.object)
        if item is None:
            return
        way, turn = motions.displacement(machine.segment, item)
        off = way > self.settings.displacement or turn > self.settings.displacement_turn
        self._displaced = self._displaced + 1 if off else 0
        if self._displaced >= 3:
            self._displaced = 0
            self._fire(
                Event.DISPLACED,
                message=f"the object stands {1e3 * way:.0f} mm and {turn:.2f} rad from where the "
                "push was to begin",
            )

    def _on_watchdog(self) -> None:
        """Wall time: a lost controller, a silent pose stream."""
        if self._poses.silence > 0.3:
            self._retry_waiting()

    # The machine

    def _fire(self, event: Event, **payload: Any) -> None:
        """Give an event to the machine and carry out its commands, one event after the other."""
        self._queue.append((event, payload))
        if self._handling:
            return
        self._handling = True
        try:
            while self._queue:
                event, payload = self._queue.pop(0)
                before = (self.machine.state, self.machine.reason)
                commands = self.machine.handle(event, **payload)
                for command, arguments in commands:
                    self._carry_out(command, arguments)
                ended = any(command is Command.FINISH for command, _ in commands)
                if ended or (self.machine.state, self.machine.reason) != before:
                    self._publish_state()
        finally:
            self._handling = False

    def _carry_out(self, command: Command, arguments: dict[str, Any]) -> None:
        self._waiting = self._asked = None
        if command in (Command.STOP, Command.CANCEL_PLAN):
            self._let_go()
        elif command is Command.FINISH:
            self._let_go()
            self._asks = 0
            self._end_job(arguments["code"], arguments["message"])
        else:
            self._waiting = (command, arguments)
            self._lost_since = None
            self._retry_waiting()

    def _retry_waiting(self) -> None:
        """Send what waits as soon as its server is there and the poses are."""
        if self._waiting is None:
            self._watch_servers()
            return
        command, arguments = self._waiting
        server_ready = {
            Command.PLAN: lambda: self._plan_client.ready,
            Command.OFFER: lambda: True,
            Command.PATH: self._path_client.service_is_ready,
        }.get(command, lambda: self._follow_client.ready)
        robot, item = self._pose(self.robot), self._pose(self.object)
        if robot is not None and item is not None and server_ready():
            self._waiting = None
            self._lost_since = None
            self._send(command, arguments, robot, item)
            return
        now = time.monotonic()
        self._lost_since = self._lost_since or now
        if now - self._lost_since > self.settings.node_timeout:
            self._waiting = self._lost_since = None
            poses = robot is None or item is None
            self._fire(
                Event.ABORT,
                code=JobError.POSES_STALE if poses else JobError.NODE_LOST,
                message="no poses of robot and object" if poses else "a node does not answer",
            )

    def _pose(self, name: str) -> Array | None:
        """The pose ``(3,)`` of a body, None when it is not known now."""
        silent = self._poses.silence > self.settings.pose_timeout
        return None if silent else self._poses.pose(name)

    def _watch_servers(self) -> None:
        """A node that dies in the middle of its work never answers.

        Its servers stay in the graph for seconds, and those of one started in its place look the
        same: only feedback tells. That of the controller is measured in pose time, which stands
        still with the poses, and in wall time, for a simulation that runs fast; that of the planner
        in wall time, which it works in.
        """
        wall = time.monotonic() - self._last_sign_wall
        silence = min(self._poses.stamp - self._last_sign, wall)
        if self._following and silence > self.settings.controller_timeout:
            self._following = False
            self._follow_client.forget()
            self._fire(Event.MOTION_FAILED, message="the controller is gone", lost=True)
        if self._asked is None:
            return
        if time.monotonic() - self._asked_wall > self.settings.answer_timeout:
            command, arguments = self._asked
            self._let_go()
            self._asked = None
            if self._asks >= _ASKS:
                self._fire(
                    Event.ABORT, code=JobError.NODE_LOST, message="the planner does not answer"
                )
            else:
                self.get_logger().warning("the planner does not answer; asking again")
                self._waiting = (command, arguments)

    def _let_go(self) -> None:
        """Cancel what the other nodes are doing for this one, and ignore late answers."""
        self._plan_client.forget()
        self._follow_client.forget()
        self._following = False
        self._path_token += 1

    def _answered(self) -> None:
        self._asked, self._asks = None, 0

    def _send(self, command: Command, arguments: dict[str, Any], robot: Array, item: Array) -> None:
        if command in (Command.PLAN, Command.PATH):
            self._asked, self._asked_wall = (command, arguments), time.monotonic()
            self._asks += 1
        if command is Command.PLAN:
            offer: PushSegment | None = arguments["start"]
            self._request_plan(item if offer is None else offer.object_end, arguments["goal"])
        elif command is Command.OFFER:
            self._offer(item, arguments["goal"])
        elif command is Command.PATH:
            self._request_path(robot, item, arguments["segment"])
        elif command is Command.FOLLOW_PATH:
            margin = self.settings.obstacle_margin
            reach = self._object_radius + self._robot_spec.body_radius + margin
            circles = np.vstack([self._obstacles, [[item[0], item[1], reach]]])
            self._move(arguments["trajectory"], circles)
        elif command is Command.FOLLOW_APPROACH:
            way = motions.approach(arguments["segment"], robot, item, self.settings)
            self._move(way, np.zeros((0, 3)))
        elif command is Command.FOLLOW_PUSH:
            self._push(arguments["segment"])
        else:
            self._move(motions.retreat(robot, self.settings), self._obstacles)

    def _request_plan(self, start: Array, goal: Array) -> None:
        now = self._poses.stamp
        request = PlanPush.Goal(
            object=self.object,
            robot=self.robot,
            start=pose_stamped_to_ros(start, now),
            goal=pose_stamped_to_ros(goal, now),
        )

        def sign(feedback: Any) -> None:
            self._asked_wall = time.monotonic()

        def done(result: Any) -> None:
            self._answered()
            if result is None:
                self._fire(
                    Event.PLAN_FAILED,
                    code=JobError.PLANNING_FAILED,
                    message="the planner rejected the request",
                    retry=False,
                )
            elif result.error_code == PlanPush.Result.NONE:
                self._take_plan(result.plan)
            else:
                code = _PLAN_ERRORS.get(result.error_code, JobError.PLANNING_FAILED)
                self._fire(
                    Event.PLAN_FAILED,
                    code=code,
                    message=result.error_msg,
                    retry=result.error_code in _RETRY_CODES,
                )

        self._plan_client.send(request, done, sign)

    def _take_plan(self, plan: PushPlan) -> None:
        try:
            segments = [segment_from_ros(s) for s in plan.segments]
        except InvalidMessage as error:
            self._fire(
                Event.PLAN_FAILED,
                code=JobError.PLANNING_FAILED,
                message=f"the plan is not valid: {error}",
                retry=False,
            )
            return
        self._fire(Event.PLANNED, segments=segments)

    def _offer(self, item: Array, goal: Array) -> None:
        if self._grid is None:
            self._fire(Event.OFFERS, segments=[])
            return
        if self._planner is None:
            self._planner = PushPlanner(
                self._planner_settings, self._grid, self._robot_spec, self._object_spec
            )
        self._seed += 1
        seed = self._planner_settings.seed + self._seed
        found = preemptive_pushes(self._planner, item, goal, seed)
        self._fire(Event.OFFERS, segments=found)

    def _request_path(self, robot: Array, item: Array, segment: PushSegment) -> None:
        standoff = motions.standoff(segment, item)
        reach = self._object_radius + self._robot_spec.footprint_radius
        request = PlanRobotPath.Request(
            robot=self.robot,
            start=pose_to_ros(robot),
            goal=pose_to_ros(standoff),
            obstacles=circles_to_ros(np.array([[item[0], item[1], reach]])),
        )
        self._path_token += 1
        token = self._path_token

        def done(future: Any) -> None:
            if token != self._path_token:
                return
            self._answered()
            answer = future.result()
            if answer is None or answer.error_code != PlanRobotPath.Response.NONE:
                text = "no answer" if answer is None else answer.message
                self._fire(Event.PATH_FAILED, message=text)
                return
            try:
                trajectory = trajectory_from_ros(answer.trajectory)
            except InvalidMessage as error:
                self._fire(Event.PATH_FAILED, message=str(error))
                return
            self._fire(Event.PATH, trajectory=trajectory)

        self._path_client.call_async(request).add_done_callback(done)

    def _move(self, trajectory: Trajectory, circles: Array) -> None:
        goal = FollowTrajectory.Goal(
            mode=FollowTrajectory.Goal.MOVE,
            object=self.object,
            trajectory=trajectory_to_ros(trajectory),
            obstacles=circles_to_ros(motions.near(circles, trajectory)),
            heartbeat_timeout=self.settings.heartbeat_timeout,
        )
        self._send_follow(goal)

    def _push(self, segment: PushSegment) -> None:
        goal = FollowTrajectory.Goal(
            mode=FollowTrajectory.Goal.PUSH,
            object=self.object,
            trajectory=trajectory_to_ros(segment.trajectory),
            contact=pose_to_ros(segment.grasp),
            curvature_min=segment.limits.minimum,
            curvature_max=segment.limits.maximum,
            obstacles=circles_to_ros(motions.near(self._obstacles, segment.trajectory)),
            heartbeat_timeout=self.settings.heartbeat_timeout,
        )
        self._send_follow(goal)

    def _send_follow(self, goal: Any) -> None:
        def done(result: Any) -> None:
            self._following = False
            if result is None:
                self._fire(Event.MOTION_FAILED, message="the controller rejected the trajectory")
            elif result.error_code == FollowTrajectory.Result.NONE:
                self._fire(Event.MOTION_DONE)
            elif result.error_code == FollowTrajectory.Result.CLOCK_RESET:
                self._fire(Event.CLOCK_RESET)
            else:
                self._fire(Event.MOTION_FAILED, message=result.error_msg)

        def sign(feedback: Any) -> None:
            self._last_sign, self._last_sign_wall = self._poses.stamp, time.monotonic()

        self._following = True
        sign(None)
        self._follow_client.send(goal, done, sign)

    # Outputs

    def _errors(self, goal: Any) -> tuple[float, float]:
        item = self._pose(self.object)
        if item is None or goal is None:
            return float("inf"), float("inf")
        local = se2.between(goal, item)
        return float(np.hypot(local[0], local[1])), abs(float(local[2]))

    def _at_goal(self, goal: Any) -> tuple[bool, str]:
        way, turn = self._errors(goal)
        s = self.settings
        there = way <= s.position_tolerance and turn <= s.orientation_tolerance
        return there, f"{1e3 * way:.1f} mm, {turn:.3f} rad"

    def _end_job(self, code: JobError, message: str) -> None:
        way, turn = self._errors(self.machine.goal)
        self._intake.finish(
            MoveObject.Result(
                error_code=int(code),
                error_msg=message,
                position_error=way,
                orientation_error=turn,
                pushes=self.machine.pushes,
                replans=self.machine.replans,
            )
        )

    def _feedback(self) -> Any:
        way, _ = self._errors(self.machine.goal)
        m = self.machine
        return MoveObject.Feedback(
            state=int(m.state),
            state_name=m.state.name,
            push_index=m.index,
            push_count=len(m.segments),
            distance_to_goal=way,
        )

    def _publish_state(self) -> None:
        m = self.machine
        done = min(m.index, len(m.segments))
        self._intake.publish(
            self._poses.stamp,
            state=int(m.state),
            state_name=m.state.name,
            reason=m.reason,
            error_code=int(m.error),
            progress=done / len(m.segments) if m.segments else float(not m.busy),
            step_index=m.index,
            step_count=len(m.segments),
            replans=m.replans,
        )
        self.get_logger().info(f"{m.state.name}: {m.reason}")

    def _diagnose(self) -> dict[str, Any]:
        m = self.machine
        return {
            "state": m.state.name,
            "reason": m.reason,
            "error code": int(m.error),
            "replans": m.replans,
            "poses refused": self._poses.gate.refused,
            "pose jumps": self._poses.gate.jumps,
            "warning": "no poses" if self._pose(self.object) is None else "",
        }


def main() -> int:
    """Entry point of the process: ``--ros-args`` on its command line."""
    return run_node(SupervisorNode)


if __name__ == "__main__":
    sys.exit(main())
