"""The level "push": an action is where the object shall go next, and the suite's method brings it.

The method is the one that the system's node hosts (``push_job.method``), stepped here as a notebook
does: poses of now, no latency, no noise; planning takes no time of the room's.
"""

import math
from collections.abc import Mapping

import numpy as np

from push_gym.arena import PushArena
from push_job.method import Arena, Command, Method, Refusal, Seen, Task, Unsuited, method_spec
from push_model import se2
from push_model.arrays import Array
from push_model.belief import Belief
from push_model.jobs import JobError, JobPhase
from push_model.occupancy import rasterise
from push_model.settings import SettingsError
from push_model.specs import ObjectSpec

METHODS = {"single": "one-robot", "group": "group", "swarm": "swarm"}
"""Names of the methods by system."""
REACH, TURN = 0.5, 0.5 * math.pi
"""[m], [rad] of the object, in its own frame, for an action of 1."""
LONGEST = 120.0
"""[s] that a push may take."""
_TICK = 0.01  # [s] between frames
_OBJECT = "object"


class Pushes:
    """Carries out pushes in the one room of an arena."""

    def __init__(
        self, system: str, arena: PushArena, item: ObjectSpec, settings: dict[str, object]
    ) -> None:
        """item: the object that the room has when a push begins. settings: of the method, nested,
        as in a scenario. Raises SettingsError."""
        spec = method_spec(METHODS[system])
        if spec is None:
            raise SettingsError(f"the method '{METHODS[system]}' is not installed")
        self._arena, self._names = arena, [f"e{i}" for i in range(arena.settings.robots)]
        robots = dict.fromkeys(self._names, arena.robot)
        spec.check(robots, item)
        grid = rasterise(arena.environment)
        made = Arena(grid, robots, _OBJECT, item, spec.settings(settings))
        try:
            self._method: Method = spec.make(made)
        except Unsuited as error:
            raise SettingsError(str(error)) from None
        self._belief = Belief({_OBJECT: item}, robots)
        self._time = 0.0
        self._steps = max(1, round(_TICK / arena.world.time_step))

    def push(self, action: Array) -> tuple[bool, str, float]:
        """Bring the object to where an action ``(3,)`` says, from where it is.

        Returns whether the method got it there, what it said, and the time that passed [s].
        """
        arena, headings = self._arena, self._arena.headings
        told = np.clip(np.asarray(action, dtype=np.float64), -1.0, 1.0)
        target = se2.compose(arena.world.poses[0, -1], told * [REACH, REACH, TURN])
        if not headings:
            target[2] = math.nan
        task, began = Task((target,)), self._time
        answer = self._method.assess(task, self._belief, self._seen())
        if isinstance(answer, Refusal):
            self._move(np.zeros((len(self._names), 3)))  # a refusal takes a tick, too
            return False, answer.reason, self._time - began
        self._method.begin(task, self._belief)
        while True:
            told_now = self._method.step(self._seen(), self._belief)
            status = self._method.status
            if status.phase == JobPhase.IDLE:
                break
            if self._time - began > LONGEST:
                self._method.end(JobError.EXECUTION_FAILED, f"no end within {LONGEST:.0f} s")
                break
            self._move(self._twists(told_now.commands))
        self._move(np.zeros((len(self._names), 3)))
        status = self._method.status
        return status.code == JobError.NONE, status.reason, self._time - began

    def _seen(self) -> Seen:
        poses = self._arena.world.poses[0]
        return Seen(self._time, poses[-1], dict(zip(self._names, poses, strict=False)))

    def _twists(self, commands: Mapping[str, Command]) -> Array:
        twists = np.zeros((len(self._names), 3))
        headings = self._arena.world.poses[0, :, 2]
        for i, name in enumerate(self._names):
            told = commands.get(name)
            if told is None:
                continue
            if self._arena.robot.kinematics is not None:
                twists[i] = told[0], 0.0, told[1]
            else:  # in the fixed frame
                c, s = math.cos(headings[i]), math.sin(headings[i])
                twists[i, :2] = c * told[0] + s * told[1], -s * told[0] + c * told[1]
                twists[i, 2] = told[2] if len(told) == 3 else 0.0
        return twists

    def _move(self, twists: Array) -> None:
        world = self._arena.world
        world.command(twists[None])
        world.step(self._steps)
        self._time += self._steps * world.time_step
        self._arena.times += self._steps * world.time_step
