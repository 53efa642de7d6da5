"""Watches a run from ground truth, for evaluation only."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node

from push_model import se2
from push_model.arrays import Array
from push_msgs.msg import Contacts, ControllerStatus, JobState, Poses, PushPlan
from push_ros.conversions import pose_stamped_to_ros, poses_from_ros, time_from_ros
from push_ros.names import Names
from push_ros.process import heard
from push_ros.qos import COMMAND, LATCHED, STATUS, STREAM


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
    sides: tuple[int, ...] = ()  # of the object, one a push of the last plan
    solve_times: list[float] = field(default_factory=list)


class Observer(Node):
    """Watches a run from ground truth. For evaluation only: it commands nothing but the goal."""

    def __init__(self, names: Names, robots: Sequence[str], item: str, bodies: bool = True) -> None:
        """robots: of the team; what is kept of one robot is of the first. bodies: whether poses and
        contacts are observed, not only what nodes say."""
        super().__init__("observer", namespace=names.team_space.rstrip("/"))
        self.names = names
        robot = robots[0]
        self._robot, self._item, self._team = robot, item, frozenset(robots)
        self.trace = Trace()
        self.state: JobState | None = None
        self._touching = False
        self._apart = 0
        self._poses: dict[str, Array] = {}
        self._truth_topic = names.world("ground_truth/poses")
        status = names.robot(robot, "controller/status")
        if bodies:
            self.create_subscription(Poses, self._truth_topic, self._on_truth, STREAM)
            self.create_subscription(Contacts, names.world("contacts"), self._on_contacts, STREAM)
        self.create_subscription(JobState, names.team("job_state"), self._on_state, LATCHED)
        self.create_subscription(PushPlan, names.team("push_plan"), self._on_plan, LATCHED)
        self.create_subscription(ControllerStatus, status, self._on_status, STATUS)
        self._goal_publisher = self.create_publisher(PoseStamped, names.team("goal_pose"), COMMAND)

    def look_away(self) -> None:
        """Stop observing, e.g. to measure a run without it."""
        for subscription in list(self.subscriptions):
            self.destroy_subscription(subscription)

    @property
    def ready(self) -> bool:
        """Whether it hears the world and the owner of the goals, who would hear a goal."""
        return (
            self.state is not None
            and self.count_publishers(self._truth_topic) > 0
            and heard(self, self._goal_publisher)
        )

    def send_goal(self, goal: Array | bytes) -> None:
        """Publish a goal ``(3,)``, or a serialised message, on /goal_pose."""
        message = goal if isinstance(goal, bytes) else pose_stamped_to_ros(goal, 0.0)
        self._goal_publisher.publish(message)

    def _on_truth(self, message: Poses) -> None:
        t = self.trace
        t.time.append(time_from_ros(message.header.stamp))
        poses, _ = poses_from_ros(message, (self._robot, self._item))
        if self._robot in poses:
            t.robot.append(poses[self._robot])
        if self._item in poses:
            t.object.append(poses[self._item])

    def _on_contacts(self, message: Contacts) -> None:
        ours = {*self._team, self._item}
        touching = False
        for bodies in map(set, zip(message.body_a, message.body_b, strict=True)):
            if self._item in bodies and bodies & self._team:
                touching = True
            elif bodies & ours:
                self.trace.collisions += 1
        pushing = self.state is not None and self.state.state == JobState.PUSHING
        if not pushing:
            self._touching, self._apart = False, 0
        elif touching:
            self._touching, self._apart = True, 0
        elif self._touching:
            self._apart += 1
            if self._apart == 10:  # 0.1 s without touching
                self.trace.contact_losses += 1
                self._touching = False

    def _on_state(self, message: JobState) -> None:
        if message.state == JobState.PUSHING and (
            self.state is None
            or self.state.state != JobState.PUSHING
            or self.state.step_index != message.step_index
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
        self.trace.sides = tuple(int(s.side) for s in message.segments)

    def _on_status(self, message: ControllerStatus) -> None:
        if message.solve_time > 0.0:
            self.trace.solve_times.append(message.solve_time)


def final_errors(trace: Trace, goal: Array) -> tuple[float, float]:
    """Position [m] and orientation [rad] error of the object at the end of a run."""
    local = se2.between(goal, trace.object[-1])
    return float(np.hypot(local[0], local[1])), abs(float(local[2]))
