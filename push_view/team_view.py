"""A team in the viewer: its job, plan and panel, and the requests to it."""

import contextlib
import math
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from rclpy.node import Node
from std_srvs.srv import Trigger

from push_model.arrays import Array
from push_msgs.msg import JobState
from push_ros.conversions import pose_stamped_to_ros, time_from_ros
from push_ros.names import Names
from push_ros.process import heard
from push_ros.qos import COMMAND, LATCHED
from push_ros.validation import InvalidMessage, planar_pose
from push_view.event_board import EventBoard
from push_view.report_panel import LivePanel

_LOG = 60  # states kept
_POINTS = 400  # of a path that are sent to a page


def stamp_text(message: PoseStamped) -> str:
    """Key by which a goal is recognised."""
    return f"{message.header.stamp.sec}.{message.header.stamp.nanosec:09d}"


class TeamView:
    """One owner of jobs. Lives in the executor's thread; ``hears`` may be read from any."""

    def __init__(self, node: Node, names: Names, board: EventBoard) -> None:
        self.names, self.space = names, names.team_space
        self.hears = False
        self._node, self._board = node, board
        self._panel: LivePanel | None = None
        self._log: list[list[Any]] = []
        self._of = ("", ())  # system and robots that the panel is of
        self._goals = node.create_publisher(PoseStamped, names.team("goal_pose"), COMMAND)
        self._cancel = node.create_client(Trigger, names.team("cancel"))
        self._subscriptions = [
            node.create_subscription(JobState, names.team("job_state"), self._on_state, LATCHED),
            node.create_subscription(Path, names.team("push_path"), self._on_path, LATCHED),
        ]

    def close(self) -> None:
        """Remove the team from the graph and from the pages."""
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)
        self._node.destroy_publisher(self._goals)
        self._node.destroy_client(self._cancel)
        if self._panel is not None:
            self._panel.close()
        for kind in ("team", "members", "log", "path", "panel"):
            self._board.drop(f"{kind} {self.space}")

    def look(self) -> None:
        """Check in the graph whether a node accepts goals."""
        self.hears = heard(self._node, self._goals)

    def show_panel(self) -> None:
        """Bring the figures and shapes of its reports up to date."""
        if self._panel is not None:
            self._put("panel", rows=self._panel.rows(), shapes=self._panel.shapes())

    def goal_message(self, pose: Array, nanoseconds: int) -> PoseStamped:
        """A goal ``(3,)``, stamped with a wall time [ns]."""
        message = pose_stamped_to_ros(pose, 0.0)
        message.header.stamp.sec = nanoseconds // 1_000_000_000
        message.header.stamp.nanosec = nanoseconds % 1_000_000_000
        return message

    def send(self, message: PoseStamped) -> None:
        """Publish a goal."""
        self._goals.publish(message)

    def cancel(self) -> None:
        """Ask to cancel the job."""
        self._cancel.call_async(Trigger.Request())

    def _put(self, kind: str, **data: Any) -> None:
        self._board.put(f"{kind} {self.space}", kind, {"space": self.space, **data})

    def _on_state(self, message: JobState) -> None:
        goal = None
        if message.goal.header.frame_id:
            with contextlib.suppress(InvalidMessage):
                goal = planar_pose(message.goal.pose, "the goal").tolist()
        self._follow(message)
        progress = float(message.progress)
        self._put(
            "team",
            system=message.system,
            object=message.object,
            state=message.state_name,
            reason=message.reason,
            code=int(message.error_code),
            job=int(message.job),
            goal=goal,
            stamp=stamp_text(message.goal),
            progress=round(progress, 3) if math.isfinite(progress) else 0.0,
            step=[int(message.step_index) + 1, int(message.step_count)],
            replans=int(message.replans),
            refusals=int(message.refusals),
            refusal=message.refusal,
            refused_stamp=stamp_text(message.refused_goal),
        )
        entry = [round(time_from_ros(message.header.stamp), 1), message.state_name, message.reason]
        if not self._log or self._log[-1][1:] != entry[1:]:
            self._log.append(entry)
            del self._log[:-_LOG]
            self._put("log", entries=self._log)

    def _follow(self, message: JobState) -> None:
        """Give the page who belongs to the team, and what its method reports."""
        of = (message.system, tuple(message.robots))
        if of == self._of:
            return
        self._of = of
        self._put("members", robots=of[1])
        if self._panel is not None:
            self._panel.close()
            self._board.drop(f"panel {self.space}")
        self._panel = LivePanel(self._node, self.names, of[1])

    def _on_path(self, message: Path) -> None:
        points = np.array([[p.pose.position.x, p.pose.position.y] for p in message.poses])
        points = points.reshape(-1, 2)
        if not np.isfinite(points).all():
            points = np.zeros((0, 2))
        if len(points) > _POINTS:
            points = points[np.linspace(0, len(points) - 1, _POINTS).astype(int)]
        self._put(
            "path", x=np.round(points[:, 0], 4).tolist(), y=np.round(points[:, 1], 4).tolist()
        )
