"""The contents of a bag as time series: bodies, jobs of all teams, controllers, collisions."""

from collections.abc import Container
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import numpy as np

from push_model.arrays import Array
from push_record.bag import read_bag, read_metadata
from push_record.collisions import Collisions
from push_ros.validation import InvalidMessage, planar_pose
from push_scenario.scenario import Scenario, scenario_from_text

STATUS = (
    "time",
    "error_x",
    "error_y",
    "error_theta",
    "solve_time",
    "curvature_margin",
    "obstacle_margin",
    "object_offset_y",
)
"""Columns of a controller's status, see push_msgs/ControllerStatus."""

GROUP_STATUS = (
    "time",
    "position_error",
    "orientation_error",
    "lacking",
    "margin",
    "solve_time",
    "wrench_x",
    "wrench_y",
    "wrench_torque",
)
"""Columns of a group's status, see push_msgs/GroupStatus."""

_SPACING = 0.02  # [s] shortest time between frames that are kept
_MOMENTS = 2.0  # [s] between complete messages of a swarm that are kept
_MOVING = (1, 2)  # modes MOVE and PUSH of ControllerStatus


@dataclass(frozen=True)
class State:
    """State of a job at a time [s]; code: of the last job that ended."""

    time: float
    name: str
    reason: str
    code: int


@dataclass
class GroupPushes:
    """One push of a group: pushers, and rows of numbers at its ticks.

    rows: of GROUP_STATUS. points, normals, forces: ``(n, 2)`` each, fixed frame, by tick.
    """

    pushers: tuple[str, ...]
    friction: float
    rows: list[list[float]] = field(default_factory=list)
    points: list[Array] = field(default_factory=list)
    normals: list[Array] = field(default_factory=list)
    forces: list[Array] = field(default_factory=list)


@dataclass
class SwarmTicks:
    """Status of a swarm: rows of time [s], position error [m], orientation error [rad], CPU [s] and
    phase; and complete push_msgs/SwarmStatus messages every few seconds."""

    rows: list[tuple[float, float, float, float, str]] = field(default_factory=list)
    moments: list[Any] = field(default_factory=list)


@dataclass
class Job:
    """What a team did. goal ``(3,)``: the last one; plan: ``(n, 2)`` [m] path of the axle in each
    push, or of the object that a group pushes; pushes: of a group; swarm: of a swarm."""

    space: str
    system: str = ""
    robots: tuple[str, ...] = ()
    object: str = ""
    states: list[State] = field(default_factory=list)
    goal: Array | None = None
    plan: list[Array] = field(default_factory=list)
    pushes: list["GroupPushes"] = field(default_factory=list)
    swarm: SwarmTicks = field(default_factory=SwarmTicks)


@dataclass
class BagContents:
    """time ``(n,)`` [s]; poses ``(n, 3)`` by body, ground truth, nan where unknown.

    status: by robot, by column of STATUS ``(k,)``; jobs: by the team's namespace.
    """

    scenario: Scenario
    metadata: dict[str, str]
    collisions: Collisions
    time: Array = field(default_factory=lambda: np.zeros(0))
    poses: dict[str, Array] = field(default_factory=dict)
    status: dict[str, dict[str, Array]] = field(default_factory=dict)
    jobs: dict[str, Job] = field(default_factory=dict)


class _Suffixes(Container[str]):
    """Topics by the end of their names, in any namespace."""

    def __init__(self, *suffixes: str) -> None:
        self._suffixes = tuple(f"/{s}" for s in suffixes)

    def __contains__(self, topic: object) -> bool:
        return str(topic).endswith(self._suffixes)


def _seconds(stamp: Any) -> float:
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


class _Frames:
    """Collects frames of poses into arrays."""

    def __init__(self, names: tuple[str, ...]) -> None:
        self._index = {name: i for i, name in enumerate(names)}
        self.times: list[float] = []
        self.frames: list[Array] = []
        self._last: tuple[float, Array] | None = None

    def take(self, message: Any) -> None:
        frame = np.full((len(self._index), 3), np.nan)
        known = [(self._index[n], i) for i, n in enumerate(message.names) if n in self._index]
        if known:
            rows, columns = np.array(known).T
            frame[rows] = np.column_stack([message.x, message.y, message.theta])[columns]
        time = _seconds(message.header.stamp)
        self._last = (time, frame)
        if not self.times or not 0.0 <= time - self.times[-1] < _SPACING - 1e-9:
            self._keep()

    def finish(self) -> tuple[Array, dict[str, Array]]:
        """Times and poses by name, the last frame among them."""
        self._keep()
        if not self.frames:
            return np.zeros(0), {}
        table = np.array(self.frames)
        seen = {name: table[:, i] for name, i in self._index.items()}
        return np.array(self.times), {n: p for n, p in seen.items() if np.isfinite(p).any()}

    def _keep(self) -> None:
        if self._last is not None:
            self.times.append(self._last[0])
            self.frames.append(self._last[1])
            self._last = None


