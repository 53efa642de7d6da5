"""The node that follows trajectories: an action server that answers every frame of the poses.

It holds what all such nodes have in common: the goal, the heartbeat, the verdicts on frames, the
hold while a pose is missing, the watchdog, status and diagnostics. How a robot is driven is a
``Follower``: by velocities (``node.py``) or by wheel torques (``torque_node.py``).
"""

import math
import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from std_msgs.msg import Header

from push_estimation.pose_gate import PoseGateSettings, Stamp
from push_msgs.action import FollowTrajectory
from push_msgs.msg import ControllerStatus
from push_ros.actions import GoalServer
from push_ros.diagnostics import Diagnostics
from push_ros.heartbeat import HeartbeatWatch
from push_ros.names import inside, names_of_robot
from push_ros.pose_feed import Frame, PoseFeed
from push_ros.qos import STATUS
from push_ros.validation import FRAME, InvalidMessage, check_frame, finite
from push_scenario.scenario import Scenario, load_scenario

_TICK = 0.01  # [s] assumed where the time since the last frame is not known
_FEEDBACK_EVERY = 10  # frames
_WATCH = 0.05  # [s] wall time between looks at the pose stream
_AT_WORK = "following a trajectory"

Command = tuple[float, float] | None
"""What the robot is told: two speeds, or two torques. None: stand."""


@dataclass(frozen=True)
class Followed:
    """Outcome of a tick.

    code: of the FollowTrajectory action, when finished. errors: [m], [rad] to the end. trouble: why
    the solve could not be used; empty where it could. fields: of ControllerStatus. tick: what the
    follower made it from.
    """

    command: Command
    finished: bool
    code: int
    message: str
    progress: float
    errors: tuple[float, float]
    trouble: str
    fields: Mapping[str, float]
    tick: Any


class Follower(Protocol):
    """Drives one robot along one trajectory at a time.

    bodies: whose poses it uses. gate: settings of their gate. sender: who sends the heartbeat.
    """

    bodies: Collection[str]
    gate: PoseGateSettings
    sender: str

    @property
    def tracker(self) -> Any:
        """The core: ``active``, ``stop``, ``solves``, ``failures``, ``settings.give_up`` [s]."""
        ...

    def parse(self, request: Any) -> Any:
        """A task from a goal; raises InvalidMessage for what is wrong with it."""
        ...

    def begin(self, request: Any, task: Any) -> None:
        """Take a task."""
        ...

    def missing(self, frame: Frame) -> str:
        """The body whose pose the task needs and does not have; empty where there is none."""
        ...

    def tick(self, dt: float, frame: Frame) -> Followed:
        """Answer a frame, dt [s] after the one before; every pose that is needed is there."""
        ...

    def rest(self, dt: float, frame: Frame) -> Command:
        """Answer a frame in which no task is worked on; one that there is is kept."""
        ...

    def refused(self) -> Command:
        """Answer a frame that is refused: what it shows, and its time, count for nothing."""
        ...

    def halt(self) -> None:
        """The robot was stopped by an interruption; the task is kept."""
        ...

    def canceled(self) -> None:
        """The goal was canceled: what is to be told before the next frame."""
        ...

    def send(self, command: Command, stamp: Any) -> None:
        """Publish a command as the answer to the frame of a stamp; one that is not finite means
        stand."""
        ...

    def fields(self) -> Mapping[str, float]:
        """Of ControllerStatus, with or without a task."""
        ...

    def show(self, followed: Followed) -> None:
        """Publish what else there is to see of a tick."""
        ...


@dataclass(frozen=True)
class FollowerKind:
    """name: of the node. example: its scenario where none is given. make: a follower for a shell
    that knows its scenario, robot, names and diagnostics; poses come later."""

    name: str
    example: str
    make: Callable[["FollowerNode"], Follower]


