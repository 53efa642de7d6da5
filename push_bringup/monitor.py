"""A small ROS client for people: sends a goal, tells what becomes of it."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid

from push_bringup.job_result import JobEvent, JobResult, errors_of, result_of
from push_bringup.owner_watch import SILENCE, Owner, OwnerWatch
from push_bringup.systems import team_space
from push_model.arrays import Array
from push_model.jobs import JobError
from push_msgs.msg import JobState, Poses
from push_ros.conversions import pose_stamped_to_ros, poses_from_ros, time_from_ros
from push_ros.latched import visitor
from push_ros.names import Names, space
from push_ros.process import heard
from push_ros.qos import COMMAND, LATCHED, STREAM

Pose = tuple[float, float, float]
_PROGRESS = 2.0  # [s] wall time between events that tell the distance
_MOVED = 1e-3  # [m] of the object since the distance was told, to tell it again
_LOOK = 0.2  # [s] wall time between two looks at the graph
_SAME = 1e-6  # [m], [rad] goals that are the same


class Monitor:
    """Watches the job of a team, and sends it goals. Use it as a context manager.

    state: newest of the owner of the job. pose: ``(3,)`` of its object. Both None until heard.
    """

    def __init__(
        self,
        namespace: str = "",
        team: str = "",
        context: Any = None,
        on_event: Callable[[JobEvent], None] = lambda event: None,
    ) -> None:
        """namespace: the world's. context: of ROS; one of its own when it is not given."""
        self.team = team
        self._names = Names(space(namespace), space(team_space(namespace, team)))
        self._context = context
        self._on_event = on_event
        self._stack = ExitStack()
        self.state: JobState | None = None
        self.pose: Array | None = None
        self.stamp = 0.0  # [s] of the newest poses
        self._map = False
        self._goal: Pose | None = None
        self._sent: PoseStamped | None = None
        self._news: list[JobState] = []
        self._began = False
        self._job = 0  # number of the job that pursues the goal sent; of the one before, until then
        self._begin = self._told = self._looked = 0.0
        self._gap: float | None = None  # [m] the distance that was told last
        self._owner = OwnerWatch(frozenset())
        self._missed = self._restarted = False
        self._said: tuple[str, str] | None = None  # state and reason that were told last

    def __enter__(self) -> "Monitor":
        node, self._spinner = self._stack.enter_context(visitor(self._context))
        self._node, names = node, self._names
        self._publisher = node.create_publisher(PoseStamped, names.team("goal_pose"), COMMAND)
        node.create_subscription(JobState, names.team("job_state"), self._on_state, LATCHED)
        node.create_subscription(OccupancyGrid, names.world("map"), self._on_map, LATCHED)
        node.create_subscription(Poses, names.world("poses"), self._on_poses, STREAM)
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def _on_state(self, message: JobState) -> None:
        self.state = message
        if self._goal is not None:
            self._news.append(message)

    def _on_map(self, message: OccupancyGrid) -> None:
        self._map = True

    def _on_poses(self, message: Poses) -> None:
        self.stamp = time_from_ros(message.header.stamp)
        if self.state is not None:
            item = str(self.state.object)
            self.pose = poses_from_ros(message, (item,))[0].get(item, self.pose)

    def wait(self, limit: float, condition: Callable[[], bool]) -> bool:
        """Spin until the condition holds; whether it did within limit [s] of wall time."""
        return bool(self._spinner.until(condition, limit))

    def spin(self, limit: float = 0.05) -> None:
        """Handle what is there, or wait for it up to limit [s]."""
        self._spinner.once(limit)

    @property
    def ready(self) -> bool:
        """Whether a goal would be heard, and the job could begin."""
        return (
            self.state is not None
            and self._map
            and self.pose is not None
            and heard(self._node, self._publisher)
            and self.supervised
        )

    def connect(self, limit: float, alive: Callable[[], bool] = lambda: True) -> bool:
        """Wait until a goal would be heard; False after limit [s] or when not alive."""
        end = time.monotonic() + limit
        while time.monotonic() < end and alive():
            if self.ready:
                return True
            self.spin()
        return False

    def missing(self) -> str:
        """What a goal still waits for, for a person."""
        if not self.supervised:
            return f"no node publishes {self._names.team('job_state')}"
        if not self._map:
            return f"no map on {self._names.world('map')}"
        if self.pose is None:
            return f"no pose of the object on {self._names.world('poses')}"
        return "" if self.ready else f"no node subscribes to {self._names.team('goal_pose')}"

    @property
    def teams(self) -> tuple[str, ...]:
        """Names of the teams of the world that report their jobs."""
        before, after = self._names.world(""), "/job_state"
        names = (name for name, _ in self._node.get_topic_names_and_types())
        found = (n for n in names if n.startswith(before) and n.endswith(after))
        told = (n for n in found if int(self._node.count_publishers(n)) > 0)
        return tuple(sorted(filter(None, (n[len(before) : -len(after)] for n in told))))

    @property
    def goal_topic(self) -> str:
        """Where its goals go."""
        return str(self._names.team("goal_pose"))

    @property
    def supervised(self) -> bool:
        """Whether there is an owner of jobs; one that was killed is missed after some seconds."""
        return int(self._node.count_publishers(self._names.team("job_state"))) > 0

    def send_goal(self, goal: Pose) -> None:
        """Publish a goal (x, y, theta) [m, m, rad]."""
        self._goal = (float(goal[0]), float(goal[1]), float(goal[2]))
        self._news, self._began, self._restarted, self._said = [], False, False, None
        self._job = 0 if self.state is None else int(self.state.job)
        self._owner = OwnerWatch(self._owners())
        self._begin, self._told, self._gap = self.stamp, time.monotonic(), None
        # its stamp tells it from the goals of others
        self._sent = pose_stamped_to_ros(np.array(self._goal), time.time())
        self._publisher.publish(self._sent)

    def _pursues_mine(self, state: JobState) -> bool:
        """Whether the job is that of the goal sent, or of the same goal sent by somebody else."""
        if state.goal == self._sent:
            return True
        if not self._began or self._sent is None:
            return False
        if not state.goal.header.frame_id:
            return False  # a task that was no goal
        mine, other = self._sent.pose, state.goal.pose
        gaps = (
            mine.position.x - other.position.x,
            mine.position.y - other.position.y,
            mine.orientation.z - other.orientation.z,
            mine.orientation.w - other.orientation.w,
        )
        return max(abs(float(g)) for g in gaps) < _SAME

    def poll(self) -> JobResult | None:
        """The result of the goal that was sent, as soon as there is one."""
        assert self._goal is not None, "no goal has been sent"
        while self._news:
            state = self._news.pop(0)
            if state.refusals and state.refused_goal == self._sent:
                refused = result_of(state, self._goal, self.pose, 0.0, self.team)
                code, reason = JobError(int(state.refusal_code)), f"goal refused: {state.refusal}"
                return replace(refused, code=code, reason=reason, refused=True)
            if self._pursues_mine(state):
                self._began, self._job = True, int(state.job)
                said = str(state.state_name), str(state.reason)
                if said != self._said:  # and not again for progress alone
                    self._said = said
                    self._tell("state")
                if state.state == JobState.IDLE:
                    duration = self.stamp - self._begin
                    return result_of(state, self._goal, self.pose, duration, self.team)
            elif state.job < self._job or (self._began and state.job == self._job):
                return self._forgotten()  # each goal that is taken has a higher number
            elif self._began and self._restarted:
                return self._forgotten()
            elif self._began:
                return self.unfinished("another goal has replaced this one", JobError.PREEMPTED)
        if time.monotonic() - self._looked > _LOOK:
            self._looked = time.monotonic()
            result = self._look_for_owner()
            if result is not None:
                return result
        if time.monotonic() - self._told > _PROGRESS and self.state is not None:
            self._tell_progress()
        return None

    def _owners(self) -> frozenset[bytes]:
        """Publishers of the state of the job."""
        found = self._node.get_publishers_info_by_topic(self._names.team("job_state"))
        return frozenset(bytes(info.endpoint_gid) for info in found)

    def _look_for_owner(self) -> JobResult | None:
        """The result where the owner of the job is gone for good; tells when it is missed."""
        world = int(self._node.count_publishers(self._names.world("poses"))) > 0
        before, self._missed = self._missed, False
        owner = self._owner.look(time.monotonic(), self._owners(), world)
        if owner is Owner.REPLACED:  # what it says of the job decides
            self._restarted, self._owner = True, OwnerWatch(self._owners())
            self._tell("returned", "the node that owns the job was restarted")
        if owner is Owner.ENDED:
            return self.unfinished("the nodes have ended before the job")
        if owner is Owner.SILENT:
            return self.unfinished(
                f"the node that owns the job has published nothing for {SILENCE:g} s; if it is "
                "only frozen, the job may continue later",
                JobError.OWNER_SILENT,
            )
        if owner is Owner.MISSING:
            self._missed = True
            if not before:
                text = (
                    "the node that owns the job publishes nothing; it may be frozen, or have died"
                )
                self._tell("silent", text)
        elif owner is Owner.RETURNED:
            self._tell("returned", "the node that owns the job publishes again")
        return None

    def _forgotten(self) -> JobResult:
        return self.unfinished(
            "the node that owned the job was restarted and does not continue it; "
            "send the goal again",
            JobError.JOB_FORGOTTEN,
        )

    def unfinished(self, reason: str, code: JobError | None = None) -> JobResult:
        """The result of a goal whose end nobody saw."""
        assert self._goal is not None
        position, orientation = errors_of(self._goal, self.pose)
        duration = self.stamp - self._begin
        return JobResult(code, reason, self._goal, position, orientation, duration, team=self.team)

    def _tell_progress(self) -> None:
        """Tell the distance, unless it is still what was told: robots may only walk."""
        assert self._goal is not None
        gap = None if self.pose is None else errors_of(self._goal, self.pose)[0]
        if gap is not None and (self._gap is None or abs(gap - self._gap) >= _MOVED):
            self._gap = gap
            self._tell("progress")

    def _tell(self, kind: str, why: str = "") -> None:
        assert self._goal is not None and (self.state is not None)
        self._told = time.monotonic()
        gap = None if self.pose is None else errors_of(self._goal, self.pose)[0]
        state = self.state
        name, reason = str(state.state_name).lower(), why or str(state.reason)
        self._on_event(JobEvent(kind, self.team, self.stamp, name, reason, gap))

    def follow(self, limit: float, alive: Callable[[], bool] = lambda: True) -> JobResult:
        """Wait until the job ends, or its plan waits for the execute command.

        Its code is None after limit [s] of wall time, when no longer alive, and when all nodes have
        ended. Where the owner of the job is frozen or was restarted, a code of its own says so.
        """
        end = time.monotonic() + limit
        while time.monotonic() < end:
            if not alive():
                return self.unfinished("the nodes have ended before the job")
            self.spin()
            result = self.poll()
            if result is not None:
                return result
        return self.unfinished(f"the job did not end within {limit:g} s")
