"""The supervisor node: goals in, plans and trajectories out, one state machine in between."""

import struct
import time
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid
from rclpy._rclpy_pybind11 import RCLError
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from std_msgs.msg import Header, String
from std_srvs.srv import Trigger

from push_estimation.pose_gate import PoseGate, PoseGateSettings, Stamp
from push_model import se2
from push_model.arrays import Array
from push_model.occupancy import OccupancyGrid as Grid
from push_model.push_segment import PushSegment
from push_model.settings import SettingsError
from push_model.trajectory import Trajectory
from push_msgs.action import FollowTrajectory, MoveObject, PlanPush
from push_msgs.msg import NamedPoses, PushPlan, SupervisorState
from push_msgs.srv import PlanRobotPath
from push_planner import PlannerSettings, PushPlanner, preemptive_pushes
from push_ros.actions import GoalClient, GoalServer
from push_ros.conversions import (
    circles_to_ros,
    grid_from_ros,
    pose_stamped_to_ros,
    pose_to_ros,
    segment_from_ros,
    time_from_ros,
    trajectory_from_ros,
    trajectory_to_ros,
)
from push_ros.diagnostics import Diagnostics
from push_ros.parameters import declare_settings
from push_ros.qos import COMMAND, LATCHED, STREAM
from push_ros.validation import FRAME, InvalidMessage, planar_pose, stamped_pose
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


class GoalRefused(Exception):
    """A goal that cannot be taken; carries the code."""

    def __init__(self, code: JobError, message: str) -> None:
        super().__init__(message)
        self.code = code


