"""What the nodes of a group and of a swarm share: they answer every frame of the pose stream with
one message for all robots of their team, have one job at a time, and watch over it.
"""

import time
from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from std_msgs.msg import Header

from push_estimation.pose_gate import PoseGateSettings, Stamp
from push_model.arrays import Array
from push_model.jobs import JobError, JobPhase
from push_model.occupancy import OccupancyGrid as Grid
from push_ros.diagnostics import Diagnostics
from push_ros.job_intake import JobIntake
from push_ros.map_feed import MapFeed
from push_ros.names import names_of
from push_ros.pose_feed import Frame, PoseFeed
from push_scenario.scenario import Scenario, load_scenario

PATIENCE = 10.0  # [s] wall time for poses, and for other nodes


class TeamNode(Node, ABC):
    """Robots of one type, one object, one job at a time.

    robots, object: names; scenario: what they come from. What a node does with frames and maps, and
    how it tells of its job, are the methods below that are not given.
    """

    def __init__(
        self,
        kind: str,
        example: str,
        scenario: Scenario | None,
        robots: tuple[str, ...],
        item: str,
        namespace: str,
        world: str,
    ) -> None:
        """kind: of the node, its name. example: scenario when none is given. robots, item: the
        team's. namespace: the team's; world: the bridge's, where it is another one."""
        super().__init__(kind, namespace=namespace)
        self.names = names_of(self, world)
        name = self.declare_parameter("scenario", example).value
        self.scenario = scenario = scenario or load_scenario(str(name))
        given = self.declare_parameter("robots", list(robots) or [""]).value
        self.robots = tuple(r for r in given if r) or tuple(scenario.robots)
        item = str(self.declare_parameter("object", item).value)
        _, self._robot = scenario.robot(self.robots[0])
        self.object, self._item = scenario.object(item)
        self._others = {
            k: r for k, r in scenario.radii.items() if k not in (*self.robots, self.object)
        }
        self._kind = kind
        self._grid: Grid | None = None
        self._waiting = time.monotonic()  # since when poses are waited for
        self._told: tuple[JobPhase, str, int] | None = None
        self._stamp = Header().stamp
        self._pose = np.zeros(3)
        self._diagnostics = Diagnostics(self, self.names, self._state)

    def listen(self, gate: PoseGateSettings) -> None:
        """To poses, goals and maps; the node has made what it answers with."""
        names = self.names
        self._poses = PoseFeed(
            self,
            names,
            gate,
            [*self.robots, self.object, *self._others],
            self._diagnostics,
            self._on_frame,
        )
        self._intake = JobIntake(
            self, names, self._diagnostics, self, self._kind, list(self.robots), self.object
        )
        MapFeed(self, names, self._diagnostics, self._take_map)
        self._watchdog = self.create_timer(
            0.1, self._on_watchdog, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    # The owner of the job, see JobOwner

    @property
    @abstractmethod
    def busy(self) -> bool:
        """See JobOwner."""

    @property
    def plan_ready(self) -> bool:
        """A team makes no plan that waits."""
        return False

    @abstractmethod
    def check_goal(self, goal: Array) -> None:
        """See JobOwner."""

    @abstractmethod
    def take_goal(self, goal: Array, plan_only: bool) -> None:
        """See JobOwner."""

    @abstractmethod
    def end_job(self, code: JobError, message: str) -> None:
        """See JobOwner."""

    def execute(self) -> None:
        """See JobOwner; there is never a plan that waits."""

    # The world

    def _on_frame(self, frame: Frame) -> None:
        self._stamp = frame.stamp
        twists: dict[str, tuple[float, float]] = {}
        if frame.verdict is Stamp.RESET:
            self._on_reset()
        elif frame.verdict is not Stamp.REFUSED:
            twists = self._tick()
        self._publish(twists)
        self._look_after_job()

    def _on_reset(self) -> None:
        self.end_job(JobError.CLOCK_RESET, "the clock went back")

    @abstractmethod
    def _take_map(self, grid: Grid) -> None:
        """Another map than before."""

    @abstractmethod
    def _tick(self) -> dict[str, tuple[float, float]]:
        """Commands by name; robots without one stand."""

    @abstractmethod
    def _publish(self, twists: dict[str, tuple[float, float]]) -> None:
        """To every robot, also those that are not seen: they stand."""

    @abstractmethod
    def _on_watchdog(self) -> None:
        """Wall time, for when nothing comes."""

    # Outputs

    def _tell(self, state: tuple[JobPhase, str, int]) -> None:
        """How the job stands: phase, reason, step; and that it has ended."""
        if state == self._told:
            return
        ended = self._told is not None and self._told[0] is not JobPhase.IDLE
        self._told = state
        self._publish_state()
        if ended and not self.busy:
            self._finish()

    @abstractmethod
    def _look_after_job(self) -> None:
        """Tell how the job stands, and see to what it waits for."""

    @abstractmethod
    def _publish_state(self) -> None:
        """JobState, and feedback to whoever waits."""

    @abstractmethod
    def _finish(self) -> None:
        """Tell whoever waits how the job ended."""

    @abstractmethod
    def _state(self) -> dict[str, Any]:
        """For diagnostics."""
