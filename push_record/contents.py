"""The contents of a bag as time series: bodies, jobs of all teams, controllers, collisions."""

from collections.abc import Container
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from push_job.report import Report
from push_model.arrays import Array
from push_record.bag import read_bag, read_metadata
from push_record.collisions import Collisions
from push_record.planned import Plan, PlannedPush, from_group_plan, from_push_plan, merged
from push_ros.report_conversions import report_from_ros
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

_RESET = 0.5  # [s] by which the clock goes back when the world is reset
_SPACING = 0.02  # [s] shortest time between frames that are kept
_ROUNDING = 1e-6  # [s] of stamps, which are times of day in a lab
_MOMENTS = 2.0  # [s] between complete reports that are kept for pictures
_MOVING = (1, 2)  # modes MOVE and PUSH of ControllerStatus


@dataclass(frozen=True)
class State:
    """State of a job at a time [s]; code: of the last job that ended. goal ``(3,)``: of the job.
    job: its number. step: index of the push under way, and their number."""

    time: float
    name: str
    reason: str
    code: int
    goal: Array | None = None
    job: int = 0
    step: tuple[int, int] = (0, 0)
    progress: float = 0.0


@dataclass
class ReportSeries:
    """What one method or controller reported.

    times [s], phases and CPU times [s] of its reports. figures: by name, unit, times [s] and
    values. limits: by name of a figure, the last one told. moments: time [s] and whole report,
    ``spacing`` [s] apart or more.
    """

    method: str
    spacing: float = _MOMENTS
    times: list[float] = field(default_factory=list)
    solve_times: list[float] = field(default_factory=list)
    limits: dict[str, float] = field(default_factory=dict)
    phases: list[str] = field(default_factory=list)
    figures: dict[str, tuple[str, list[float], list[float]]] = field(default_factory=dict)
    moments: list[tuple[float, Report]] = field(default_factory=list)

    def take(self, time: float, report: Report) -> None:
        """Add a report of a time [s]."""
        self.times.append(time)
        self.phases.append(report.phase)
        self.solve_times.append(report.solve_time)
        for figure in report.figures:
            self.limits[figure.name] = figure.limit
            _, times, values = self.figures.setdefault(figure.name, (figure.unit, [], []))
            times.append(time)
            values.append(figure.value)
        if not self.moments or time - self.moments[-1][0] >= self.spacing:
            self.moments.append((time, report))


@dataclass
class Job:
    """What a team did. goal ``(3,)``: the last one; goals: each with the time [s] from which it
    held; plans: in the order of time; planned_in: number of the job that the last plan is of;
    plan_times: [s] wall time of each plan that tells it; reports: by topic, of method and
    controllers."""

    space: str
    system: str = ""
    robots: tuple[str, ...] = ()
    object: str = ""
    states: list[State] = field(default_factory=list)
    goal: Array | None = None
    goals: list[tuple[float, Array]] = field(default_factory=list)
    plans: list[Plan] = field(default_factory=list)
    planned_in: int = -1
    plan_times: list[float] = field(default_factory=list)
    reports: dict[str, ReportSeries] = field(default_factory=dict)

    @property
    def unfinished(self) -> str:
        """The state in which the recording ends in mid-job; empty if no job was under way."""
        last = self.states[-1].name if self.states else "IDLE"
        return "" if last == "IDLE" else last

    @property
    def pushes(self) -> tuple[PlannedPush, ...]:
        """Of the last plan."""
        plan = merged(self.plans)
        return () if plan is None else plan.pushes


@dataclass
class BagContents:
    """time ``(n,)`` [s]; poses ``(n, 3)`` by body, nan where unknown. measured: whether these come
    from motion capture, because the bag has no ground truth.

    If the world was reset during the recording, times go on where they were.

    status: by robot, by column of STATUS ``(k,)``; jobs: by the team's namespace.
    """

    scenario: Scenario
    metadata: dict[str, str]
    collisions: Collisions
    time: Array = field(default_factory=lambda: np.zeros(0))
    poses: dict[str, Array] = field(default_factory=dict)
    status: dict[str, dict[str, Array]] = field(default_factory=dict)
    jobs: dict[str, Job] = field(default_factory=dict)
    measured: bool = False


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
        self._newest: float | None = None
        self.shift = 0.0  # [s] that times go on after the world was reset

    def take(self, message: Any) -> None:
        frame = np.full((len(self._index), 3), np.nan)
        known = [(self._index[n], i) for i, n in enumerate(message.names) if n in self._index]
        if known:
            rows, columns = np.array(known).T
            frame[rows] = np.column_stack([message.x, message.y, message.theta])[columns]
        time = _seconds(message.header.stamp) + self.shift
        if self._newest is not None and time < self._newest - _RESET:
            self._keep()
            self.shift += self._newest - time
            time = self._newest
        self._last = (time, frame)
        self._newest = time
        if not self.times or not 0.0 <= time - self.times[-1] < _SPACING - _ROUNDING:
            self._keep()

    @property
    def now(self) -> float:
        """[s] of the newest frame."""
        return 0.0 if self._newest is None else self._newest

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