class FollowerNode(Node):
    """Answers every frame of the pose stream, whether there is a task or not."""

    def __init__(
        self, kind: FollowerKind, scenario: Scenario | None, robot: str, namespace: str
    ) -> None:
        """namespace: the world's; the node lives in its robot's below it."""
        super().__init__(kind.name, namespace=inside(namespace, robot))
        file = self.declare_parameter("scenario", kind.example).value
        robot = str(self.declare_parameter("robot", robot).value)
        self.scenario = scenario or load_scenario(str(file))
        self.robot, self.spec = self.scenario.robot(robot)
        self.names = names = names_of_robot(self, self.robot)
        self.stamp = Header().stamp
        """Of the last frame."""
        self._held = 0.0  # [s] without a pose that this task needs
        self._ticks = 0
        self._mode, self._at_work = ControllerStatus.IDLE, ControllerStatus.MOVE
        self._reason = "no task"
        self.diagnostics = Diagnostics(self, names, self._state)
        self.follower = kind.make(self)
        self._status = self.create_publisher(
            ControllerStatus, names.robot(self.robot, "controller/status"), STATUS
        )
        self._server = GoalServer(
            self,
            FollowTrajectory,
            names.robot(self.robot, "follow_trajectory"),
            check=self._parse,
            start=self._begin,
            cancel=self._canceled,
            preempt=self._preempt,
        )
        gate, bodies = self.follower.gate, self.follower.bodies
        self.poses = PoseFeed(self, names, gate, bodies, self.diagnostics, self._on_frame)
        self._heartbeat = HeartbeatWatch(self, names, self.robot, self.poses, self.diagnostics)
        self._watched = time.monotonic()
        self._watchdog = self.create_timer(
            _WATCH, self._on_watchdog, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    @property
    def tracker(self) -> Any:
        """The core of the follower."""
        return self.follower.tracker

    # The goal

    def _parse(self, request: Any) -> Any:
        """A task from a goal; raises InvalidMessage."""
        check_frame(request.trajectory.header.frame_id, "the trajectory")
        finite(request.heartbeat_timeout, "the heartbeat timeout")
        if request.heartbeat_timeout < 0.0:
            raise InvalidMessage(
                "the heartbeat timeout must not be negative; 0 turns the check off"
            )
        tolerances = (request.position_tolerance, request.orientation_tolerance)
        finite(tolerances, "a tolerance")
        if min(tolerances) < 0.0:
            raise InvalidMessage(
                "a tolerance must not be negative; 0 means that the node's parameter is used"
            )
        return self.follower.parse(request)

    def _begin(self, request: Any) -> None:
        try:
            task = self._parse(request)
        except InvalidMessage as error:  # a push to go on with may have ended since it was checked
            self.end(FollowTrajectory.Result.INVALID_GOAL, str(error))
            return
        self._heartbeat.begin(float(request.heartbeat_timeout))
        self._held = 0.0
        pushing = request.mode == FollowTrajectory.Goal.PUSH
        self._at_work = ControllerStatus.PUSH if pushing else ControllerStatus.MOVE
        self._mode, self._reason = self._at_work, _AT_WORK
        self.follower.begin(request, task)

    def _preempt(self, request: Any) -> None:
        if not self._server.active:
            return
        code, why = FollowTrajectory.Result.PREEMPTED, "a new trajectory replaces this one"
        if request.going_on:  # without a stop
            self._server.finish(FollowTrajectory.Result(error_code=code, error_msg=why), False)
        else:
            self.end(code, why)

    def _canceled(self) -> None:
        self.end(FollowTrajectory.Result.CANCELED, "canceled")
        self.follower.canceled()

    def end(self, code: int, message: str, followed: Followed | None = None) -> None:
        """End the task under way with a code of the action."""
        self.tracker.stop()
        self._mode, self._reason = ControllerStatus.IDLE, message or "done"
        result = FollowTrajectory.Result(error_code=int(code), error_msg=message)
        if followed is not None:
            result.position_error, result.orientation_error = followed.errors
        self._server.finish(result, success=code == 0)

    # The poses

    def _on_frame(self, frame: Frame) -> None:
        self.stamp = frame.stamp
        if frame.verdict is Stamp.REFUSED:
            self.send(self.follower.refused())
            return
        if frame.verdict is Stamp.RESET:
            self._heartbeat.reset()
            if self.tracker.active:
                self.end(FollowTrajectory.Result.CLOCK_RESET, "the clock jumped back")
        if frame.verdict is Stamp.RESUMED:
            self.follower.halt()
        self._step(frame.elapsed or _TICK, frame)

    def _step(self, dt: float, frame: Frame) -> None:
        follower = self.follower
        if self.tracker.active and self._heartbeat.lost:
            self.end(
                FollowTrajectory.Result.PREEMPTED, f"no heartbeat of the {follower.sender} arrives"
            )
        if not self.tracker.active:
            self.send(follower.rest(dt, frame))
            self._publish_status(None)
            return
        self._ticks += 1
        missing = follower.missing(frame)
        if missing:
            self._hold(dt, frame, missing)
            return
        self._held = 0.0
        followed = follower.tick(dt, frame)
        self.send(followed.command)
        self._mode = ControllerStatus.FALLBACK if followed.trouble else self._at_work
        self._reason = followed.trouble or _AT_WORK
        self._publish_status(followed)
        follower.show(followed)
        if followed.finished:
            self.end(followed.code, followed.message, followed)
        elif self._ticks % _FEEDBACK_EVERY == 0:
            away, turned = followed.errors
            self._server.feedback(
                FollowTrajectory.Feedback(
                    progress=followed.progress, position_error=away, orientation_error=turned
                )
            )

    def _hold(self, dt: float, frame: Frame, missing: str) -> None:
        """Stand while a pose that the task needs is missing; give up after a while."""
        command = self.follower.rest(dt, frame)
        self._mode, self._reason = ControllerStatus.HOLD, f"no valid pose of {missing}"
        self._held += dt
        if self._held > self.tracker.settings.give_up:
            why = f"{self._reason} for {self._held:.1f} s"
            self.end(FollowTrajectory.Result.POSES_STALE, why)
        if self._ticks % _FEEDBACK_EVERY == 0:
            self._server.feedback(FollowTrajectory.Feedback())
        self.send(command)
        self._publish_status(None)

    def _on_watchdog(self) -> None:
        """Wall time: the pose stream may be dead, and with it every other clock."""
        now = time.monotonic()
        held_up, self._watched = now - self._watched > 2.0 * _WATCH, now
        if held_up:  # it was this process that stood still: what came meanwhile comes first
            return
        silence = self.poses.silence
        if not self.tracker.active or silence < 2.0 * self.poses.gate.settings.timeout:
            return
        self.follower.halt()
        self.send(None)
        if silence > self.tracker.settings.give_up:
            self.end(FollowTrajectory.Result.POSES_STALE, f"no poses for {silence:.1f} s")

    # Outputs

    def send(self, command: Command) -> None:
        """Answer the last frame."""
        self.follower.send(command, self.stamp)

    def stop(self) -> None:
        """Last act of a live process: stand."""
        self.send(None)

    def _publish_status(self, followed: Followed | None) -> None:
        fields = dict(self.follower.fields())
        if followed is not None:
            fields.update(followed.fields)
        message = ControllerStatus(
            mode=self._mode,
            robot=self.robot,
            reason=self._reason,
            solves=self.tracker.solves,
            failures=self.tracker.failures,
            **{"curvature_margin": math.inf, "obstacle_margin": math.inf, **fields},
        )
        message.header.stamp = self.stamp
        message.header.frame_id = FRAME
        self._status.publish(message)

    def _state(self) -> dict[str, Any]:
        stale = self.tracker.active and self.poses.silence > 0.3
        return {
            "mode": self._mode,
            "reason": self._reason,
            "solves": self.tracker.solves,
            "failures": self.tracker.failures,
            "poses refused": self.poses.gate.refused,
            "pose jumps": self.poses.gate.jumps,
            "warning": "poses are stale" if stale else "",
        }
