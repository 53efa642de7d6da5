"""A whole run in one process: every node on one executor, in lockstep, repeatable to the bit."""

import os
import time
from collections.abc import Callable

import rclpy
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from push_model.arrays import Array
from push_mpc.node import ControllerNode
from push_msgs.msg import JobState
from push_planner.node import PlannerNode
from push_ros.process import Spinner, claim_domain, prepare_environment
from push_scenario.scenario import Scenario
from push_study.observer import Observer
from push_supervisor.node import SupervisorNode
from sim_bridge.node import BridgeNode


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
            self.controller = ControllerNode(self.scenario, self.scenario.robot()[0])
            nodes.append(self.controller)
            self.planner = PlannerNode(self.scenario)
            nodes.append(self.planner)
            self.supervisor = SupervisorNode(self.scenario)
            nodes.append(self.supervisor)
            self.observer = Observer(
                self.supervisor.names, self.supervisor.robot, self.supervisor.object
            )
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

        def connected() -> bool:
            return (
                self.supervisor.ready
                and self.planner.ready
                and len(self.bridge.commanded()) == 1
                and self.bridge.heard_by(2)
                and self.observer.connected
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

    def reach(self, goal: Array, sim_limit: float = 300.0) -> JobState | None:
        """Send a goal and wait until its job ends; the state then, or None after sim_limit [s]."""
        before = self.observer.state
        assert before is not None, "the run has not been started"
        jobs, refusals = int(before.job), int(before.refusals)
        self.observer.send_goal(goal)

        def ended() -> bool:
            state = self.observer.state
            assert state is not None
            begun = state.job > jobs and state.state == JobState.IDLE and not state.plan_ready
            return begun or state.refusals > refusals

        return self.observer.state if self.spin_until(ended, sim_limit) else None