def load(bag: Path | str, moments: float = _MOMENTS) -> BagContents:
    """Read the data of a report, or of a playback. Without ground truth, as in a lab, the poses are
    those that were measured.

    moments: [s] between whole reports that are kept, with their shapes.

    Raises
    ------
    ValueError: the bag holds no scenario. FileNotFoundError: it is none.
    """
    contents = _read(Path(bag), moments, "ground_truth/poses")
    if len(contents.time):
        return contents
    found = _read(Path(bag), moments, "poses")
    return replace(found, measured=len(found.time) > 0)


def _read(bag: Path, moments: float, poses: str) -> BagContents:
    """poses: end of the topic that the poses are taken from."""
    scenario, metadata = bag_scenario(bag)
    collisions = Collisions(frozenset(scenario.robots), frozenset(scenario.objects))
    contents = BagContents(scenario, metadata, collisions)
    frames = _Frames((*scenario.robots, *scenario.objects))
    status: dict[str, list[list[float]]] = {}
    series: dict[str, ReportSeries] = {}
    wanted = _Suffixes(
        poses,
        "job_state",
        "push_plan",
        "group_plan",
        "report",
        "contacts",
        "controller/status",
    )
    for record in read_bag(bag, cast(set[str], wanted)):
        m, shift = record.message, frames.shift
        if record.topic.endswith(f"/{poses}"):
            frames.take(m)
        elif record.topic.endswith("/controller/status"):
            if m.mode in _MOVING:
                row = [_seconds(m.header.stamp) + shift, *(getattr(m, k) for k in STATUS[1:])]
                status.setdefault(str(m.robot), []).append(row)
        elif record.topic.endswith("/report"):
            try:
                report = report_from_ros(m)
            except InvalidMessage:  # what somebody recorded need not be right
                continue
            told = series.setdefault(record.topic, ReportSeries(str(m.method), moments))
            told.take(_seconds(m.header.stamp) + shift, report)
        elif record.topic.endswith("/contacts"):
            collisions.take(_seconds(m.header.stamp) + shift, m.body_a, m.body_b)
        else:
            space = record.topic.rpartition("/")[0] + "/"
            job = contents.jobs.setdefault(space, Job(space))
            if record.topic.endswith("/job_state"):
                _take_state(job, m, shift)
            elif record.topic.endswith("/group_plan"):
                job.plans.append(from_group_plan(m, frames.now, _pieces(job)))
            else:
                job.plan_times.append(float(m.statistics.plan_time))
                job.plans.append(from_push_plan(m, frames.now))
    for topic, told in series.items():
        _give(contents.jobs, topic, told)
    contents.time, contents.poses = frames.finish()
    for robot, rows in status.items():
        table = np.array(rows, dtype=np.float64)
        contents.status[robot] = dict(zip(STATUS, table.T, strict=True))
    return contents


def until(contents: BagContents, end: float) -> BagContents:
    """What was recorded before a time [s]: frames and states of jobs."""
    kept = contents.time < end
    jobs = {
        space: replace(job, states=[s for s in job.states if s.time < end])
        for space, job in contents.jobs.items()
    }
    poses = {name: rows[kept] for name, rows in contents.poses.items()}
    return replace(contents, time=contents.time[kept], poses=poses, jobs=jobs)


def _give(jobs: dict[str, Job], topic: str, series: ReportSeries) -> None:
    """To the job of the team, or of the robot, that a topic of reports belongs to."""
    space = topic.rpartition("/")[0] + "/"
    robot = space.rstrip("/").rpartition("/")[2]
    for job in jobs.values():
        if job.space == space or robot in job.robots:
            job.reports[topic] = series
            return


def _pieces(job: Job) -> int:
    """Pieces of the job under way that have been planned before."""
    number = job.states[-1].job if job.states else 0
    if job.planned_in != number:
        job.planned_in = number
        return 0
    return len(job.pushes)


def _take_state(job: Job, message: Any, shift: float) -> None:
    job.system, job.object = str(message.system), str(message.object)
    job.robots = tuple(str(r) for r in message.robots)
    stamp = _seconds(message.header.stamp) + shift
    if message.goal.header.frame_id:
        try:
            goal = planar_pose(message.goal.pose, "the goal")
            if job.goal is None or not np.array_equal(goal, job.goal):
                job.goals.append((stamp, goal))
            job.goal = goal
        except InvalidMessage:  # a recorded message need not be valid
            pass
    elif message.job:
        job.goal = None
    job.states.append(
        State(
            stamp,
            str(message.state_name),
            str(message.reason),
            int(message.error_code),
            job.goal,
            int(message.job),
            (int(message.step_index), int(message.step_count)),
            float(message.progress),
        )
    )
