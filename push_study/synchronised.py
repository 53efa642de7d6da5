"""Robots that each track their own way, synchronised, with the LTV-MPC: as section 3.1.6 does it.

A robot's way is that of its place about the object, were the object to go along its trajectory
exactly. Nobody looks at the object on the way: what is off at the beginning stays off. As a method
it runs in the graph by the name ``NAME``; it takes its places as a group does.
"""

import numpy as np

from grasp_opt.contact_outline import ContactOutline
from grasp_opt.group_method import check_team
from grasp_opt.object_trajectory import ObjectTrajectory
from grasp_opt.prediction import GroupPrediction
from push_job.method import Arena, MethodSpec, Seen, Task, Told
from push_job.report import Figure, Report, polyline
from push_model import se2
from push_model.arrays import Array
from push_model.belief import Belief
from push_model.jobs import JobError, JobPhase
from push_model.screws import point_velocities
from push_model.specs import ObjectSpec, RobotSpec
from push_mpc.controller import Reference
from push_mpc.ltv_mpc import LtvMpc
from push_mpc.settings import MpcSettings
from push_study.given_grasp import GRASP_SECTIONS, GivenGrasp

NAME = f"{__name__}:METHOD"
"""As ``run_team`` takes it."""
_RESTING = 1e-9  # [m/s] below which a place's velocity has no direction
_PATIENCE = 5  # programmes in a row that may have no solution
_SETTLE = 1.0  # [s] after the end of a trajectory, until robots stand


class SynchronisedTrackers:
    """One LTV-MPC for each robot at ``ways (n,)`` [m] along an outline, and one clock for all."""

    def __init__(
        self,
        item: ObjectSpec,
        robot: RobotSpec,
        ways: Array,
        trajectory: ObjectTrajectory,
        settings: MpcSettings | None = None,
    ) -> None:
        """trajectory: of the object's centre of mass."""
        self._mpc = settings or MpcSettings(max_obstacles=0)
        self.duration = trajectory.duration
        places = ContactOutline(item.geometry).at(ways).centres(robot.footprint_radius)
        self._time = trajectory.time
        self._ways = [_way(trajectory, place) for place in places]
        self._trackers = [LtvMpc(self._mpc, robot.differential) for _ in places]
        self._commands = np.zeros((len(places), 2))
        self._failed = np.zeros(len(places), dtype=int)

    @property
    def lost(self) -> bool:
        """Whether a robot cannot be controlled any more."""
        return bool((self._failed >= _PATIENCE).any())

    def step(self, time: float, tick: float, robots: Array) -> Array:
        """Twists ``(n, 2)`` v [m/s], omega [rad/s] at a time [s] of the trajectory; robots ``(n,
        3)`` poses."""
        at = np.array([time + k * self._mpc.step for k in range(self._mpc.horizon + 1)])
        for i, (way, mpc, robot) in enumerate(zip(self._ways, self._trackers, robots, strict=True)):
            reference = _sample(self._time, way, at)
            v, omega = self._commands[i]
            x, y, theta = reference.pose[0]
            local = se2.between(np.array([x, y, se2.wrap(float(theta))]), robot)
            error = np.array([*local, v - reference.twist[0, 0], omega - reference.twist[0, 2]])
            answer = mpc.solve(error, reference, None, np.zeros((0, 3)))
            self._failed[i] = 0 if answer.solved else self._failed[i] + 1
            a, epsilon = answer.acceleration
            self._commands[i] = mpc.drive.saturate(
                float(v + tick * a), float(omega + tick * epsilon)
            )
        return self._commands.copy()


