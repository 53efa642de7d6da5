"""A small ROS client for people: sends a goal, shows what the supervisor does."""

import sys
import time
from collections.abc import Callable

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid
from rclpy.signals import SignalHandlerOptions

from push_msgs.msg import JobState, Poses
from push_ros.conversions import pose_stamped_to_ros, time_from_ros
from push_ros.process import Spinner, heard, prepare_environment
from push_ros.qos import COMMAND, LATCHED, STREAM


class Monitor:
    """Use it as a context manager; it owns its ROS context.

    state: newest of the supervisor. position: (x, y) [m] of the object. Both None until heard.
    """

    def __enter__(self) -> "Monitor":
        prepare_environment()
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node("monitor")
        self.state: JobState | None = None
        self.position: tuple[float, float] | None = None
        self.stamp = 0.0  # [s] of the newest poses
        self._map = False
        self._news = 0
        self._goal: tuple[float, float, float] | None = None
        self._sent: PoseStamped | None = None
        self._publisher = self._node.create_publisher(PoseStamped, "goal_pose", COMMAND)
        self._node.create_subscription(JobState, "job_state", self._on_state, LATCHED)
        self._node.create_subscription(OccupancyGrid, "map", self._on_map, LATCHED)
        self._node.create_subscription(Poses, "poses", self._on_poses, STREAM)
        self._spinner = Spinner([self._node])
        return self

    def __exit__(self, *_: object) -> None:
        self._spinner.close()
        rclpy.try_shutdown()

    def _on_state(self, message: JobState) -> None:
        self.state = message
        self._news += 1
        if self._goal is not None:
            print(f"  {message.state_name.lower():12s} {message.reason}", flush=True)

    def _on_map(self, message: OccupancyGrid) -> None:
        self._map = True

    def _on_poses(self, message: Poses) -> None:
        self.stamp = time_from_ros(message.header.stamp)
        if len(message.names) >= 2:
            self.position = (message.x[-1], message.y[-1])

    def wait(self, limit: float, condition: Callable[[], bool]) -> bool:
        """Spin until the condition holds; whether it did within limit [s] of wall time."""
        return self._spinner.until(condition, limit)

    def connect(self, limit: float, alive: Callable[[], bool] = lambda: True) -> bool:
        """Wait for supervisor, map and poses; False after limit [s] or when not alive."""
        end = time.monotonic() + limit
        while time.monotonic() < end and alive():
            ready = (
                self.state is not None
                and self._map
                and self.position is not None
                and heard(self._node, self._publisher)
                and self.supervised
            )
            if ready:
                return True
            self._spinner.once(0.05)
        return False

    @property
    def supervised(self) -> bool:
        """Whether there is a supervisor; one that was killed is missed after some seconds."""
        return int(self._node.count_publishers("job_state")) > 0

    def send_goal(self, goal: tuple[float, float, float]) -> None:
        """Publish a goal (x, y, theta) [m, m, rad]."""
        self._goal = goal
        self._news = 0
        # its stamp tells it from the goals of others
        self._sent = pose_stamped_to_ros(np.array(goal), time.time())
        self._publisher.publish(self._sent)

    def _is_mine(self, message: PoseStamped) -> bool:
        assert self._sent is not None
        return bool(message == self._sent)

    def follow(self, limit: float, alive: Callable[[], bool]) -> int:
        """Show progress until the job ends, or its plan waits for the execute command.

        Returns 0 on success, 1 otherwise.
        """
        assert self._goal is not None
        end = time.monotonic() + limit
        shown = 0.0
        began = False
        while time.monotonic() < end:
            if not alive():
                print("error: the nodes have ended before the job", file=sys.stderr)
                return 1
            self._spinner.once(0.1)
            state = self.state
            if self._news and state is not None:
                if state.refusals and self._is_mine(state.refused_goal):
                    print(f"  goal refused: {state.refusal}", flush=True)
                    return 1
                if self._is_mine(state.goal):
                    began = True
                    if state.state == JobState.IDLE:
                        return 0 if state.error_code == 0 else 1
                elif began:
                    print("error: another goal has replaced this one", file=sys.stderr)
                    return 1
            if time.monotonic() - shown > 2.0 and self.position is not None:
                shown = time.monotonic()
                gap = np.hypot(self.position[0] - self._goal[0], self.position[1] - self._goal[1])
                print(f"  {gap:6.3f} m to go", flush=True)
        print("error: the job did not end in time", file=sys.stderr)
        return 1
