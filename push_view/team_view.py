"""A team in the viewer: its job, plan and panel, and the requests to it."""

import contextlib
import math
import time
from collections.abc import Callable, Sequence
from typing import Any

from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import Path
from rclpy.action import ActionClient
from rclpy.node import Node
from std_srvs.srv import Trigger

from push_model.arrays import Array
from push_msgs.action import MoveObject
from push_msgs.msg import GroupPlan, JobState, PushPlan
from push_record.planned import Plan, from_group_plan, from_path, from_push_plan, merged
from push_record.topics import MANY
from push_ros.conversions import pose_stamped_to_ros, time_from_ros
from push_ros.names import Names
from push_ros.process import heard
from push_ros.qos import COMMAND, LATCHED
from push_ros.validation import InvalidMessage, planar_pose
from push_view.event_board import EventBoard
from push_view.graph_delay import GraphDelay
from push_view.page_data import plan_json
from push_view.report_panel import LivePanel

_LOG = 60  # states kept
_BACK = 0.5  # [s] by which time goes back where a run begins anew


def stamp_text(message: PoseStamped) -> str:
    """Key by which a goal is recognised."""
    return f"{message.header.stamp.sec}.{message.header.stamp.nanosec:09d}"


class TeamView:
    """One owner of jobs. Lives in the executor's thread; ``hears`` may be read from any."""

    def __init__(self, node: Node, names: Names, board: EventBoard) -> None:
        self.names, self.space = names, names.team_space
        self.hears = False
        self.delay = GraphDelay()
        self._commands: Any = None
        self._node, self._board = node, board
        self._panel: LivePanel | None = None
        self._log: list[list[Any]] = []
        self._of = ("", ())  # system and robots that the panel is of
        self._plans: list[Plan] = []
        self._job, self._planned_in = 0, -1
        self._goals = node.create_publisher(PoseStamped, names.team("goal_pose"), COMMAND)
        self._cancel = node.create_client(Trigger, names.team("cancel"))
        self._execute = node.create_client(Trigger, names.team("execute"))
        self._previews = ActionClient(node, MoveObject, names.team("move_object"))
        subscribe, at = node.create_subscription, names.team
        self._subscriptions = [
            subscribe(JobState, at("job_state"), self._on_state, LATCHED),
            subscribe(PushPlan, at("push_plan"), self._on_push_plan, LATCHED),
            subscribe(GroupPlan, at("group_plan"), self._on_group_plan, LATCHED),
            subscribe(Path, at("push_path"), self._on_path, LATCHED),
        ]

    def close(self) -> None:
        """Remove the team from the graph and from the pages."""
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)
        self._watch_commands(())
        self._node.destroy_publisher(self._goals)
        self._node.destroy_client(self._cancel)
        self._node.destroy_client(self._execute)
        self._previews.destroy()
        if self._panel is not None:
            self._panel.close()
        for kind in ("team", "members", "log", "plan", "panel"):
            self._board.drop(f"{kind} {self.space}")

    def look(self) -> None:
        """Check in the graph whether a node accepts goals."""
        self.hears = heard(self._node, self._goals)

    def show_panel(self) -> None:
        """Bring the figures and shapes of its reports up to date."""
        if self._panel is None:
            return
        rows, delay = self._panel.rows(), self.delay.summary()
        if delay is not None:
            text = f"{1e3 * delay[0]:.1f} ms, longest {1e3 * delay[1]:.1f} ms"
            value = round(delay[0], 5)
            rows.append({"name": "poses to command", "text": text, "value": value, "unit": "s"})
        self._put("panel", rows=rows, shapes=self._panel.shapes())

    def goal_message(self, pose: Array, nanoseconds: int) -> PoseStamped:
        """A goal ``(3,)``, stamped with a wall time [ns]."""
        message = pose_stamped_to_ros(pose, 0.0)
        message.header.stamp.sec = nanoseconds // 1_000_000_000
        message.header.stamp.nanosec = nanoseconds % 1_000_000_000
        return message

    def send(self, message: PoseStamped) -> None:
        """Publish a goal."""
        self._goals.publish(message)

    def preview(self, message: PoseStamped) -> None:
        """Ask for a plan to a goal that waits until ``execute``."""
        self._previews.send_goal_async(MoveObject.Goal(goal=message, plan_only=True))

    def cancel(self, answer: Callable[[bool, str], None]) -> None:
        """Ask to cancel the job, or to drop the plan that waits."""
        self._ask(self._cancel, answer)

    def execute(self, answer: Callable[[bool, str], None]) -> None:
        """Ask to carry out the plan that waits."""
        self._ask(self._execute, answer)

    def _ask(self, client: Any, answer: Callable[[bool, str], None]) -> None:
        future = client.call_async(Trigger.Request())
        future.add_done_callback(lambda f: answer(f.result().success, f.result().message))

    def _put(self, kind: str, **data: Any) -> None:
        self._board.put(f"{kind} {self.space}", kind, {"space": self.space, **data})

    def _forget(self) -> None:
        """What was of the run before: its states, its plan, its figures."""
        self._log, self._plans, self._of = [], [], ("", ())
        self._put_plan()

    def _on_state(self, message: JobState) -> None:
        moment = round(time_from_ros(message.header.stamp), 1)
        if self._log and moment < self._log[-1][0] - _BACK:
            self._forget()
        goal = None
        if message.goal.header.frame_id:
            with contextlib.suppress(InvalidMessage):
                goal = planar_pose(message.goal.pose, "the goal").tolist()
        self._follow(message)
        self._job = int(message.job)
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
            plan_ready=bool(message.plan_ready),
            refusals=int(message.refusals),
            refusal=message.refusal,
            refused_stamp=stamp_text(message.refused_goal),
        )
        entry = [moment, message.state_name, message.reason]
        if not self._log or self._log[-1][1:] != entry[1:]:
            self._log.append(entry)
            del self._log[:-_LOG]
            self._put("log", entries=self._log)

    def _follow(self, message: JobState) -> None:
        """Send the page the members of the team, and the reports of its method."""
        of = (message.system, tuple(message.robots))
        if of == self._of:
            return
        self._of = of
        self._put("members", robots=of[1])
        if self._panel is not None:
            self._panel.close()
            self._board.drop(f"panel {self.space}")
        self._panel = LivePanel(self._node, self.names, of[1])
        self._watch_commands(of[1])

    def _watch_commands(self, robots: Sequence[str]) -> None:
        """Measure the delay of the first robot's commands."""
        if self._commands is not None:
            self._node.destroy_subscription(self._commands)
            self._commands = None
        if robots and len(robots) < MANY:
            self._commands = self._node.create_subscription(
                TwistStamped,
                self.names.robot(robots[0], "cmd_vel"),
                lambda data: self.delay.command(data, time.monotonic()),
                COMMAND,
                raw=True,
            )

    def _on_push_plan(self, message: PushPlan) -> None:
        self._plans = [from_push_plan(message, 0.0)]
        self._put_plan()

    def _on_group_plan(self, message: GroupPlan) -> None:
        if self._planned_in != self._job:
            self._planned_in, self._plans = self._job, []
        self._plans.append(from_group_plan(message, 0.0, len(self._plans)))
        self._put_plan()

    def _on_path(self, message: Path) -> None:
        """A path is shown where nothing says more about the plan."""
        plans = ("push_plan", "group_plan")
        if not any(self._node.count_publishers(self.names.team(t)) for t in plans):
            self._plans = [from_path(message, 0.0)]
            self._put_plan()

    def _put_plan(self) -> None:
        self._put("plan", **plan_json(merged(self._plans)))
