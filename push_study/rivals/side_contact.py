"""Brings a robot to a side of the object and into contact, for rivals that push with one robot.

It drives there by this project's planner and tracker, and touches the side straight on.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from push_job.method import Arena, Unsuited
from push_model import se2
from push_model.arrays import Array
from push_model.distance_field import DistanceField
from push_model.settings import SettingsError
from push_model.specs import ObjectSpec, RobotSpec
from push_model.trajectory import Trajectory, line
from push_mpc import LtvMpc, MpcSettings, Task, TrackerSettings, TrajectoryTracker
from push_planner import NoRobotPath, PlannerSettings, plan_robot_path
from push_supervisor import SupervisorSettings, Surroundings

_STANDOFF, _TOUCH_SPEED, _TOUCH_BRAKING = 0.03, 0.06, 0.2  # [m], [m/s], [m/s^2]
_OF_PUSHES = (
    *("tracked", "friction_trust", "stop_before_slip", "slip_warning", "grasp_filter"),
    *("contact_gap", "contact_aside", "contact_turn", "contact_time"),
)  # settings of the tracker
SECTIONS: Mapping[str, type[Any]] = {"mpc": MpcSettings, "tracker": TrackerSettings}
"""Of a method that drives so, with the classes of their settings."""


@dataclass(frozen=True)
class Drive:
    """A tick on the way. command: v [m/s], omega [rad/s]; done: whether the robot is there, at the
    side or away from it; failure: why it does not get there, empty if it may."""

    command: tuple[float, float]
    done: bool = False
    failure: str = ""


class SideContact:
    """Of one robot and one object. near: what stands around them."""

    def __init__(self, arena: Arena) -> None:
        """Raises Unsuited for settings of pushes, which are not tracked here."""
        self.field = DistanceField(arena.grid)
        self._planning = PlannerSettings()
        mpc = LtvMpc(arena.section("mpc", MpcSettings), arena.robot.differential)
        tracker = arena.section("tracker", TrackerSettings)
        for name in _OF_PUSHES:
            if getattr(tracker, name) != getattr(TrackerSettings(), name):
                raise Unsuited(f"tracker.{name} has no effect: its pushes are not tracked")
        self.tracker = TrajectoryTracker(tracker, mpc)
        self.tracker.warm_up()
        self.near = Surroundings(arena.robot, arena.item, {}, SupervisorSettings())
        self.near.take_map(arena.grid)
        self._ahead = False  # going straight on to the side
        self._grasp: Array | None = None

    def begin(self, robot: Array, seen: Array, item: Array, grasp: Array, spec: RobotSpec) -> str:
        """Set out; why there is no way, empty if there is one.

        robot: pose ``(3,)``; seen, item: poses of the object's frame and of its centre of mass;
        grasp ``(3,)``: pose of the centre of mass in the frame of the robot that touches the side.
        """
        contact = se2.compose(item, se2.inverse(grasp))
        to = se2.compose(contact, np.array([-_STANDOFF, 0.0, 0.0]))
        around = self.near.on_the_way(seen, {})
        try:
            way = plan_robot_path(self.field, spec, self._planning, robot, to, around)
        except NoRobotPath as error:
            return str(error)
        self._grasp, self._ahead = grasp, False
        self._track(way, self.near.follow(way, seen))
        return ""

    def back_off(self, robot: Array, seen: Array) -> None:
        """Set out straight back from the object, as far as there is room; see ``begin``."""
        self._grasp = None
        self._track(*self.near.retreat(robot, seen))

    def tick(self, dt: float, robot: Array, item: Array, age: float) -> Drive:
        """``dt`` [s] later; robot, item: poses ``(3,)``, of the centre of mass; age [s]: of the
        robot's pose."""
        tick = self.tracker.tick(dt, robot, None, age=age)
        command, grasp = (tick.v, tick.omega), self._grasp
        if tick.finished and tick.code:
            return Drive(command, failure=tick.message)
        if tick.finished and grasp is not None and not self._ahead:
            contact = se2.compose(item, se2.inverse(grasp))
            ahead = max(float(se2.between(robot, contact)[0]), 1e-3)
            start = se2.compose(contact, np.array([-ahead, 0.0, 0.0]))
            way = line(start, ahead, _TOUCH_SPEED, 0.3, braking=_TOUCH_BRAKING)
            self._track(way, np.zeros((0, 3)))
            self._ahead = True
        elif tick.finished:
            self.tracker.stop()
            return Drive(command, done=True)
        return Drive(command)

    @property
    def ahead(self) -> bool:
        """Whether the robot is behind the side, and drives straight on until it touches it."""
        return self._ahead

    def _track(self, way: Trajectory, circles: Array) -> None:
        s = self.tracker.settings
        self.tracker.start(Task(way, None, circles, s.position_tolerance, s.orientation_tolerance))


def check_team(robots: Mapping[str, RobotSpec], item: ObjectSpec, method: str) -> None:
    """Raise SettingsError unless there is one robot, with two wheels and a flat bumper."""
    if len(robots) != 1:
        raise SettingsError(f"has {len(robots)} robots; the method '{method}' takes one")
    for robot in robots.values():
        _ = robot.differential, robot.flat_bumper