class SupervisorNode(Node):
    """One robot, one object, one job at a time."""

    def __init__(self, scenario: Scenario | None = None, robot: str = "", item: str = "") -> None:
        super().__init__("supervisor")
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
        self._poses = PoseGate(
            declare_settings(self, PoseGateSettings, poses, "poses", "supervisor.poses")
        )
        self._object_radius = self._object_spec.geometry.circumradius
        self.machine = Machine(self.settings, self._at_goal)
        self._obstacles = np.zeros((0, 3))
        self._planner: PushPlanner | None = None  # for pre-emptive pushes; made when first needed
        self._grid: Grid | None = None
        self._ticks = 0
        self._seed = 0
        self._last_wall = time.monotonic()
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
        self._diagnostics = Diagnostics(self, self._diagnose)
        self._connect()
        self._publish_state()

    def _connect(self) -> None:
        events = self._diagnostics.subscription_events
        self._state_publisher = self.create_publisher(SupervisorState, "/supervisor/state", LATCHED)
        self._text_publisher = self.create_publisher(String, "/supervisor/status_text", LATCHED)
        self._heartbeat_publisher = self.create_publisher(
            Header, f"/{self.robot}/heartbeat", STREAM
        )
        self._plan_client = GoalClient(self, PlanPush, "/plan_push")
        self._follow_client = GoalClient(self, FollowTrajectory, f"/{self.robot}/follow_trajectory")
        self._path_client = self.create_client(PlanRobotPath, "/plan_robot_path")
        self._job = GoalServer(
            self,
            MoveObject,
            "/move_object",
            check=lambda request: None,
            refuse=self._refuse_job,
            preempt=self._preempt,
            start=lambda request: self._take_goal(
                stamped_pose(request.goal, "the goal"), bool(request.plan_only)
            ),
            cancel=self._cancel,
        )
        self.create_service(Trigger, "/supervisor/execute", self._on_execute)
        self.create_service(Trigger, "/supervisor/cancel", self._on_cancel)
        self.create_subscription(
            PoseStamped,
            "/goal_pose",
            self._on_goal_pose,
            COMMAND,
            event_callbacks=events("/goal_pose"),
        )
        self.create_subscription(
            OccupancyGrid, "/map", self._on_map, LATCHED, event_callbacks=events("/map")
        )
        self.create_subscription(
            NamedPoses,
            "/poses",
            self._on_poses,
            STREAM,
            event_callbacks=events("/poses"),
            raw=True,
        )
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

    def _on_goal_pose(self, message: PoseStamped) -> None:
        try:
            goal = self._parse_goal(message, "/goal_pose")
        except GoalRefused as refusal:
            self._say_no(refusal)
            return
        self._preempt()
        self._take_goal(goal, False)

    def _refuse_job(self, request: Any) -> Any:
        """The result for a job that cannot be: it never touches the one under way."""
        try:
            if request.object not in ("", self.object):
                raise GoalRefused(JobError.UNKNOWN_OBJECT, f"unknown object '{request.object}'")
            self._parse_goal(request.goal, "/move_object")
        except GoalRefused as refusal:
            self._say_no(refusal)
            return MoveObject.Result(error_code=int(refusal.code), error_msg=str(refusal))
        return None

    def _parse_goal(self, message: PoseStamped, topic: str) -> Array:
        """The goal ``(3,)``; raises GoalRefused."""
        try:
            goal = stamped_pose(message, "the goal")
        except InvalidMessage as error:
            self._diagnostics.refuse(topic, str(error))
            frame = message.header.frame_id != FRAME
            code = JobError.UNKNOWN_FRAME if frame else JobError.INVALID_GOAL
            raise GoalRefused(code, f"goal refused: {error}") from None
        if self._grid is not None and not self._grid.contains(goal[0], goal[1]):
            text = f"({goal[0]:.2f}, {goal[1]:.2f}) lies outside the map"
            self._diagnostics.refuse(topic, text)
            raise GoalRefused(JobError.OUTSIDE_MAP, f"goal refused: {text}")
        return goal

    def _say_no(self, refusal: "GoalRefused") -> None:
        self.get_logger().warning(str(refusal))
        if self.machine.busy:  # a job that is under way goes on, and so does its state
            self._publish_state(str(refusal))
            return
        self.machine.error, self.machine.reason = refusal.code, str(refusal)
        self._publish_state()

    def _preempt(self) -> None:
        if self.machine.busy or self.machine.plan_ready:
            why = "a new goal replaces this one"
            self._fire(Event.ABORT, code=JobError.PREEMPTED, message=why)

    def _take_goal(self, goal: Array, plan_only: bool) -> None:
        self._fire(Event.GOAL, goal=goal, plan_only=plan_only)

    def _on_execute(self, request: Any, response: Any) -> Any:
        response.success = self.machine.plan_ready
        response.message = "executing" if response.success else "there is no plan to execute"
        self._fire(Event.EXECUTE)
        return response

    def _on_cancel(self, request: Any, response: Any) -> Any:
        response.success = self.machine.busy or self.machine.plan_ready
        response.message = "canceled" if response.success else "there is nothing to cancel"
        self._cancel()
        return response

    def _cancel(self) -> None:
        self._fire(Event.CANCEL)

    def _on_poses(self, data: bytes) -> None:
        """Take a frame every 50 ms; the rest of a fast stream is not even deserialised."""
        try:
            # CDR: four bytes of encapsulation, then the header's stamp.
            seconds, nanoseconds = struct.unpack_from("<iI", data, 4)
            if 0.0 <= seconds + 1e-9 * nanoseconds - self._poses.stamp < _POSE_PERIOD:
                return
            message = deserialize_message(data, NamedPoses)
        except (struct.error, RuntimeError, RCLError) as error:
            self._diagnostics.refuse("/poses", f"unreadable: {error}")
            return
        self._take_poses(message)

    def _take_poses(self, message: NamedPoses) -> None:
        if message.header.frame_id != FRAME:
            self._diagnostics.refuse("/poses", f"frame '{message.header.frame_id}'")
            return
        verdict = self._poses.begin(time_from_ros(message.header.stamp))
        if verdict is Stamp.REFUSED:
            self._diagnostics.refuse("/poses", "its stamp is zero or not newer than the last")
            return
        self._last_wall = time.monotonic()
        for named in message.poses:
            if named.name in (self.robot, self.object):
                try:
                    self._poses.accept(named.name, planar_pose(named.pose, named.name))
                except InvalidMessage as error:
                    self._diagnostics.refuse("/poses", str(error))
        if verdict is Stamp.RESET:
            self._fire(Event.CLOCK_RESET)
        self._ticks += 1
        self._heartbeat_publisher.publish(Header(stamp=message.header.stamp, frame_id=FRAME))
        self._retry_waiting()
        if self._ticks % 2 == 0:
            self._watch_displacement()
            if self._job.active:
                self._job.feedback(self._feedback())

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
        if time.monotonic() - self._last_wall > 0.3:
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
        silence = time.monotonic() - self._last_wall
        return None if silence > self.settings.pose_timeout else self._poses.pose(name)

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
        if not self._job.active:
            return
        way, turn = self._errors(self.machine.goal)
        self._job.finish(
            MoveObject.Result(
                error_code=int(code),
                error_msg=message,
                position_error=way,
                orientation_error=turn,
                pushes=self.machine.pushes,
                replans=self.machine.replans,
            ),
            success=code is JobError.NONE,
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

    def _publish_state(self, reason: str = "") -> None:
        m = self.machine
        message = SupervisorState(
            state=int(m.state),
            state_name=m.state.name,
            reason=reason or m.reason,
            error_code=int(m.error),
            plan_ready=m.plan_ready,
            push_index=m.index,
            push_count=len(m.segments),
            replans=m.replans,
        )
        message.header.frame_id = FRAME
        message.header.stamp = pose_stamped_to_ros(np.zeros(3), self._poses.stamp).header.stamp
        if m.goal is not None:
            message.goal = pose_stamped_to_ros(m.goal, self._poses.stamp)
        self._state_publisher.publish(message)
        self._text_publisher.publish(String(data=f"{m.state.name}: {message.reason}"))
        self.get_logger().info(f"{m.state.name}: {message.reason}")

    def _diagnose(self) -> dict[str, Any]:
        m = self.machine
        return {
            "state": m.state.name,
            "reason": m.reason,
            "error code": int(m.error),
            "replans": m.replans,
            "poses refused": self._poses.refused,
            "pose jumps": self._poses.jumps,
            "warning": "no poses" if self._pose(self.object) is None else "",
        }
