"""One robot with a flat bumper as a method: the adapter between its cores and their host.

Planner (``push_planner``), state machine (``push_supervisor``) and tracker (``push_mpc``) are those
of the nodes of the system ``single``. The packages do not know each other, so they meet here.
"""

import math
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from push_bringup.one_robot_drive import Drive
from push_bringup.one_robot_plans import Plans, job_error
from push_job.method import Arena, Certificate, MethodSpec, Refusal, Seen, Task, Told, Unsuited
from push_job.report import Report, Status, polyline
from push_model import se2
from push_model.arrays import Array
from push_model.belief import Belief
from push_model.distance_field import DistanceField
from push_model.jobs import GoalRefused, JobError, JobPhase
from push_model.push_segment import PushSegment
from push_model.settings import SettingsError
from push_model.specs import ObjectSpec, RobotSpec
from push_model.stick_certificate import ContactBelief
from push_mpc import LtvMpc, MpcSettings, TrackerSettings, TrajectoryTracker
from push_mpc.tick_report import tick_report
from push_planner import SLICE, PlannerSettings, PlanningFailed
from push_planner.refusal import check_room
from push_supervisor import (
    Displacement,
    EventQueue,
    Machine,
    SupervisorSettings,
    Surroundings,
    commands,
    events,
    repair,
)
from push_supervisor.arrival import Arrival, arrival
from push_supervisor.blocked_way import BlockedWay
from push_supervisor.commands import Command, Motion, Question
from push_supervisor.displacement import PERIOD

SECTIONS: dict[str, type[Any]] = {
    "": SupervisorSettings,
    "planner": PlannerSettings,
    "mpc": MpcSettings,
    "tracker": TrackerSettings,
}
_POINTS = 10  # of a trajectory, of which a report shows one
_LONGEST = 0.05  # [s] between two frames; of a longer time, planning uses only so much


