"""The node that hosts a method: frames of the pose stream in, commands and reports out.

It knows no method: whatever implements ``push_job.method.Method`` runs here, one task at a time.
Every frame is answered with one message for all robots of the team.
"""

import math
import sys
import time
from collections.abc import Callable, Collection, Generator
from typing import Any

import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from std_msgs.msg import Header

from push_estimation.pose_gate import Stamp
from push_job.method import (
    Arena,
    Method,
    MethodSpec,
    Refusal,
    Seen,
    Task,
    Told,
    Unsuited,
)
from push_job.report import Status
from push_model.arrays import Array
from push_model.drives import HolonomicDrive
from push_model.jobs import GoalRefused, JobError, JobPhase
from push_model.occupancy import OccupancyGrid as Grid
from push_msgs.msg import Report as ReportMessage
from push_ros.belief_feed import BeliefFeed
from push_ros.commander import TeamCommander
from push_ros.diagnostics import Diagnostics
from push_ros.door import Door
from push_ros.early_task import EarlyTask
from push_ros.hosting import Hosting
from push_ros.job_intake import JobIntake
from push_ros.job_memory import JobMemory, KeptJob
from push_ros.map_feed import MapFeed
from push_ros.method_settings import chosen_method, declare_method, declare_roster
from push_ros.names import names_of
from push_ros.pose_feed import Frame, PoseFeed
from push_ros.process import run_node
from push_ros.qos import STATUS
from push_ros.report_conversions import report_to_ros
from push_ros.scheduling import Urgency
from push_ros.task_outputs import TaskOutputs
from push_ros.task_server import TaskServer
from push_scenario.scenario import Scenario, load_scenario

PATIENCE = 10.0  # [s] without poses of the object after which a task ends
_SILENCE = 0.3  # [s] without a frame after which goals are judged without
_REPORTS = 0.05  # [s] of pose time between reports
_WAITING = Status(int(JobPhase.IDLE), "IDLE", "waiting for a map")


