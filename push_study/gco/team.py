"""Our method for groups in GCo's simulator: the host that its ``Method`` needs, and its settings.

The simulator drags discs that have no heading. Each gets one here, which turns as the method
commands, and is dragged as a robot on wheels with this heading would drive.
"""

import math
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from grasp_opt.group_method import GROUP
from grasp_opt.plan_source import InlinePlans
from grasp_opt.step_settings import StepSettings
from push_job.method import Arena, Command, Refusal, Seen, Task
from push_model.arrays import Array
from push_model.belief import Belief
from push_model.bumpers import RingBumper
from push_model.drives import SpeedDrive
from push_model.jobs import JobError, JobPhase
from push_model.occupancy import rasterise
from push_model.shape_specs import EllipseShape, RectangleShape
from push_model.specs import CircleSpec, EnvironmentSpec, ObjectSpec, RobotSpec
from push_study.gco.problems import RADIUS, Problem
from push_study.gco.room import TICK, Room, Told

ROBOT = RobotSpec(
    drive=SpeedDrive(
        wheel_radius=0.02,
        half_track=0.026,
        max_wheel_speed=14.0,
        wheel_mass=0.01,
        wheel_torque=0.5,
    ),
    bumper=RingBumper(radius=RADIUS, z=0.015, height=0.03),
    body_radius=RADIUS,
    body_height=0.03,
    mass=2.2,
)
"""A disc of the simulator as our method sees it. It drives at 0.28 m/s at most; GCo's robots drive
at 0.17 to 0.22 m/s mostly, and at up to 0.75 m/s."""
FRICTION = 0.2
"""Of robots and object, as believed. MuJoCo's coefficient is 1, but its contacts creep, and discs
roll along the object: pushed at 45 degrees to the normal of its side, it goes at 32, at 10 degrees
at 3."""
SCALE = 5.5
"""Floor friction of the object, 9.8 N, over that of the plates for which the gains of the group
were chosen."""
SETTINGS: dict[str, Any] = {
    "moves": {"speed": 0.28, "deceleration": 1.0, "turn_rate": 10.0},
    "push": {"behind": 0.03, "position_error": 0.08, "orientation_error": 0.4},
    "control": {
        "position_gain": 40.0 * SCALE,
        "orientation_gain": 6.0 * SCALE,
        "velocity_gain": 2.0 * SCALE,
        "turning_gain": 0.1 * SCALE,
        "force_gain": 0.002 / SCALE,
    },
}
STEPS = StepSettings(speed=0.15, acceleration=0.15)
LIMIT = 600.0
"""[s] of simulation."""
_ROOM = 8.0  # [m] of the map
_LEASH = 0.02  # [m] that a disc is dragged ahead of itself at most


@dataclass(frozen=True)
class Outcome:
    """told: by the room at the end. pushes: that were begun. reason: why the goal was not reached;
    empty if the method says that it was. cpu: [s] of the method."""

    told: Told
    pushes: int
    reason: str
    cpu: float


def push(room: Room, problem: Problem, away: float, turned: float) -> Outcome:
    """Bring the object to the goal of a problem, within [m] and [rad]."""
    told, began = room.reset(), time.process_time()
    names = [f"robot_{k}" for k in range(len(problem.robots))]
    item, robots = _item(problem), dict.fromkeys(names, ROBOT)
    GROUP.check(robots, item)
    grid = rasterise(_environment(problem))
    asked = {"position_tolerance": away, "orientation_tolerance": turned, **SETTINGS}
    plans = InlinePlans(grid, "object", names[0], STEPS)
    method = GROUP.make(Arena(grid, robots, "object", item, GROUP.settings(asked), plans))
    belief, discs = Belief({"object": item}, robots), Discs(told, names)
    task = Task((problem.target,))
    answer = method.assess(task, belief, discs.seen(told))
    if isinstance(answer, Refusal):
        return Outcome(told, 0, answer.reason, 0.0)
    method.begin(task, belief)
    spent = time.process_time() - began
    while True:
        began = time.process_time()
        commands = method.step(discs.seen(told), belief).commands
        spent += time.process_time() - began
        if method.status.phase == JobPhase.IDLE:
            break
        if told["time_s"] > LIMIT:
            method.end(JobError.EXECUTION_FAILED, f"no end within {LIMIT:.0f} s")
            break
        told = room.move(discs.drive(told, [commands.get(n, (0.0, 0.0)) for n in names]))
    status = method.status
    reason = "" if status.code == JobError.NONE else status.reason
    return Outcome(told, status.pushes, reason, spent)


class Discs:
    """Robots on wheels in place of discs that are dragged."""

    def __init__(self, told: Told, names: list[str]) -> None:
        self._names = names
        self._headings, self._targets = np.zeros(len(names)), np.array(told["robots"])

    def seen(self, told: Told) -> Seen:
        """What is told as motion capture would say it."""
        poses = np.column_stack([told["robots"], self._headings])
        robots = dict(zip(self._names, poses, strict=True))
        return Seen(told["time_s"], np.array(told["object"]), robots)

    def drive(self, told: Told, commands: list[Command]) -> Array:
        """``(n, 2)`` [m] to where the discs are to be dragged in a tick, for twists (v, omega)."""
        for k, (here, command) in enumerate(zip(told["robots"], commands, strict=True)):
            v, omega = ROBOT.differential.saturate(command[0], command[1])
            middle = self._headings[k] + 0.5 * omega * TICK
            self._headings[k] += omega * TICK
            self._targets[k] += v * TICK * np.array([math.cos(middle), math.sin(middle)])
            ahead = self._targets[k] - here
            self._targets[k] = here + ahead * min(1.0, _LEASH / max(_LEASH, math.hypot(*ahead)))
        return self._targets


def _item(problem: Problem) -> ObjectSpec:
    size = problem.size
    shape = (
        EllipseShape(semi_axis_x=size[0], semi_axis_y=size[0])
        if problem.shape == "circle"
        else RectangleShape(length=size[0], width=size[1])
    )
    return ObjectSpec(
        shape=shape, mass=1.0, height=0.04, floor_friction=1.0, contact_friction=FRICTION
    )


def _environment(problem: Problem) -> EnvironmentSpec:
    circles = tuple(CircleSpec(centre=(x, y), radius=r) for x, y, r in problem.obstacles)
    return EnvironmentSpec(size=(_ROOM, _ROOM), circles=circles)
