"""Watches a run from ground truth, for evaluation only."""

from dataclasses import dataclass, field

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node

from push_model import se2
from push_model.arrays import Array
from push_msgs.msg import Contacts, ControllerStatus, NamedPoses, PushPlan, SupervisorState
from push_ros.conversions import pose_stamped_to_ros, time_from_ros
from push_ros.process import reaches
from push_ros.qos import COMMAND, LATCHED, STATUS, STREAM
from push_ros.validation import planar_pose


@dataclass
class Trace:
    """What an observer saw: time ``(n,)`` [s] and ground truth of robot and object ``(n, 3)``."""

    time: list[float] = field(default_factory=list)
    robot: list[Array] = field(default_factory=list)
    object: list[Array] = field(default_factory=list)
    states: list[tuple[float, str, str, int]] = field(default_factory=list)
    pushes: int = 0
    contact_losses: int = 0
    collisions: int = 0
    plan_time: float = 0.0
    solve_times: list[float] = field(default_factory=list)


class Observer(Node):
    """Watches a run from ground truth. For evaluation only: it commands nothing but the goal."""

    def __init__(self, robot: str, item: str) -> None:
        super().__init__("observer")
        self._robot, self._item = robot, item
        self.trace = Trace()
        self.state: SupervisorState | None = None
        self._touching = False
        self._apart = 0
        self._poses: dict[str, Array] = {}
        self.create_subscription(NamedPoses, "/ground_truth/poses", self._on_truth, STREAM)
        self.create_subscription(Contacts, "/contacts", self._on_contacts, STREAM)
        self.create_subscription(SupervisorState, "/supervisor/state", self._on_state, LATCHED)
        self.create_subscription(PushPlan, "/push_plan", self._on_plan, LATCHED)
        self.create_subscription(ControllerStatus, "/controller/status", self._on_status, STATUS)
        self._goal_publisher = self.create_publisher(PoseStamped, "/goal_pose", COMMAND)

    def look_away(self) -> None:
        """Stop observing, e.g. to measure a run without it."""
        for subscription in list(self.subscriptions):
            self.destroy_subscription(subscription)

    @property
    def connected(self) -> bool:
        """Whether a goal would be received."""
        return reaches(self, self._goal_publisher, "supervisor")

    def send_goal(self, goal: Array) -> None:
        """Publish a goal ``(3,)`` on /goal_pose."""
        self._goal_publisher.publish(pose_stamped_to_ros(goal, 0.0))

    def _on_truth(self, message: NamedPoses) -> None:
        t = self.trace
        t.time.append(time_from_ros(message.header.stamp))
        for named in message.poses:
            pose = planar_pose(named.pose, named.name)
            if named.name == self._robot:
                t.robot.append(pose)
            elif named.name == self._item:
                t.object.append(pose)

    def _on_contacts(self, message: Contacts) -> None:
        pair = {self._robot, self._item}
        touching = False
        for contact in message.contacts:
            bodies = {contact.body_a, contact.body_b}
            if bodies == pair:
                touching = True
            elif bodies & pair:
                self.trace.collisions += 1
        pushing = self.state is not None and self.state.state == SupervisorState.PUSHING
        if not pushing:
            self._touching, self._apart = False, 0
        elif touching:
            self._touching, self._apart = True, 0
        elif self._touching:
            self._apart += 1
            if self._apart == 10:  # 0.1 s without touching
                self.trace.contact_losses += 1
                self._touching = False

    def _on_state(self, message: SupervisorState) -> None:
        if message.state == SupervisorState.PUSHING and (
            self.state is None
            or self.state.state != SupervisorState.PUSHING
            or self.state.push_index != message.push_index
        ):
            self.trace.pushes += 1
        self.state = message
        self.trace.states.append(
            (
                time_from_ros(message.header.stamp),
                message.state_name,
                message.reason,
                message.error_code,
            )
        )

    def _on_plan(self, message: PushPlan) -> None:
        self.trace.plan_time = float(message.statistics.plan_time)

    def _on_status(self, message: ControllerStatus) -> None:
        if message.solve_time > 0.0:
            self.trace.solve_times.append(message.solve_time)


def final_errors(trace: Trace, goal: Array) -> tuple[float, float]:
    """Position [m] and orientation [rad] error of the object at the end of a run."""
    local = se2.between(goal, trace.object[-1])
    return float(np.hypot(local[0], local[1])), abs(float(local[2]))
