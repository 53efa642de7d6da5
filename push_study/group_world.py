"""A world with one object and a group of robots, seen through noise: without ROS, for long studies.

Whoever controls the group sees poses and gives twists, 50 times a second, as a node does.
"""

import math
from collections.abc import Mapping, Sequence
from types import TracebackType

import numpy as np

from grasp_opt.group_job import GroupJob
from grasp_opt.sequencing import NoStep
from grasp_opt.step_planner import StepPlanner, TooFew
from push_model.arrays import Array
from push_model.drives import HolonomicDrive
from push_model.jobs import JobError
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from push_study.pool import Row
from push_study.uncertainty import Uncertainty
from sim_bridge.worlds import world_kind

TICK = 0.02
"""[s] of poses and commands."""
OBJECT = "object"


class GroupWorld:
    """A running world of any kind. Use it as a context manager.

    names: of the robots. drawn: what of this world is not as believed. time: [s].
    """

    def __init__(
        self,
        environment: EnvironmentSpec,
        robot: RobotSpec,
        starts: Array,
        item: ObjectSpec,
        start: Array,
        doubt: Uncertainty,
        seed: int,
        world: str = "pybullet",
    ) -> None:
        """robot, item: as believed, what they are is drawn. starts ``(n, 3)``, start ``(3,)``:
        poses, the object's of its geometric frame."""
        self._random = np.random.default_rng(seed)
        self._noise = np.array(
            [doubt.position_noise, doubt.position_noise, doubt.orientation_noise]
        )
        self.drawn: Row = {}
        self.names = tuple(f"e{i}" for i in range(len(starts)))
        self.item = doubt.draw_item(OBJECT, item, self._random, self.drawn)
        robots = {
            name: (doubt.draw_robot(name, robot, self._random, self.drawn), pose)
            for name, pose in zip(self.names, starts, strict=True)
        }
        robots = doubt.draw_robot_friction(robots, self._random, self.drawn)
        self._holonomic = isinstance(robot.drive, HolonomicDrive)
        kind = world_kind(world)
        self._world = kind.make(
            environment, robots, {OBJECT: (self.item, start)}, kind.settings(), TICK
        )
        self._steps = round(TICK / self._world.time_step)
        self.time = 0.0

    def __enter__(self) -> "GroupWorld":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._world.close()

    def truth(self) -> tuple[Array, Array]:
        """Poses of the object ``(3,)`` and of the robots ``(n, 3)``, as they are."""
        poses = self._world.poses()
        return poses[OBJECT], np.array([poses[n] for n in self.names])

    def see(self) -> tuple[Array, Array]:
        """The same with the noise of motion capture."""
        item, robots = self.truth()
        noise = self._random.normal(0.0, 1.0, (1 + len(robots), 3)) * self._noise
        return item + noise[0], robots + noise[1:]

    def step(self, twists: Array, turns: Mapping[str, float] | None = None) -> None:
        """Go on by a tick; twists ``(n, 2)`` v [m/s], omega [rad/s], of robots that go in any
        direction vx, vy [m/s] in the world's frame; turns: their omega [rad/s] by name."""
        if self._holonomic:
            omega = [0.0 if turns is None else turns.get(n, 0.0) for n in self.names]
            self._world.command_all(self.names, np.column_stack([twists, omega]), fixed_frame=True)
        else:
            for name, (v, omega) in zip(self.names, twists, strict=True):
                self._world.command(name, float(v), float(omega))
        self._world.step(self._steps)
        self.time += TICK

    def kill(self, robots: Sequence[str]) -> None:
        """Robots that stand from now on, whatever they are told."""
        for name in robots:
            self._world.kill(name)

    def move(self, by: Array) -> None:
        """Somebody takes the object and puts it down elsewhere, by ``(3,)``."""
        self._world.place(OBJECT, self._world.poses()[OBJECT] + by)

    def felt(self) -> tuple[Array, bool]:
        """Mean forces ``(n,)`` [N] of the robots on the object since the last call, and whether
        robots touched each other, or anything touched a wall."""
        forces, collision = np.zeros(len(self.names)), False
        for contact in self._world.read_contacts():
            pair = {contact.body_a, contact.body_b}
            others = pair - {OBJECT}
            if len(others) == 1 and (name := others.pop()) in self.names and OBJECT in pair:
                forces[self.names.index(name)] += math.hypot(contact.force[0], contact.force[1])
            else:
                collision = True
        return forces, collision


def answer(job: GroupJob, planner: StepPlanner) -> None:
    """Plan what a job asks for; the world stands still meanwhile."""
    request = job.request
    if request is None:
        return
    rest = (request.robots, request.dead, np.zeros((0, 3)), request.fewest)
    try:
        job.planned(planner.plan(request.pose, request.goal, *rest))
    except TooFew as error:
        job.failed(JobError.TOO_HEAVY, str(error))
    except NoStep as error:
        job.failed(JobError.PLANNING_FAILED, str(error))
