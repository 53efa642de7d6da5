"""One run of a team by any method: the whole graph in lockstep, as users run it.

Motion capture with its noise, rate and latency, disturbances, the node of the method and the door
at which tasks are refused are those of live use. Nothing here moves a robot.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields

import numpy as np
from rclpy.node import Node

from push_bringup.systems import nodes_of
from push_job.method import Task
from push_model import se2
from push_model.arrays import Array
from push_model.jobs import GoalRefused, JobError
from push_model.settings import SettingsError
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from push_msgs.msg import Belief, Report
from push_ros.claims import own_domain
from push_ros.conversions import time_from_ros
from push_ros.method_node import MethodNode
from push_ros.names import Names
from push_ros.qos import BELIEF, STATUS
from push_scenario.scenario import Scenario
from push_study.graph_run import LockstepRun
from push_study.pool import Row
from push_study.uncertainty import Uncertainty
from sim_bridge.world import BodyContacts, BodyPoses

OBJECT = "object"
"""The name of the object in a made scenario."""
TRACE = 0.2
"""[s] between poses that are kept."""


def made_scenario(
    name: str,
    environment: EnvironmentSpec,
    robot: RobotSpec,
    starts: Array,
    item: ObjectSpec,
    start: Array,
    parameters: Mapping[str, Mapping[str, object]] | None = None,
) -> Scenario:
    """A scenario with robots ``e0, e1, …`` of one type at poses ``(n, 3)``, and an object at a pose
    ``(3,)`` of its geometric frame.

    Raises
    ------
    SettingsError: bodies that stand in walls or in each other.
    """
    scenario = Scenario(
        name,
        environment,
        {f"e{i}": (robot, np.array(pose)) for i, pose in enumerate(starts)},
        {OBJECT: (item, np.array(start))},
        {k: dict(v) for k, v in (parameters or {}).items()},
    )
    scenario.check(name)
    return scenario


@dataclass
class TeamTrace:
    """What was seen from ground truth.

    ways ``(t, 1 + n, 3)``: poses of object and robots, every ``TRACE`` seconds; phases: [s] of each
    phase that the method reported; figures: values of its figures by name, at every report; forces
    ``(n, 2)`` [N] of the robots on the object, mean of each tick that ends at force_times [s];
    collision_ticks: ticks in which robots touched each other, or anything a wall; obstacle_ticks:
    the latter alone. outlines: of the object as estimators published them, ``(k, 2)`` [m], each
    with the time [s] of its poses.
    """

    times: list[float] = field(default_factory=list)
    ways: list[Array] = field(default_factory=list)
    phases: dict[str, float] = field(default_factory=dict)
    figures: dict[str, list[float]] = field(default_factory=dict)
    force_times: list[float] = field(default_factory=list)
    forces: list[Array] = field(default_factory=list)
    collision_ticks: int = 0
    obstacle_ticks: int = 0
    outlines: list[tuple[float, Array]] = field(default_factory=list)
    now: Array = field(default_factory=lambda: np.zeros((0, 3)))


@dataclass(frozen=True)
class Outcome:
    """What became of a task.

    reached: targets; code, reason: of the end; seconds: of simulation, which waits for the answer
    to each frame; planning: [s] CPU time of plans; delay: [s] that planning makes the task longer:
    what exceeds the time between two frames, and all CPU time of a planner with a node of its own;
    error: [m], [rad] of the object from the goal at the end, from ground truth. drawn: what of the
    world was not as believed.
    """

    reached: int
    code: JobError
    reason: str
    seconds: float
    planning: float
    delay: float
    error: tuple[float, float]
    trace: TeamTrace
    drawn: Row
    pushes: int = 0
    replans: int = 0
    times: tuple[float, ...] = ()
    """[s] that each target took that was reached, without planning."""

    @property
    def success(self) -> bool:
        """Whether the method said that it is done."""
        return self.code is JobError.NONE

    @property
    def charged(self) -> float:
        """[s] of simulation and of what planning adds to it: what a user waits."""
        return self.seconds + self.delay

    def row(self) -> Row:
        """The measures that every study of a team has."""
        return {
            "reason": "" if self.success else self.reason,
            "position_error_m": self.error[0],
            "orientation_error_rad": self.error[1],
            "duration_s": self.seconds,
            "planning_cpu_s": self.planning,
            "charged_s": self.charged,
            "pushes": self.pushes,
            "replans": self.replans,
            "collision_ticks": self.trace.collision_ticks,
            "obstacle_ticks": self.trace.obstacle_ticks,
            **self.drawn,
        }


class TeamObserver(Node):
    """Watches a team from ground truth, of which the bridge of the same process tells it, and from
    the reports of its method. For evaluation only."""

    def __init__(
        self,
        names: Names,
        robots: Sequence[str],
        meanwhile: Callable[[float, Array], None] | None = None,
    ) -> None:
        """meanwhile: called with the time [s] and poses ``(1 + n, 3)`` of object and robots."""
        super().__init__("team_observer")
        self._names = (OBJECT, *robots)
        self._movable = frozenset(self._names)
        self._rows = {robot: row for row, robot in enumerate(robots)}
        self._shown: tuple[str, ...] = ()
        self._places = np.zeros(0, dtype=np.intp)  # in what is shown, of each name; -1 for none
        self._meanwhile, self._last, self._reported = meanwhile, -math.inf, math.nan
        self._phase = ""
        self.trace = TeamTrace()
        self.recording = False
        self.create_subscription(Report, names.team("report"), self._on_report, STATUS)
        self.create_subscription(Belief, names.world("belief"), self._on_belief, BELIEF)

    def see(self, time: float, poses: BodyPoses, contacts: BodyContacts) -> None:
        """What is so at a time [s], and the contacts of the tick that ends then."""
        if poses.names != self._shown:
            self._shown = poses.names
            place = {name: row for row, name in enumerate(poses.names)}
            self._places = np.array([place.get(n, -1) for n in self._names], dtype=np.intp)
        if self.recording:
            self._touch(time, contacts)
        if self._places[0] < 0:
            return
        table = poses.table[self._places]
        table[self._places < 0] = np.nan
        self.trace.now = table
        if not self.recording:
            return
        if time - self._last >= TRACE - 1e-9:
            self._last = time
            self.trace.times.append(time)
            self.trace.ways.append(table)
        if self._meanwhile is not None:
            self._meanwhile(time, table)

    def _touch(self, time: float, contacts: BodyContacts) -> None:
        forces, hit, wall = np.zeros((len(self._rows), 2)), False, False
        for a, b, force in zip(contacts.body_a, contacts.body_b, contacts.force, strict=True):
            other, sign = (b, 1.0) if a == OBJECT else (a, -1.0)  # the force is on body a
            row = self._rows.get(other) if OBJECT in (a, b) else None
            if row is not None:
                forces[row] += sign * force[:2]
            else:
                hit = True
                wall |= not self._movable.issuperset((a, b))
        self.trace.force_times.append(time)
        self.trace.forces.append(forces)
        self.trace.collision_ticks += hit
        self.trace.obstacle_ticks += wall

    def _on_belief(self, message: Belief) -> None:
        for outline in message.outlines:
            table = np.column_stack([outline.x, outline.y])
            self.trace.outlines.append((time_from_ros(message.header.stamp), table))

    def _on_report(self, message: Report) -> None:
        time = time_from_ros(message.header.stamp)
        if self._phase and 0.0 < time - self._reported < 1.0:
            spent = self.trace.phases.get(self._phase, 0.0) + time - self._reported
            self.trace.phases[self._phase] = spent
        self._phase, self._reported = str(message.phase), time
        for name, value in zip(message.figures, message.values, strict=True):
            self.trace.figures.setdefault(str(name), []).append(float(value))


def run_team(
    system: str,
    believed: Scenario,
    task: Task,
    doubt: Uncertainty,
    seed: int,
    limit: float,
    meanwhile: Callable[[LockstepRun, float, Array], None] | None = None,
    world: str = "",
    mistake: Callable[[Scenario], Scenario] | None = None,
) -> Outcome:
    """Give a team a task and wait for its end, in a ROS domain of its own.

    Parameters
    ----------
    system: whose nodes run, see ``push_bringup.systems``. believed: the scenario of the method; the
        world is drawn from it. limit: [s] of simulation.
    meanwhile: called at every tick with the run, the time [s] and poses of object and robots,
        before a frame of this tick is published.
    world: kind of world, that of the scenario where it is empty.
    mistake: makes of the scenario what the method believes instead; the world stays as drawn.
    """
    if world:
        believed = believed.settings("bridge", world=world)
    believed, actual, drawn = doubt.draw(believed, seed)
    believed = _told_latency(believed, system)
    if mistake is not None:
        believed = mistake(believed)
    with own_domain():
        return _run(system, believed, actual, task, limit, meanwhile, drawn)


def _told_latency(believed: Scenario, system: str) -> Scenario:
    """The latency that controllers are told, also for nodes of methods that make one good."""
    delay = believed.parameters["controller"]["tracker"]["pose_delay"]
    for node in nodes_of(system, believed):
        for section, cls in node.traits.sections.items():
            if section and any(f.name == "pose_delay" for f in fields(cls)):
                believed = believed.settings(node.kind, **{f"{section}__pose_delay": delay})
    return believed


def _run(
    system: str,
    believed: Scenario,
    actual: Scenario,
    task: Task,
    limit: float,
    meanwhile: Callable[[LockstepRun, float, Array], None] | None,
    drawn: Row,
) -> Outcome:
    watchers: list[TeamObserver] = []

    def observer() -> list[Node]:
        made = TeamObserver(
            Names("/", "/"),
            list(believed.robots),
            None if meanwhile is None else lambda t, p: meanwhile(run, t, p),
        )
        watchers.append(made)
        return [made]

    with LockstepRun(
        believed, observer, world=actual, quiet=True, system=system, observe_bodies=False
    ) as run:
        node, watcher = run.supervisor, watchers[0]
        run.bridge.witness = watcher.see
        run.start()
        if not isinstance(node, MethodNode):
            raise SettingsError(f"the system '{system}' is not a method; give the name of a method")
        run.spin_until(lambda: len(watcher.trace.now) > 0 and node.seen is not None, 5.0)
        begin = run.bridge.time
        watcher.recording = True
        try:
            node.check_task(task)
        except GoalRefused as refusal:
            error = _errors(watcher.trace.now[0], task.goal)
            return Outcome(
                0, refusal.code, f"refused: {refusal}", 0.0, 0.0, 0.0, error, watcher.trace, drawn
            )
        node.take_task(task)
        ended = run.spin_until(lambda: not node.busy, limit)
        seconds = run.bridge.time - begin
        apart = 0.0 if run.planner is node else float(getattr(run.planner, "planning_time", 0.0))
        status = node.status
        code = JobError(status.code) if ended else JobError.EXECUTION_FAILED
        reason = status.reason if ended else f"no end within {limit:.0f} s: {status.reason}"
        count = len(task.targets)
        reached = count if code is JobError.NONE else min(status.index, count)
        error = _errors(watcher.trace.now[0], task.goal)
        latency, spread = run.bridge.applied_latency
        drawn = drawn | {"applied_latency_s": latency, "applied_latency_std_s": spread}
        return Outcome(
            reached,
            code,
            reason,
            seconds,
            node.planning_time + apart,
            node.planning_delay + apart,
            error,
            watcher.trace,
            drawn,
            status.pushes,
            status.replans,
            tuple(status.times),
        )


def _errors(pose: Array, goal: Array) -> tuple[float, float]:
    turn = 0.0 if math.isnan(goal[2]) else abs(se2.wrap(float(pose[2] - goal[2])))
    return math.hypot(pose[0] - goal[0], pose[1] - goal[1]), turn
