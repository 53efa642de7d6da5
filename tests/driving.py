"""Steps jobs without ROS, as a notebook does: a small world with one object and a few robots.

Whoever controls the robots sees poses through noise and gives twists, 50 times a second.
"""

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


def drive(job, world, item, limit, meanwhile=None):
    """Until a job that was begun ends, or a time [s]: poses ``(t, 1 + n, 3)`` of object and robots
    every 0.2 s, and how long [s] each phase took."""
    ways, none, phases, tick = [], np.zeros((0, 3)), {}, 0
    while world.time < limit and job.busy:
        if meanwhile is not None:
            meanwhile(world.time)
        seen, robots = world.see()
        here = dict(zip(world.names, robots, strict=True))
        twists = job.step(world.time, item.mass_pose(seen), here, none)
        if job.last is not None:
            name = job.last.phase.value
            phases[name] = phases.get(name, 0.0) + TICK
        if tick % 10 == 0:
            ways.append(np.vstack([*world.truth()]))
        world.step(np.array([twists[n] for n in world.names]))
        tick += 1
    return np.array(ways), phases