def bag_scenario(bag: Path) -> tuple[Scenario, dict[str, str]]:
    """The scenario in a bag, and all its metadata.

    Raises
    ------
    ValueError: the bag holds no scenario. FileNotFoundError: it is none.
    """
    metadata = read_metadata(bag)
    if "scenario" not in metadata:
        raise ValueError(f"{bag}: no scenario in it; was it recorded by planar-push?")
    name = metadata.get("scenario_name", "scenario")
    return scenario_from_text(metadata["scenario"], name, str(bag)), metadata


def load(bag: Path) -> BagContents:
    """Read the data of a report.

    Raises
    ------
    ValueError: the bag holds no scenario. FileNotFoundError: it is none.
    """
    scenario, metadata = bag_scenario(bag)
    collisions = Collisions(frozenset(scenario.robots), frozenset(scenario.objects))
    contents = BagContents(scenario, metadata, collisions)
    frames = _Frames((*scenario.robots, *scenario.objects))
    status: dict[str, list[list[float]]] = {}
    wanted = _Suffixes(
        "ground_truth/poses",
        "job_state",
        "push_plan",
        "group_plan",
        "group_status",
        "swarm_status",
        "contacts",
        "controller/status",
    )
    for record in read_bag(bag, cast(set[str], wanted)):
        m = record.message
        if record.topic.endswith("/ground_truth/poses"):
            frames.take(m)
        elif record.topic.endswith("/controller/status"):
            if m.mode in _MOVING:
                row = [_seconds(m.header.stamp), *(getattr(m, k) for k in STATUS[1:])]
                status.setdefault(str(m.robot), []).append(row)
        elif record.topic.endswith("/contacts"):
            collisions.take(_seconds(m.header.stamp), m.body_a, m.body_b)
        else:
            space = record.topic.rpartition("/")[0] + "/"
            job = contents.jobs.setdefault(space, Job(space))
            if record.topic.endswith("/job_state"):
                _take_state(job, m)
            elif record.topic.endswith("/group_plan"):
                job.plan.append(np.column_stack([m.x, m.y]))
                job.pushes.append(GroupPushes(tuple(m.pushers), 0.0))
            elif record.topic.endswith("/group_status"):
                _take_group_status(job, m)
            elif record.topic.endswith("/swarm_status"):
                _take_swarm_status(job.swarm, m)
            else:
                job.plan = [np.column_stack([s.trajectory.x, s.trajectory.y]) for s in m.segments]
    contents.time, contents.poses = frames.finish()
    for robot, rows in status.items():
        table = np.array(rows, dtype=np.float64)
        contents.status[robot] = dict(zip(STATUS, table.T, strict=True))
    return contents


def _take_swarm_status(swarm: SwarmTicks, message: Any) -> None:
    time = _seconds(message.header.stamp)
    swarm.rows.append(
        (
            time,
            float(message.position_error),
            float(message.orientation_error),
            float(message.solve_time),
            str(message.phase),
        )
    )
    if not swarm.moments or time - _seconds(swarm.moments[-1].header.stamp) >= _MOMENTS:
        swarm.moments.append(message)


def _take_group_status(job: Job, message: Any) -> None:
    if not job.pushes or not len(message.force_x):
        return
    push = job.pushes[-1]
    if push.pushers != tuple(message.pushers):
        return
    push.friction = float(message.friction)
    push.rows.append(
        [_seconds(message.header.stamp), *(getattr(message, k) for k in GROUP_STATUS[1:])]
    )
    for kept, x, y in (
        (push.points, message.contact_x, message.contact_y),
        (push.normals, message.normal_x, message.normal_y),
        (push.forces, message.force_x, message.force_y),
    ):
        kept.append(np.column_stack([x, y]))


def _take_state(job: Job, message: Any) -> None:
    job.system, job.object = str(message.system), str(message.object)
    job.robots = tuple(str(r) for r in message.robots)
    stamp = _seconds(message.header.stamp)
    job.states.append(
        State(stamp, str(message.state_name), str(message.reason), int(message.error_code))
    )
    if message.goal.header.frame_id:
        try:
            job.goal = planar_pose(message.goal.pose, "the goal")
        except InvalidMessage:  # a recorded message need not be valid
            pass
