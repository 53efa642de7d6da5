"""One push by a group that stands at its places: find contact, follow the trajectory, end. No ROS.

Whatever goes wrong ends the push with a reason: an object that falls behind or aside, robots that
find no contact, a robot that does not move although it is told to.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from grasp_opt.contact_outline import ContactOutline
from grasp_opt.contact_sense import ContactSense
from grasp_opt.group_control import (
    GroupCommand,
    GroupController,
    GroupControlSettings,
)
from grasp_opt.object_trajectory import ObjectTrajectory
from grasp_opt.prediction import GroupPrediction
from push_estimation.actuation_monitor import ActuationMonitor
from push_estimation.velocity_filter import VelocityFilter
from push_model import se2
from push_model.arrays import Array
from push_model.settings import bounded, settings
from push_model.specs import ObjectSpec, RobotSpec

_LISTEN = 0.3  # [s] over which gaps are averaged, against the noise of the poses
_STILL = 1e-6  # [m/s], [rad/s] below which a trajectory does not move, or does not turn
_GAP = 0.2  # [s] between ticks from which on they are no longer one after the other


@settings
class GroupPushSettings:
    """What is taken for contact, for progress and for failure."""

    contact: float = bounded(
        1e-3,
        low=1e-5,
        high=0.1,
        doc="Gap between robot and object below which they count as in contact (m).",
    )
    outline_error: float = bounded(
        0.01,
        low=0.0,
        high=0.1,
        doc="Greatest error of the believed outline of the object (m). Within this distance from "
        "it, a robot that comes no closer to the object although commanded to is in contact.",
    )
    steady: float = bounded(
        0.1,
        low=0.0,
        high=10.0,
        doc="Time for which all robots must be in contact before a push begins (s).",
    )
    search: float = bounded(
        8.0,
        low=0.1,
        high=600.0,
        doc="Time limit for all robots to make contact with the object (s).",
    )
    behind: float = bounded(
        0.01,
        low=1e-4,
        high=1.0,
        doc="Distance of the object behind the trajectory, along its path, at which the trajectory "
        "slows down; at twice this distance it stops (m). A turn counts as its angle times the "
        "radius of the limit surface.",
    )
    position_error: float = bounded(
        0.05, low=1e-3, high=10.0, doc="Position error of the object at which a push fails (m)."
    )
    orientation_error: float = bounded(
        0.3, low=0.01, high=7.0, doc="Orientation error of the object at which a push fails (rad)."
    )
    stalled: float = bounded(
        4.0,
        low=0.1,
        high=600.0,
        doc="Time without progress of the object after which a push fails (s).",
    )
    dead: float = bounded(
        1.0,
        low=0.1,
        high=60.0,
        doc="Time without the commanded motion after which a robot is considered dead (s).",
    )
    dead_way: float = bounded(
        0.01,
        low=1e-4,
        high=1.0,
        doc="Distance that a robot must be commanded to move within the time 'dead' before it "
        "is judged dead or alive (m).",
    )
    slip_warning: float = bounded(
        1.0,
        low=0.0,
        high=60.0,
        doc="A push ends this long before a point at which the contacts may no longer hold the "
        "object (s); without effect until the belief changes during the push",
    )
    stop_before_slip: bool = bounded(
        True,
        doc="Whether a push ends before a point at which the contacts may no longer hold the "
        "object, so that a new plan is made; otherwise only the report shows it",
    )
    position_noise: float = bounded(
        2e-4,
        low=1e-6,
        high=0.1,
        doc="Standard deviation of measured positions that the velocity filter of the object "
        "assumes (m).",
    )
    orientation_noise: float = bounded(
        1.7e-3,
        low=1e-6,
        high=0.5,
        doc="Standard deviation of measured headings that the velocity filter of the object "
        "assumes (rad).",
    )
    acceleration: float = bounded(
        0.3,
        low=1e-3,
        high=100.0,
        doc="Standard deviation of the object's acceleration that the velocity filter assumes "
        "(m/s^2).",
    )
    turning: float = bounded(
        1.5,
        low=1e-3,
        high=1000.0,
        doc="Standard deviation of the object's angular acceleration that the velocity filter "
        "assumes (rad/s^2).",
    )


class Phase(Enum):
    """The phases of a push."""

    SEARCH = "search"
    PUSH = "push"
    DONE = "done"
    FAILED = "failed"


@dataclass(frozen=True)
class GroupStep:
    """Commands of one tick: twists ``(n, 2)`` v [m/s], omega [rad/s]; command: what they come from;
    time: [s] along the trajectory; reason and dead (indices of robots) of a failure."""

    phase: Phase
    twists: Array
    command: GroupCommand | None
    time: float
    reason: str = ""
    dead: tuple[int, ...] = ()


class GroupPush:
    """A push by robots of one type, at the arc lengths ``ways (n,)`` [m] along the outline."""

    def __init__(
        self,
        item: ObjectSpec,
        robot: RobotSpec,
        ways: Array,
        trajectory: ObjectTrajectory,
        settings: GroupPushSettings | None = None,
        control: GroupControlSettings | None = None,
    ) -> None:
        """item, robot: as believed. trajectory: of the object's centre of mass.

        ahead: ``(n, 2)`` directions in the object's frame in which the robots come to it.
        """
        self.settings = s = settings or GroupPushSettings()
        self.trajectory, self._drive = trajectory, robot.differential
        self.controller = GroupController(
            ContactOutline(item.geometry),
            ways,
            item.contact_friction,
            item.limit_surface(),
            robot.footprint_radius,
            control,
        )
        self.ahead = self.controller.ahead(trajectory.first_twist)
        self._filter = VelocityFilter(
            s.position_noise, s.orientation_noise, s.acceleration, s.turning
        )
        self._sense = ContactSense(len(ways))
        self._closing = np.zeros(len(ways))
        self._prediction = GroupPrediction(len(ways), self.controller.settings.pose_delay)
        self._obedience = ActuationMonitor(len(ways), s.dead, s.dead_way)
        self._begin: float | None = None
        self._last = 0.0
        self._contact_since: float | None = None
        self.time = 0.0  # [s] along the trajectory
        self._moved_on = 0.0  # [s] when it last did

    def believe(self, item: ObjectSpec, robot: RobotSpec, moved: Array) -> None:
        """Push on with what is believed of the object and the robots now.

        moved: ``(2,)`` [m] by which the believed centre of mass has moved, object frame.
        """
        if moved.any():
            self.trajectory = self.trajectory.about(moved)
            self._filter.reset()
        self._drive = robot.differential
        before, outline = self.controller, ContactOutline(item.geometry)
        self.controller = GroupController(
            outline,
            outline.same_places(before.outline, before.ways, moved),
            item.contact_friction,
            item.limit_surface(),
            robot.footprint_radius,
            before.settings,
        )
        old, new = (c.outline.shape.outline for c in (before, self.controller))
        if old.shape == new.shape and np.allclose(old - moved, new, rtol=0.0, atol=1e-9):
            self.controller.offsets = before.offsets

    @property
    def pose_delay(self) -> float:
        """[s] from the measurement of a frame to the command that answers it; may change at any
        time."""
        return self._prediction.delay

    @pose_delay.setter
    def pose_delay(self, seconds: float) -> None:
        self._prediction.delay = seconds

    def rest(self, now: float) -> None:
        """A frame at a time [s] that is answered with zero commands."""
        self._prediction.frame(now)
        self._prediction.answer(np.zeros((len(self.ahead), 2)))

    def starts(self, pose: Array, off: float) -> Array:
        """``(n, 3)`` poses from which robots come to the object at a pose ``(3,)``, so far [m] from
        where they touch it."""
        centres = se2.transform(pose, self.controller.places - off * self.ahead)
        headings = pose[2] + np.arctan2(self.ahead[:, 1], self.ahead[:, 0])
        return np.column_stack([centres, headings])

    def step(self, now: float, pose: Array, robots: Array) -> GroupStep:
        """One tick. pose ``(3,)`` of the object's centre of mass, robots ``(n, 3)``, as they are in
        the frame that is answered at a time now [s]."""
        self._prediction.frame(now)
        step = self._step(now, pose, robots)
        pushed = None if step.command is None else step.command.twist
        self._prediction.answer(step.twists, pushed)
        return step

    def _step(self, now: float, pose: Array, seen: Array) -> GroupStep:
        s = self.settings
        if self._begin is None:
            self._begin = self._last = self._moved_on = now
        tick, self._last = now - self._last, now
        if tick > _GAP:  # nobody saw anything for a while: what was known of motion is old
            self._filter.reset()
            self._sense.reset()
            self._begin += tick
            self._moved_on += tick
            tick = 0.0
        self._filter.update(now, pose)
        estimate, robots = self._prediction.item(self._filter.pose), self._prediction.robots(seen)
        searching = self._contact_since is None or now - self._contact_since < s.steady
        if not searching:
            self._go_on(now, tick, estimate)
        ahead = self.time + tick
        command = None
        if searching:
            self._find_offsets(now, pose, seen)
            velocities = self.controller.meet(estimate, self.ahead, robots[:, :2])
            _, self._closing = self.controller.closing(pose, seen[:, :2], velocities)
            self._look_for_contact(now)
        else:
            command = self.controller.command(
                estimate,
                self._filter.twist,
                self.trajectory.sample(ahead),
                self.trajectory.twist_at(ahead),
                robots[:, :2],
                robots[:, 2],
            )
            velocities = command.velocities
        lead = self.controller.settings.lead
        twists = self._drive.follow(velocities, robots[:, 2], lead)
        failure, dead = self._failure(now, estimate, seen, twists, searching)
        if failure:
            return GroupStep(Phase.FAILED, 0.0 * twists, command, self.time, failure, dead)
        if not searching and self.time >= self.trajectory.duration:
            missed = self._missed(estimate)
            phase = Phase.FAILED if missed else Phase.DONE
            return GroupStep(phase, 0.0 * twists, command, self.time, missed)
        return GroupStep(Phase.SEARCH if searching else Phase.PUSH, twists, command, self.time)

    def _find_offsets(self, now: float, pose: Array, robots: Array) -> None:
        """Which robots touch the object elsewhere than at its believed outline."""
        gaps, _ = self.controller.closing(pose, robots[:, :2], np.zeros((len(robots), 2)))
        touching, mean = self._sense.step(now, gaps, self._closing)
        found = touching & (np.abs(mean) <= self.settings.outline_error)
        found &= self.controller.offsets == 0.0
        self.controller.offsets = np.where(found, mean, self.controller.offsets)

    def _look_for_contact(self, now: float) -> None:
        gaps = self._sense.recent(_LISTEN) - self.controller.offsets
        if (gaps > self.settings.contact).any():
            self._contact_since = None
        elif self._contact_since is None:
            self._contact_since = now

    def _go_on(self, now: float, tick: float, pose: Array) -> None:
        """Move along the trajectory, slower the farther the object is behind."""
        s = self.settings
        pace = float(np.clip(2.0 - self._lag(pose) / s.behind, 0.0, 1.0))
        self.time += pace * tick
        if pace > 0.1:
            self._moved_on = now

    def _lag(self, pose: Array) -> float:
        """[m] by which the object is behind: the part of its position error along the velocity of
        the trajectory, or that of its heading error along the turn, times the radius of the limit
        surface, whichever is greater.

        What is aside of the trajectory does not hold it up: the robots may not be able to make it
        good before its end.
        """
        off, task = self.trajectory.sample(self.time) - pose, self.trajectory.twist_at(self.time)
        speed, turning = math.hypot(task[0], task[1]), float(task[2])
        along = float(off[:2] @ task[:2]) / speed if speed > _STILL else 0.0
        turned = math.remainder(off[2], 2.0 * math.pi) * float(np.sign(turning))
        turned = turned if abs(turning) > _STILL else 0.0
        return max(0.0, along, self.controller.surface.radius * turned)

    def _missed(self, pose: Array) -> str:
        """Why a push at the end of its trajectory has failed all the same, or nothing: more than
        half of its way is missing, and so much that the trajectory would have waited for it."""
        away, turned = self._errors(pose)
        gone = self.trajectory.pose[-1] - self.trajectory.pose[0]
        radius = self.controller.surface.radius
        missing, way = (
            math.hypot(p, radius * r)
            for p, r in ((away, turned), (math.hypot(gone[0], gone[1]), gone[2]))
        )
        if missing <= max(2.0 * self.settings.behind, 0.5 * way):
            return ""
        return f"the push ended {1e3 * away:.0f} mm and {turned:.2f} rad from the end of its way"

    def _errors(self, pose: Array) -> tuple[float, float]:
        off = self.trajectory.sample(self.time) - pose
        return math.hypot(off[0], off[1]), abs(math.remainder(off[2], 2.0 * math.pi))

    def _failure(
        self, now: float, pose: Array, robots: Array, twists: Array, searching: bool
    ) -> tuple[str, tuple[int, ...]]:
        """Why the push cannot go on, or nothing; and which robots are to blame."""
        s = self.settings
        assert self._begin is not None
        dead = self._obedience.step(now, robots, twists)
        if dead and len(dead) == len(robots):
            return "no robot moves as commanded: the robots may be stuck, or the poses frozen", ()
        if dead:
            return f"{_count(dead)} not move although commanded to", dead
        away, turned = self._errors(pose)
        if away > s.position_error or turned > s.orientation_error:
            return f"the object is {1e3 * away:.0f} mm and {turned:.2f} rad from its trajectory", ()
        if searching:
            late = now - self._begin > s.search
            return ("not every robot made contact with the object" if late else ""), ()
        if now - self._moved_on > s.stalled:
            behind = 1e3 * self._lag(pose)
            return f"the object stays {behind:.0f} mm behind the trajectory", ()
        return "", ()


def _count(who: Sequence[int]) -> str:
    return "a robot does" if len(who) == 1 else f"{len(who)} robots do"