class Synchronised(GivenGrasp):
    """Takes its places and finds contact as a group; then every robot tracks its own way."""

    def __init__(self, arena: Arena) -> None:
        super().__init__(arena)
        self._prediction = GroupPrediction(len(arena.robots), self.job.pose_delay)
        self._trackers: SynchronisedTrackers | None = None
        self._begin = 0.0  # [s] of the frame at which the push began

    def begin(self, task: Task, belief: Belief) -> None:
        """See Method."""
        super().begin(task, belief)
        self._trackers = None

    def step(self, seen: Seen, belief: Belief) -> Told:
        """See Method."""
        job, names = self.job, tuple(self._arena.robots)
        there = all(n in seen.robots for n in names)
        self._prediction.delay = job.pose_delay
        self._prediction.frame(seen.time)
        if job.state is JobPhase.PUSHING and there:
            told = self._track(seen, np.array([seen.robots[n] for n in names]))
        else:
            told = super().step(seen, belief)
        twists = [told.commands.get(n, (0.0, 0.0))[:2] for n in names]
        self._prediction.answer(np.array(twists))
        return told

    def along(self, now: float) -> float | None:
        """See GivenGrasp."""
        if self._trackers is None or not self.job.busy:
            return None
        return now - self._begin - self.job.pose_delay

    def report(self, seen: Seen) -> Report | None:
        """See Method: errors from the trajectory while every robot tracks its own way."""
        plan, time = self.job.plan, self.along(seen.time)
        if plan is None or time is None:
            return super().report(seen)
        off = se2.between(plan.trajectory.sample(time), self._item.mass_pose(seen.object))
        figures = (
            Figure("position error", float(np.hypot(off[0], off[1])), "m"),
            Figure("heading error", abs(float(off[2])), "rad"),
        )
        return Report("push", figures, (polyline("way", plan.trajectory.pose[:, :2]),))

    def _track(self, seen: Seen, robots: Array) -> Told:
        plan, names = self.job.plan, tuple(self._arena.robots)
        assert plan is not None
        if self._trackers is None:
            robot, way = self._arena.robot, plan.placement.way
            self._trackers = SynchronisedTrackers(self._item, robot, way, plan.trajectory)
            self._begin = self._frame = seen.time
        now, tick = seen.time - self._begin, seen.time - self._frame
        self._frame = seen.time
        if now >= plan.trajectory.duration + _SETTLE:
            self._finish(seen)
            return Told()
        pushers = list(plan.pushers)
        here = self._prediction.robots(robots)[pushers]
        twists = self._trackers.step(now, tick, here)
        if self._trackers.lost:
            self.end(JobError.EXECUTION_FAILED, "a robot cannot follow its path")
            return Told()
        commands = zip(pushers, twists.tolist(), strict=True)
        return Told({names[i]: (v, omega) for i, (v, omega) in commands})

    def _finish(self, seen: Seen) -> None:
        away, turned = self.errors(seen)
        s = self.job.settings
        good = away <= s.position_tolerance and turned <= s.orientation_tolerance
        text = f"{1e3 * away:.1f} mm and {turned:.3f} rad off at the end"
        self.end(JobError.NONE if good else JobError.OFF_TARGET, text)


def _way(trajectory: ObjectTrajectory, place: Array) -> Array:
    """``(n, 5)`` x, y, heading [rad] along the way, v, omega of a point fixed to the object."""
    poses = trajectory.pose
    points = np.array([se2.transform(pose, place) for pose in poses])
    local = np.array([point_velocities(twist, place[None])[0] for twist in trajectory.body_twists])
    speed = np.hypot(*local.T)
    moving = np.flatnonzero(speed > _RESTING)
    direction = np.arctan2(local[moving, 1], local[moving, 0]) + poses[moving, 2]
    heading = np.interp(trajectory.time, trajectory.time[moving], np.unwrap(direction))
    turn = np.gradient(heading, trajectory.time)
    return np.column_stack([points, heading, speed, turn])


def _sample(time: Array, way: Array, at: Array) -> Reference:
    """Of a way, at times ``(p + 1,)``; at rest beyond its end."""
    x, y, heading, v, omega = (np.interp(at, time, column) for column in way.T)
    going = at <= time[-1]
    zero = np.zeros(len(at))
    return Reference(
        np.column_stack([x, y, heading]), np.column_stack([v * going, zero, omega * going])
    )


METHOD = MethodSpec("synchronised", Synchronised, GRASP_SECTIONS, check_team, "group-ellipse")
