"""A whole run in one process: every node on one executor, in lockstep, repeatable to the bit."""

import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from push_model import se2
from push_model.arrays import Array
from push_mpc.node import ControllerNode
from push_msgs.msg import Contacts, ControllerStatus, NamedPoses, PushPlan, SupervisorState
from push_planner.node import PlannerNode
from push_ros.conversions import pose_stamped_to_ros, time_from_ros
from push_ros.process import Spinner, claim_domain, prepare_environment, reaches
from push_ros.qos import COMMAND, LATCHED, STATUS, STREAM
from push_ros.scenario import Scenario
from push_ros.validation import planar_pose
from push_supervisor.node import SupervisorNode
from sim_bridge.node import BridgeNode


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


class LockstepRun:
    """The graph of a scenario in this process. Use it as a context manager."""

    def __init__(
        self,
        scenario: Scenario,
        extra: Callable[[], list[Node]] | None = None,
        world: Scenario | None = None,
        quiet: bool = False,
    ) -> None:
        """Make the nodes.

        Parameters
        ----------
        scenario: what planner, controller and supervisor believe.
        extra: makes further nodes, e.g. a recorder, once ROS is up.
        world: what the bridge simulates, when it differs from what is believed.
        quiet: log warnings only.
        """
        prepare_environment()
        if quiet:
            set_logger_level("", LoggingSeverity.WARN)
        if "ROS_DOMAIN_ID" not in os.environ:
            claim_domain()
        if not rclpy.ok():
            rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
            self._owns_context = True
        else:
            self._owns_context = False
        self.scenario = scenario.settings("bridge", lockstep=True)
        simulated = (world or scenario).settings("bridge", lockstep=True)
        self.spinner: Spinner | None = None
        nodes: list[Node] = []
        try:
            self.bridge = BridgeNode(simulated, autostart=False)
            nodes.append(self.bridge)
            self.controller = ControllerNode(self.scenario)
            nodes.append(self.controller)
            self.planner = PlannerNode(self.scenario)
            nodes.append(self.planner)
            self.supervisor = SupervisorNode(self.scenario)
            nodes.append(self.supervisor)
            self.observer = Observer(self.supervisor.robot, self.supervisor.object)
            nodes.append(self.observer)
            nodes.extend(extra() if extra else [])
        except BaseException:
            for node in nodes:
                node.destroy_node()
            self._shutdown()
            raise
        self.spinner = Spinner(nodes)

    def __enter__(self) -> "LockstepRun":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Destroy everything that this run made."""
        if self.spinner is not None:
            self.spinner.close()
        self._shutdown()

    def _shutdown(self) -> None:
        if self._owns_context:
            rclpy.try_shutdown()

    def connect(self, limit: float = 20.0) -> None:
        """Wait until all parts know each other; nothing moves before."""
        assert self.spinner is not None
        robot = self.supervisor.robot

        def connected() -> bool:
            return (
                self.supervisor.ready
                and self.planner.ready
                and self.bridge.count_publishers(f"/{robot}/cmd_vel") > 0
                and self.bridge.count_subscribers("/poses") >= 2
                and self.observer.count_publishers("/ground_truth/poses") > 0
                and self.observer.connected
                and self.observer.state is not None
            )

        if not self.spinner.until(connected, limit):
            raise RuntimeError("the nodes did not find each other")
        # Endpoints are matched a moment after they are known.
        end = time.monotonic() + 0.5
        self.spinner.until(lambda: time.monotonic() > end, 1.0)

    def start(self) -> None:
        """Connect and begin to step."""
        self.connect()
        self.bridge.start()

    def spin_until(
        self, condition: Callable[[], bool], sim_limit: float, wall_limit: float = 600.0
    ) -> bool:
        """Spin until the condition holds; False after sim_limit [s] sim time or wall_limit [s]."""
        assert self.spinner is not None
        end = self.bridge.time + sim_limit
        self.spinner.until(lambda: condition() or self.bridge.time > end, wall_limit)
        return condition()

    def reach(self, goal: Array, sim_limit: float = 300.0) -> SupervisorState | None:
        """Send a goal and wait until its job ends; the state then, or None after sim_limit [s]."""
        seen = len(self.observer.trace.states)
        began = False
        self.observer.send_goal(goal)

        def ended() -> bool:
            nonlocal began
            state = self.observer.state
            if state is None:
                return False
            if len(self.observer.trace.states) > seen:
                began = True
            return began and state.state == SupervisorState.IDLE and not state.plan_ready

        return self.observer.state if self.spin_until(ended, sim_limit) else None


def final_errors(trace: Trace, goal: Array) -> tuple[float, float]:
    """Position [m] and orientation [rad] error of the object at the end of a run."""
    local = se2.between(goal, trace.object[-1])
    return float(np.hypot(local[0], local[1])), abs(float(local[2]))