class MethodNode(Node):
    """Robots of one type, one object, one method, one task at a time.

    robots, object: names. method: None where there is none for the map, or no map yet.
    """

    def __init__(
        self,
        spec: MethodSpec | str = "",
        scenario: Scenario | None = None,
        robots: tuple[str, ...] = (),
        item: str = "",
        namespace: str = "",
        world: str = "",
        hosting: Hosting["MethodNode"] | None = None,
        memory: JobMemory | None = None,
    ) -> None:
        """spec: the method, or its name; the parameter ``method`` where it is empty. robots, item:
        the team's. namespace: the team's; world: the bridge's, where it is another one.
        memory: of jobs, see ``JobIntake``."""
        chosen = spec if isinstance(spec, MethodSpec) else chosen_method(spec) if spec else None
        kind = chosen.name if chosen is not None else "method"
        super().__init__(kind.replace("-", "_"), namespace=namespace)
        given_name = kind if isinstance(spec, MethodSpec) else spec
        name = str(self.declare_parameter("method", given_name).value)
        if chosen is None:
            chosen = chosen_method(name)
        self.spec, hosting = chosen, hosting or Hosting()
        self.names = names = names_of(self, world)
        file = self.declare_parameter("scenario", chosen.example).value
        self.scenario = scenario = scenario or load_scenario(str(file))
        given = self.declare_parameter("robots", list(robots) or [""]).value
        team = tuple(r for r in given if r) or tuple(scenario.robots)
        given_item = str(self.declare_parameter("object", item).value)
        self.robot_specs = {n: scenario.robot(n)[1] for n in team}
        self.object, self.item = scenario.object(given_item)
        chosen.check(self.robot_specs, self.item)
        self.settings, gate = declare_method(self, chosen, name, scenario)
        self.method: Method | None = None
        self._why_not = "there is no map yet"
        self._early = EarlyTask()
        self._grid: Grid | None = None
        self._seen: Seen | None = None
        self._missing = 0.0  # [s] of pose time without the object
        self._stamp, self._reported = Header().stamp, -math.inf
        self.planning_time = 0.0
        """[s] CPU time that the method's planning has taken so far."""
        self.planning_delay = 0.0
        """[s] of it, summed over frames, that exceeded the time since the frame before. Frames are
        taken to come at equal times."""
        self._diagnostics = Diagnostics(self, names, self._state)
        self.beliefs = BeliefFeed(self, names, scenario, self._diagnostics)
        self.partners = hosting.attach(self)
        commander, kind_of = hosting.commander(self), self.robot_specs[team[0]]
        self._roster = declare_roster(
            self, scenario, name, team, self.object, chosen.open_team and commander is None
        )
        holonomic = isinstance(kind_of.drive, HolonomicDrive)
        self._commander = commander or TeamCommander(self, names, self._roster, holonomic)
        self._reports = self.create_publisher(ReportMessage, names.team("report"), STATUS)
        bodies = [*team, self.object, *self._roster.obstacles]
        self._poses = PoseFeed(
            *(self, names, gate, bodies, self._diagnostics, self._on_frame), meet=self._meet
        )
        self._door = Door(self._judge)
        self._intake = JobIntake(
            *(self, names, self._diagnostics, self, chosen.name, list(team), self.object),
            consider=lambda goal, answer: self.consider_task(self._task(goal), answer),
            refuse=self._door.drop,
            memory=memory,
            no_plan_only=f"the method '{chosen.name}' plans as it goes; leave plan_only unset",
        )
        self._servers = [
            TaskServer(self, names.team(a.name), a, self, self._diagnostics.refuse)
            for a in hosting.actions(self)
        ]
        log = self.get_logger().info
        self._outputs = TaskOutputs(self._intake, self._servers, self._errors, log)
        MapFeed(self, names, self._diagnostics, self._take_map)
        self._watchdog = self.create_timer(
            0.1, self._on_watchdog, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )
        self._waiting = self._poses.clock.now  # since when the object is not seen
        self._look_after_task()

    @property
    def robots(self) -> tuple[str, ...]:
        """Names of the team's robots, further ones too."""
        return self._roster.robots

    def _meet(self, names: Collection[str]) -> Collection[str]:
        self._roster.meet(names, self.object)
        return (*self._roster.robots, *self._roster.obstacles)

    @property
    def ready(self) -> bool:
        """Whether a task could be worked on."""
        return self._grid is not None and bool(getattr(self.partners, "ready", True))

    @property
    def seen(self) -> Seen | None:
        """What the last frame showed, of the object and the team."""
        return self._seen

    # The owner of the job, see JobOwner

    @property
    def status(self) -> Status:
        """How the task stands."""
        idle = self.method.status if self.method is not None else _WAITING
        return self._early.status or idle

    @property
    def busy(self) -> bool:
        """See JobOwner."""
        return self.status.phase != JobPhase.IDLE

    @property
    def plan_ready(self) -> bool:
        """See JobOwner; a method plans as it goes."""
        return False

    def execute(self) -> None:
        """See JobOwner; there is never a plan that waits."""

    def resume(self, job: KeptJob) -> None:
        """See JobOwner."""
        self._take(Task(tuple(np.array(t) for t in job.targets)))

    def stop(self) -> None:
        """The process ends in good order."""
        self._intake.forget()

    def check_goal(self, goal: Array) -> None:
        """See JobOwner."""
        self.check_task(self._task(goal))

    def take_goal(self, goal: Array, plan_only: bool) -> None:
        """See JobOwner; goals with plan_only are refused before."""
        self._take(self._task(goal))

    def _task(self, goal: Array) -> Task:
        own = self.settings.get("")
        turned = bool(getattr(own, "orientation", True))
        return Task((goal if turned else np.array([*goal[:2], math.nan]),))

    def end_job(self, code: JobError, message: str) -> None:
        """See JobOwner."""
        if self._early.task is not None:
            self._early.end(code, message)
        elif self.method is not None:
            self.method.end(code, message)
        self._look_after_task()

    # The host of tasks, see TaskHost

    def consider_task(self, task: Task, answer: Callable[[GoalRefused | None], None]) -> None:
        """See TaskHost."""
        self._door.ask(task, answer)

    def check_task(self, task: Task) -> None:
        """Raise GoalRefused unless a task can be worked on; at once."""
        for _ in self._judge(task):
            pass

    def _judge(self, task: Task) -> Generator[int, None, None]:
        method = self.method
        if self._grid is None:
            return  # it is found out when the map comes
        if method is None:
            raise GoalRefused(JobError.PLANNING_FAILED, self._why_not)
        for target in task.targets:
            if not self._grid.contains(float(target[0]), float(target[1])):
                raise GoalRefused(JobError.OUTSIDE_MAP, "the goal is outside the map")
        asked = task, self.beliefs.current, self._seen
        slices = getattr(method, "assess_in_slices", None)
        found = method.assess(*asked) if slices is None else (yield from slices(*asked))
        if isinstance(found, Refusal):
            raise GoalRefused(found.code, found.reason)

    def take_task(self, task: Task) -> None:
        """See TaskHost."""
        self._intake.begin()
        self._take(task)

    def _take(self, task: Task) -> None:
        """Begin the task of the job that the intake has begun."""
        self._waiting, self._missing = self._poses.clock.now, 0.0
        self._intake.keep(task)
        if self.method is not None:
            self._early.forget()
            self.method.begin(task, self.beliefs.current)
        else:
            self._early.wait(task, self._poses.clock.now)
        self._look_after_task()

    def _begin_early(self, refusal: GoalRefused | None) -> None:
        """A task that came before the map has been judged on the map."""
        if self._early.task is None:
            return  # it has ended meanwhile
        if refusal is not None:
            self._early.end(refusal.code, str(refusal))
        elif (task := self._early.forget()) is not None:
            self._take(task)
        self._look_after_task()

    # The world

    def _take_map(self, grid: Grid) -> None:
        if self._grid is not None:
            self._door.drop(JobError.PREEMPTED, "the map has changed")
            self.end_job(JobError.PREEMPTED, "the map has changed")
        if self.method is not None:
            self._early.keep(self.status)
        self._grid = grid
        arena = Arena(grid, self.robot_specs, self.object, self.item, self.settings, self.partners)
        try:
            self.method = self.spec.make(arena)
        except Unsuited as error:
            self.method, self._why_not = None, str(error)
        if self._early.task is not None:
            self._door.ask(self._early.task, self._begin_early)
        self._look_after_task()

    def _on_frame(self, frame: Frame) -> None:
        self._stamp = frame.stamp
        told = Told()
        if frame.verdict is Stamp.RESET:
            self._reported = -math.inf
            if self.method is not None:
                self.method.revive()
            self._door.drop(JobError.CLOCK_RESET, "the clock jumped back")
            self._intake.reset()
            self.end_job(JobError.CLOCK_RESET, "the clock jumped back")
        elif frame.verdict is not Stamp.REFUSED:
            told = self._step(frame)
        self._commander.send(self._stamp, told)
        self._door.go_on()
        if frame.verdict is not Stamp.REFUSED:
            ready = self.ready and self.method is not None and self._seen is not None
            self._intake.frame(self._poses.stamp, self._bodies, ready, self.status.index)
        self._look_after_task()

    def _bodies(self) -> dict[str, Array]:
        """Poses of the object and the robots that are seen."""
        named = ((n, self._poses.pose(n)) for n in (self.object, *self.robots))
        return {n: pose for n, pose in named if pose is not None}

    def _step(self, frame: Frame) -> Told:
        """What the method says; nothing where nobody has to move."""
        method, item = self.method, self._poses.pose(self.object)
        if item is None:
            self._missing += frame.elapsed
            if self._missing > PATIENCE:
                self.end_job(JobError.POSES_STALE, f"no poses of '{self.object}'")
            return Told()
        self._missing, self._waiting = 0.0, self._poses.clock.now
        robots = {n: p for n in self.robots if (p := self._poses.pose(n)) is not None}
        others = self._poses.discs(self._roster.obstacles)
        ages = self._poses.ages((self.object, *robots), frame)
        self._seen = seen = Seen(self._poses.stamp, item, robots, others, ages=ages)
        if method is None or self._early.task is not None or not self.busy:
            return Told()
        began = time.thread_time()
        told = method.step(seen, self.beliefs.current)
        cost = time.thread_time() - began
        self.planning_time += told.planning
        self.planning_delay += max(0.0, told.planning - frame.elapsed)
        if seen.time - self._reported >= _REPORTS - 1e-9:
            self._report(method, seen, cost)
        return told

    def _report(self, method: Method, seen: Seen, cost: float) -> None:
        report = method.report(seen)
        if report is None:
            return
        self._reported = seen.time
        message = report_to_ros(report, self._stamp, self.spec.name, self.object)
        message.solve_time = cost
        self._reports.publish(message)

    def _on_watchdog(self) -> None:
        """For when no frame comes; in lockstep, where the world waits, nothing happens."""
        now = self._poses.clock.now
        self._intake.wait(now)
        if self._poses.paused or self._poses.silence > _SILENCE:
            self._door.go_on()
        if not self.busy:
            self._waiting = now
        elif self._grid is None and self._early.waited(now) > PATIENCE:
            topic = self.names.world("map")
            self.end_job(JobError.PLANNING_FAILED, f"no map has been received on {topic}")
        elif now - self._waiting > PATIENCE and self._poses.silence > PATIENCE:
            self.end_job(JobError.POSES_STALE, "no poses arrive")

    # Outputs

    def _look_after_task(self) -> None:
        """Tell how the task stands, and that it has ended."""
        self._outputs.tell(self.status, self._poses.stamp, self.robots)

    def _errors(self) -> tuple[float, float]:
        if self.method is None or self._seen is None or self._early.task is not None:
            return math.inf, math.inf
        return self.method.errors(self._seen)

    def _state(self) -> dict[str, Any]:
        status = self.status
        seen = sum(self._poses.pose(n) is not None for n in self.robots)
        return {
            "method": self.spec.name,
            "state": status.name,
            "reason": status.reason,
            "error code": int(status.code),
            "robots": f"{seen} of {len(self.robots)} seen",
            **(self.method.facts() if self.method is not None else {}),
            "poses refused": self._poses.gate.refused,
            "commands not finite": getattr(self._commander, "not_finite", 0),
            "warning": "no poses" if self._poses.pose(self.object) is None else "",
        }


def main() -> int:
    """Entry point of the process: ``--ros-args -p method:=NAME`` on its command line."""
    return run_node(MethodNode, urgency=Urgency.CONTROL)


if __name__ == "__main__":
    sys.exit(main())
