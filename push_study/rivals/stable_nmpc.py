"""Stable pushing by one NMPC: Tang, Zhu, Potters, Wisse and Pan, RA-L 2023 (arXiv 2309.14295).

A robot on two wheels pushes with a line contact, on bends so wide that the object stays where it is
on the bumper. Together with the constraint of its wheels, that is one linear constraint between v
and omega. Robot and object are then one body, and a nonlinear programme steers it to the goal,
again and again, on one side of the object.

Only the abstract could be read. Filled in:

- The limits of omega / v are those of an ellipsoidal limit surface, with ``friction_trust`` of the
  believed friction, and with the object where it is seen on the bumper.
- The programme (``stable_programme.py``) covers the whole way in steps of equal, free duration. Its
  cost is the time, the squared error of the last pose, and changes of omega. IPOPT solves it every
  ``period``; between two solves the robot drives as planned.
- Obstacles: the object's outline, the robot's body and the corners of its bumper keep a margin from
  what the map has. Bodies that are not on the map are not avoided.
- The side is the first from which a solve reaches the goal. A solve begins with the shortest way of
  the object on the map, or with a cubic between start and goal.
- The robot drives to that side by this project's planner and tracker, and touches it straight on.
- Contact that is lost, and a goal that cannot be reached any more, end the task: the method makes
  no second push.
"""

import math
import time
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from push_estimation.dead_reckoning import DeadReckoning
from push_job.method import Arena, Certificate, MethodSpec, Refusal, Seen, Task, Told, Unsuited
from push_job.report import Figure, Report, Status, polyline
from push_model import se2
from push_model.arrays import Array
from push_model.belief import POSES, Belief
from push_model.distance_field import DistanceField
from push_model.jobs import GoalRefused, JobError, JobPhase
from push_model.settings import SettingsError
from push_model.specs import ObjectSpec, RobotSpec
from push_model.stable_push import shifted_limits
from push_model.trajectory import Trajectory, line
from push_mpc import LtvMpc, MpcSettings, TrackerSettings, TrajectoryTracker
from push_mpc import Task as Track
from push_planner import NoRobotPath, PlannerSettings, plan_robot_path
from push_planner.guide_path import lattice_path
from push_study.rivals.stable_grips import Grip, StableNmpcSettings, grips
from push_study.rivals.stable_programme import ACCELERATION, MARGIN, Plan, StableProgramme, cubic
from push_supervisor import SupervisorSettings, Surroundings

_STANDOFF, _TOUCH_SPEED, _TOUCH_BRAKING = 0.03, 0.06, 0.2  # [m], [m/s], [m/s^2]
_FILTER = 0.2  # [s] time constant of where the object is on the bumper
_GAP, _TURN, _LOST = 0.015, 0.25, 0.5  # [m], [rad] of a contact in doubt; [s] until it is lost
_PATIENCE = 10  # solves in a row that do not reach the goal, or fail
_STILL, _NEAR_TIME = 0.3, 0.06  # [s] from the last command to the verdict; of a plan that is over
_TICK, _BREAK = 0.01, 0.25  # [s] assumed between first frames; after which a robot has stopped
_OF_PUSHES = (
    *("tracked", "friction_trust", "stop_before_slip", "slip_warning", "grasp_filter"),
    *("contact_gap", "contact_aside", "contact_turn", "contact_time"),
)  # settings of the tracker
_CLEARANCES = (0.1, 0.07, 0.05)  # [m] of the object's way on the map, the first that leads there