class OneRobotMethod:
    """Chapter 2 but section 2.3: pushes along stable curves, and what happens between them."""

    def __init__(self, arena: Arena) -> None:
        (self._name,), self._arena, self._item = arena.robots, arena, arena.object
        self._settings: SupervisorSettings = arena.section("", SupervisorSettings)
        if not self._settings.auto_execute:
            raise Unsuited("a method executes its plans at once; auto_execute must be true")
        specs = arena.robot, arena.item
        self._near = self._around(*specs)
        settings, field = arena.section("planner", PlannerSettings), DistanceField(arena.grid)
        self._plans = Plans(settings, field, *specs)
        mpc = LtvMpc(arena.section("mpc", MpcSettings), arena.robot.differential)
        tracker = TrajectoryTracker(arena.section("tracker", TrackerSettings), mpc)
        self._drive = Drive(tracker, self._name, self._item)
        self.machine = Machine(
            self._settings, self._at_goal, self._touching, beginning=self._beginning
        )
        self._fire = EventQueue(self.machine, self._carry_out).fire
        self._displacement = Displacement(self.machine)
        self._blocked_way = BlockedWay(self.machine)
        self._belief: Belief | None = None
        self._goal: Array | None = None  # of a task that no frame has come for yet
        self._seen: Seen | None = None
        self._question: Question | None = None  # a command that waits, or is worked on
        self._repair: commands.Repair | None = None  # likewise, while the robot pushes
        self._not_before, self._looked = 0.0, math.nan
        self._slices, self._stepped = 1, math.nan  # of planning in this frame; [s] of the last one

    def _around(self, robot: RobotSpec, item: ObjectSpec) -> Surroundings:
        near = Surroundings(robot, item, {}, self._settings)  # other bodies come with each frame
        near.take_map(self._arena.grid)
        return near

    def _surroundings(self, robot: RobotSpec, item: ObjectSpec) -> Surroundings:
        """Of a robot and an object; those at work where they are as is believed."""
        near = self._near
        return near if (robot, item) == (near.robot, near.item) else self._around(robot, item)

    @property
    def status(self) -> Status:
        """See Method."""
        if self._goal is not None:
            return Status(int(JobPhase.PLANNING), JobPhase.PLANNING.name, "a goal was given")
        m, count = self.machine, len(self.machine.segments)
        progress = min(m.index, count) / count if count else float(not m.busy)
        told = m.state.name, m.reason, int(m.error), progress, m.index, count, m.replans, m.pushes
        return Status(int(m.state), *told)

    def assess(self, task: Task, belief: Belief, seen: Seen | None) -> Certificate | Refusal:
        """See Method: what the supervisor refuses, and a goal into which nothing can be pushed.
        Whether there is a plan is only known by planning."""
        goal = task.goal
        if len(task.targets) > 1 or task.times:
            return Refusal(JobError.INVALID_GOAL, "the method 'one-robot' accepts a single goal")
        if not np.isfinite(goal).all():
            return Refusal(JobError.INVALID_GOAL, "the goal needs a heading")
        specs = belief.robot(self._name), belief.object(self._item)
        try:
            self._surroundings(*specs).check_goal(goal)
            if seen is None or not self._there(goal, seen):
                planner = self._plans.planner(*specs, ContactBelief.of(belief, self._item))
                check_room(planner.scene, goal, "pushed into the goal")
        except GoalRefused as refusal:
            return Refusal(refusal.code, str(refusal))
        except PlanningFailed as failure:
            return Refusal(job_error(failure), str(failure))
        return Certificate()

    def begin(self, task: Task, belief: Belief) -> None:
        """See Method: the job begins with the next frame, which shows where the object is."""
        self._goal, self._looked, self._drive.held = task.goal, math.nan, 0.0
        self._stepped = math.nan  # frames of before tell nothing of the next ones

    def step(self, seen: Seen, belief: Belief) -> Told:
        """See Method: a tick of the tracker, then what the state machine wants next. A plan is made
        in slices: one a frame while the robot pushes, else one for each 5 ms between frames."""
        elapsed, self._stepped = seen.time - self._stepped, seen.time
        self._slices = max(1, round(min(elapsed, _LONGEST) / SLICE)) if elapsed > 0.0 else 1
        self._seen = seen
        self._take_up(belief)
        if self._goal is not None:
            goal, self._goal = self._goal, None
            self._fire(events.GoalGiven(goal))
        elif self.machine.left:
            self._fire(events.PushLeft())
        if not seen.time - self._looked < PERIOD - 1e-9:
            self._looked = seen.time
            self._tell(self._displacement.look(seen.object))
            robot = seen.robots.get(self._name)
            if self.machine.repairing:
                self._tell(repair.late(self.machine.segment, seen.object))
            self._tell(self._blocked_way.look(self._near, robot, seen.object, seen.obstacles))
        if isinstance(self._question, commands.FollowPush) and self._question.going_on:
            self._start(self._question, seen, belief)  # before the push under way can end
        command, event = self._drive.follow(seen, self._near.robot.body_radius)
        self._tell(event)
        if self._name in seen.robots:
            return Told({self._name: command}, self._answer(seen, belief))
        if self._drive.held > self._drive.tracker.settings.give_up:
            self.end(JobError.POSES_STALE, f"no poses of '{self._name}' arrive")
        return Told()

    def _take_up(self, belief: Belief) -> None:
        """Go on with what is believed now: a plan is begun anew, a push gets other limits."""
        if belief == self._belief:
            return
        self._belief = belief
        specs = belief.robot(self._name), belief.object(self._item)
        self._near = self._surroundings(*specs)
        self._plans.believe(*specs, ContactBelief.of(belief, self._item))
        self._tell(self._drive.believe(belief))

    def _tell(self, event: events.Event | None) -> None:
        if event is not None:
            self._fire(event)

    def _beginning(self, push: PushSegment, goal: Array | None) -> PushSegment | None:
        seen = self._seen
        if seen is None or self._name not in seen.robots:
            return None
        return repair.beginning(self._near, push, seen.object, seen.obstacles, goal)

    def _carry_out(self, command: Command) -> None:
        self._repair = None
        self._plans.drop()
        match command:
            case commands.Repair():
                self._repair = command
            case commands.CancelRepair() | commands.Finish(going_on=True):
                pass
            case commands.Stop() | commands.CancelPlan() | commands.Finish():
                self._question = None
                self._drive.tracker.stop()
            case _:
                self._ask(command)

    def _ask(self, command: Question) -> None:
        assert self._seen is not None
        waits = isinstance(command, commands.MakePlan | commands.FindPath) and command.later
        self._not_before = self._seen.time + (self._settings.wait if waits else 0.0)
        self._question = command

    def _answer(self, seen: Seen, belief: Belief) -> float:
        """See to the question under way; [s] of CPU time that planning took."""
        question, began = self._question or self._repair, time.thread_time()
        if question is None or (question is self._question and seen.time < self._not_before):
            return 0.0
        match question:
            case commands.Repair():
                event = self._plans.repair(question, self._near, seen)
            case commands.MakePlan():
                robot = seen.robots[self._name]
                event = self._plans.plan(question, robot, seen, slices=self._slices)
            case commands.FindPath():
                event = self._plans.way(question, seen.robots[self._name], seen, self._near)
            case _:
                self._start(question, seen, belief)
                return 0.0
        spent = time.thread_time() - began
        self._tell(event)
        return spent

    def _start(self, motion: Motion, seen: Seen, belief: Belief) -> None:
        """Begin a motion, if the robot is seen; otherwise it waits."""
        if self._name in seen.robots:
            self._question = None
            self._tell(self._drive.start(motion, self._near, seen, belief))

    def report(self, seen: Seen) -> Report | None:
        """See Method: the tracker's figures, and the pushes that are left."""
        ways = [s.trajectory.pose[::_POINTS, :2] for s in self.machine.remaining]
        shapes = tuple(polyline("plan", way) for way in ways)
        tick, phase = self._drive.tick, self.machine.state.name.lower()
        told = Report(phase) if tick is None else tick_report(tick, self._drive.pushing)
        return replace(told, phase=phase, shapes=shapes)

    def end(self, code: JobError, reason: str) -> None:
        """See Method."""
        if self._goal is not None:
            self._goal, self.machine.error, self.machine.reason = None, code, reason
        self._fire(events.JobAborted(code, reason))

    def revive(self) -> None:
        """See Method: nothing; a robot is never given up."""

    def release(self) -> frozenset[str]:
        """See Method: the robot, when no task is under way."""
        idle = self.status.phase == JobPhase.IDLE
        return frozenset(self._arena.robots) if idle else frozenset()

    def errors(self, seen: Seen) -> tuple[float, float]:
        """See Method."""
        goal = self.machine.goal if self._goal is None else self._goal
        if goal is None:
            return math.inf, math.inf
        off = se2.between(goal, seen.object)
        return float(np.hypot(off[0], off[1])), abs(float(off[2]))

    def facts(self) -> Mapping[str, Any]:
        """See Method."""
        m, t = self.machine, self._drive.tracker
        return {"pushes": m.pushes, "replans": m.replans, "solves": t.solves, "failed": t.failures}

    def _there(self, goal: Array, seen: Seen) -> bool:
        off = se2.between(goal, seen.object)
        away, turned = float(np.hypot(off[0], off[1])), abs(float(off[2]))
        return arrival(self._settings, away, turned).there

    def _at_goal(self, goal: Array | None) -> Arrival:
        assert goal is not None and self._seen is not None
        return arrival(self._settings, *self.errors(self._seen))

    def _touching(self) -> bool:
        seen = self._seen
        robot = None if seen is None else seen.robots.get(self._name)
        return seen is not None and robot is not None and self._near.touching(robot, seen.object)


def check_team(robots: Mapping[str, RobotSpec], item: ObjectSpec) -> None:
    """Raise SettingsError unless there is one robot, with two wheels and a flat bumper."""
    if len(robots) != 1:
        raise SettingsError(f"has {len(robots)} robots; the method 'one-robot' takes one")
    for robot in robots.values():
        _ = robot.differential, robot.flat_bumper


ONE_ROBOT = MethodSpec("one-robot", OneRobotMethod, SECTIONS, check_team, "env1-target1")