class StableNmpcMethod:
    """Drives to a side, touches it, and pushes until the end of the plan."""

    def __init__(self, arena: Arena) -> None:
        (self._name,), self._arena = arena.robots, arena
        self._own: StableNmpcSettings = arena.section("", StableNmpcSettings)
        self._field = DistanceField(arena.grid)
        self._planning = PlannerSettings()
        mpc = LtvMpc(arena.section("mpc", MpcSettings), arena.robot.differential)
        tracker = arena.section("tracker", TrackerSettings)
        for name in _OF_PUSHES:
            if getattr(tracker, name) != getattr(TrackerSettings(), name):
                raise Unsuited(f"tracker.{name} has no effect: its pushes are not tracked")
        self._tracker = TrajectoryTracker(tracker, mpc)
        self._tracker.warm_up()
        self._nmpc = StableProgramme(arena.grid, arena.robot, arena.item)
        self._item = arena.item
        self._near = Surroundings(arena.robot, arena.item, {}, SupervisorSettings())
        self._near.take_map(arena.grid)
        self._goal: Array | None = None
        self._phase, self._reason, self._code = JobPhase.IDLE, "waiting for a goal", JobError.NONE
        self._plan: Plan | None = None
        self.solves: list[float] = []  # [s] CPU time of each since the push began

    @property
    def status(self) -> Status:
        """See Method."""
        return Status(int(self._phase), self._phase.name, self._reason, int(self._code))

    def assess(self, task: Task, belief: Belief, seen: Seen | None) -> Certificate | Refusal:
        """See Method; whether a push leads to the goal is only known by solving."""
        if len(task.targets) > 1 or task.times:
            text = "the method 'stable-nmpc' accepts a single goal, without times"
            return Refusal(JobError.INVALID_GOAL, text)
        if not np.isfinite(task.goal).all():
            return Refusal(JobError.INVALID_GOAL, "the goal needs a heading")
        try:
            self._near.believe(belief.robot(self._name), belief.object(self._arena.object))
            self._near.check_goal(task.goal)
        except GoalRefused as refusal:
            return Refusal(refusal.code, str(refusal))
        return Certificate()

    def begin(self, task: Task, belief: Belief) -> None:
        """See Method."""
        self._goal, self._code, self._reason = task.goal, JobError.NONE, "looking for a push"
        self._phase, self._time, self._doubt = JobPhase.PLANNING, math.nan, 0.0
        self._item, self._shown = belief.object(self._arena.object), math.nan
        self._in_force, self.solves = (0.0, 0.0), []
        known = (POSES, "latency") in belief.values
        delay = belief.latency.value if known else self._tracker.settings.pose_delay
        self._tracker.believe(None, delay)
        self._reckoning = DeadReckoning(delay)
        self._search: Iterator[tuple[Grip, Plan, Array]] | None = None

    def step(self, seen: Seen, belief: Belief) -> Told:
        """See Method."""
        robot = seen.robots.get(self._name)
        if self._goal is None or self._phase is JobPhase.IDLE:
            return Told()
        dt, age = seen.time - self._time, seen.ages.get(self._name, 0.0)
        if robot is not None or math.isnan(self._shown):
            self._shown = seen.time - age  # when the robot was measured last
        if stale := seen.time - self._shown > self._tracker.settings.give_up:
            self.end(JobError.POSES_STALE, f"no poses of '{self._name}' arrive")
        if stale or robot is None:
            return Told()
        if not 0.0 < dt <= _BREAK:
            dt, self._in_force = _TICK, (0.0, 0.0)
            self._reckoning.clear()
            self._tracker.halt()
        self._time, item = seen.time, self._item.mass_pose(seen.object)
        if self._phase is JobPhase.PLANNING:
            began = time.thread_time()
            self._look(robot, seen.object, belief)
            return Told({self._name: (0.0, 0.0)}, time.thread_time() - began)
        if self._phase is JobPhase.PUSHING:
            shown = seen.ages.get(self._arena.object, 0.0) <= 0.0
            command = self._push(dt, robot, item if shown else None, age)
        else:
            command = self._drive(dt, robot, item, age)
        return Told({self._name: command})

    def _look(self, robot: Array, seen: Array, belief: Belief) -> None:
        """One solve: the first side from which a plan reaches the goal, and the way to it."""
        assert self._goal is not None
        spec, item = belief.robot(self._name), self._item.mass_pose(seen)
        if self._search is None:
            if not np.array_equal(self._item.geometry.outline, self._nmpc.outline):
                self._nmpc = StableProgramme(self._arena.grid, spec, self._item)
            self._near.believe(spec, self._item)
            self._search, self._blocked = self._offers(item, belief, spec), ""
            if not self._off(item):
                self.end(JobError.NONE, "it is at the goal already")
                return
        offer = next(self._search, None)
        if offer is None:
            text = f"no side of the object from which a stable push reaches it{self._blocked}"
            self.end(JobError.PLANNING_FAILED, text)
            return
        grip, plan, last = offer
        if self._misses(plan, last):
            return
        contact = se2.compose(item, se2.inverse(grip.grasp))
        to = se2.compose(contact, np.array([-_STANDOFF, 0.0, 0.0]))
        around = self._near.on_the_way(seen, {})
        try:
            way = plan_robot_path(self._field, spec, self._planning, robot, to, around)
        except NoRobotPath as error:
            self._blocked = f"; to one that does, {error}"
            return
        self._grip, self._plan, self._phase = grip, plan, JobPhase.POSITIONING
        self._reason = f"on the way to side {grip.side.index}"
        self._track(way, self._near.follow(way, seen))

    def _offers(
        self, item: Array, belief: Belief, spec: RobotSpec
    ) -> Iterator[tuple[Grip, Plan, Array]]:
        """Plans, and where the robot is to end; those first whose beginning and end turn least."""
        assert self._goal is not None
        begins, goal = [], self._item.mass_pose(self._goal)
        ways = (lattice_path(self._field, item, goal, c) for c in _CLEARANCES)
        guide = next((w for w in ways if w is not None), None)
        for grip in grips(self._own, belief, spec, self._arena.object):
            robot, last = (se2.compose(p, se2.inverse(grip.grasp)) for p in (item, goal))
            for points in (guide, cubic(item, goal, grip.grasp[2])):
                if points is not None:
                    z, heading = self._nmpc.along(points, robot, grip.grasp)
                    off = abs(se2.wrap(last[2] - heading)) + abs(z[5] - robot[2])
                    begins.append((off, grip, robot, _beside(last, heading), z))
        for _, grip, robot, last, z in sorted(begins, key=lambda b: b[0]):
            plan = self._nmpc.solve(robot, last, grip.grasp, grip.limits, (0.0, 0.0), z)
            yield grip, plan, last

    def _misses(self, plan: Plan, goal: Array) -> str:
        """Why a plan does not reach the goal, in words; empty where it does."""
        off, s = plan.poses[-1] - goal, self._own
        away, turned = float(np.hypot(off[0], off[1])), abs(float(off[2]))
        if not plan.solved:
            return "the solver finds no push"
        if away > s.position_tolerance or turned > s.orientation_tolerance:
            return f"the best push ends {1e3 * away:.0f} mm, {turned:.2f} rad from the goal"
        return "" if plan.slack <= MARGIN else f"it lacks {1e3 * plan.slack:.0f} mm of room"

    def _track(self, way: Trajectory, circles: Array) -> None:
        s = self._tracker.settings
        self._tracker.start(
            Track(way, None, circles, s.position_tolerance, s.orientation_tolerance)
        )

    def _drive(self, dt: float, robot: Array, item: Array, age: float) -> tuple[float, float]:
        """To the side, and straight on until contact."""
        tick = self._tracker.tick(dt, robot, None, age=age)
        if tick.finished and tick.code:
            self.end(JobError.POSITIONING_FAILED, tick.message)
        elif tick.finished and self._phase is JobPhase.POSITIONING:
            contact = se2.compose(item, se2.inverse(self._grip.grasp))
            ahead = max(float(se2.between(robot, contact)[0]), 1e-3)
            begin = se2.compose(contact, np.array([-ahead, 0.0, 0.0]))
            way = line(begin, ahead, _TOUCH_SPEED, 0.3, braking=_TOUCH_BRAKING)
            self._track(way, np.zeros((0, 3)))
            self._phase, self._reason = JobPhase.APPROACH, "touching the object"
        elif tick.finished:
            self._tracker.stop()
            self._phase, self._reason = JobPhase.PUSHING, "pushing"
            self._measured, self._since = self._grip.grasp.copy(), self._own.period
            self._waited = self._own.period
            self._failed, self._over, self._doubt = 0, 0.0, 0.0
        self._in_force = (tick.v, tick.omega)
        self._reckoning.clear()
        return self._in_force

    def _push(self, dt: float, robot: Array, item: Array | None, age: float) -> tuple[float, float]:
        assert self._plan is not None
        self._reckoning.record(dt, *self._in_force)
        there = self._reckoning.at_frame(robot, age)
        item = se2.compose(there, self._measured) if item is None else item  # it is not shown
        seen = se2.between(there, item)
        off = seen - self._measured
        off[2] = se2.wrap(float(off[2]))
        self._measured += min(1.0, dt / _FILTER) * off
        now = self._reckoning.now(there)
        self._reckoning.forget(age)
        self._since, self._waited = self._since + dt, self._waited + dt
        lost = seen - self._grip.grasp
        half = 0.5 * self._arena.robot.flat_bumper.width
        far = lost[0] > _GAP or abs(lost[1]) > half or abs(se2.wrap(float(lost[2]))) > _TURN
        self._doubt = self._doubt + dt if far else 0.0
        if self._doubt > _LOST:
            text = f"{1e3 * lost[0]:.0f} mm ahead, {1e3 * abs(lost[1]):.0f} mm aside"
            self.end(JobError.EXECUTION_FAILED, f"contact was lost: the object is {text}")
            return 0.0, 0.0
        if self._over == 0.0 and self._waited >= self._own.period - 1e-9:
            self._solve(now)
            if self._plan is None:
                return 0.0, 0.0
        at = int(self._since / self._plan.step)
        if self._over > 0.0 or at >= len(self._plan.twists) or self._plan.duration < _NEAR_TIME:
            self._over += dt
            if self._over > _STILL:
                missed = self._off(item)
                self.end(JobError.OFF_TARGET if missed else JobError.NONE, missed or "at the goal")
            self._in_force = 0.0, 0.0
            return self._in_force
        v, omega = self._plan.twists[at]
        most = self._in_force[0] + ACCELERATION * dt
        slower = min(1.0, most / max(v, 1e-9))
        self._in_force = float(slower * v), float(slower * omega)
        return self._in_force

    def _solve(self, robot: Array) -> None:
        """The next plan, from where the object is on the bumper."""
        assert self._goal is not None and self._plan is not None
        began, self._waited = time.thread_time(), 0.0
        before = self._plan
        goal = se2.compose(self._item.mass_pose(self._goal), se2.inverse(self._measured))
        robot, goal = _beside(robot, before.poses[0, 2]), _beside(goal, before.poses[-1, 2])
        limits = shifted_limits(self._grip.limits, self._measured[1] - self._grip.grasp[1])
        begin = before.later(min(self._since, self._own.period))
        known = None if self._failed else before.multipliers
        plan = self._nmpc.solve(robot, goal, self._measured, limits, self._in_force, begin, known)
        self.solves.append(time.thread_time() - began)
        misses = self._misses(plan, goal)
        self._failed = self._failed + 1 if misses else 0
        if plan.solved:
            self._plan, self._since = plan, 0.0
        if self._failed >= _PATIENCE:
            self.end(JobError.EXECUTION_FAILED, f"no stable push reaches the goal: {misses}")

    def _off(self, item: Array) -> str:
        """How far the object is from its goal, in words; empty within the tolerances."""
        assert self._goal is not None
        off, s = se2.between(self._item.mass_pose(self._goal), item), self._own
        away, turned = float(np.hypot(off[0], off[1])), abs(float(off[2]))
        if away <= s.position_tolerance and turned <= s.orientation_tolerance:
            return ""
        return f"it ended {1e3 * away:.0f} mm, {turned:.2f} rad from the goal"

    def report(self, seen: Seen) -> Report | None:
        """See Method."""
        if self._goal is None or self._phase is JobPhase.IDLE:
            return None
        away, turned = self.errors(seen)
        figures = [Figure("to the goal", away, "m"), Figure("heading error", turned, "rad")]
        figures.append(Figure("solves", float(len(self.solves))))
        plan = self._plan
        shapes = () if plan is None else (polyline("plan", plan.poses[:, :2]),)
        return Report(self._phase.name.lower(), tuple(figures), shapes)

    def end(self, code: JobError, reason: str) -> None:
        """See Method."""
        if self._phase is not JobPhase.IDLE:
            self._tracker.stop()
            self._phase, self._code, self._reason = JobPhase.IDLE, code, reason
            self._plan = None

    def revive(self) -> None:
        """See Method: the only robot is never given up."""

    def release(self) -> frozenset[str]:
        """See Method."""
        return frozenset(self._arena.robots if self._phase is JobPhase.IDLE else ())

    def errors(self, seen: Seen) -> tuple[float, float]:
        """See Method."""
        if self._goal is None:
            return math.inf, math.inf
        off = se2.between(self._goal, seen.object)
        return float(np.hypot(off[0], off[1])), abs(float(off[2]))

    def facts(self) -> Mapping[str, Any]:
        """See Method."""
        last = self.solves[-1] if self.solves else math.nan
        return {"solves": len(self.solves), "CPU time of the last solve": f"{1e3 * last:.0f} ms"}


def _beside(pose: Array, heading: float) -> Array:
    """The pose ``(3,)`` with the heading nearest to another one."""
    return np.array([*pose[:2], heading + se2.wrap(float(pose[2]) - heading)])


def check_team(robots: Mapping[str, RobotSpec], item: ObjectSpec) -> None:
    """Raise SettingsError unless there is one robot, with two wheels and a flat bumper."""
    if len(robots) != 1:
        raise SettingsError(f"has {len(robots)} robots; the method 'stable-nmpc' takes one")
    for robot in robots.values():
        _ = robot.differential, robot.flat_bumper


METHOD = MethodSpec(
    "stable-nmpc",
    StableNmpcMethod,
    {"": StableNmpcSettings, "mpc": MpcSettings, "tracker": TrackerSettings},
    check_team,
    "env1-target1",
)
