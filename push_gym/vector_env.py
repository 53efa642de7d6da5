"""Many rooms as one Gymnasium vector environment: one compiled call moves all of them."""

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from push_gym.actions import action_size, checked, twists
from push_gym.arena import PushArena
from push_gym.env import Observation, observation_space, observed
from push_gym.settings import env_settings
from push_model.settings import SettingsError


class PlanarPushVectorEnv(VectorEnv[Observation, Any, Any]):
    """``num_envs`` rooms of one system.

    A room whose episode has ended is reset by the next step, which moves nothing in it and has a
    reward of 0 there (``AutoresetMode.NEXT_STEP``). Equal seeds give the episodes that
    ``PlanarPushEnv`` gives, whatever the number of rooms.
    """

    metadata: ClassVar[dict[str, Any]] = {
        "render_modes": [],
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        system: str = "single",
        render_mode: str | None = None,
        **values: Any,
    ) -> None:
        """Parameters as of ``PlanarPushEnv``.

        Raises
        ------
        SettingsError: a setting that is wrong; the level "push", which is for one room.
        """
        self.settings = env_settings(system, values)
        if self.settings.action == "push":
            raise SettingsError("action 'push': for one room only; use PlanarPushEnv")
        if isinstance(num_envs, bool) or not isinstance(num_envs, int) or num_envs < 1:
            raise SettingsError(
                f"num_envs: expected a whole number of at least 1, got {num_envs!r}"
            )
        if render_mode is not None:
            raise SettingsError("render_mode: many rooms cannot be rendered; leave it out")
        self.num_envs, self.render_mode = num_envs, render_mode
        self.arena = PushArena(num_envs, self.settings)
        self.single_observation_space = observation_space(self.arena)
        size = action_size(self.settings, self.arena.robot)
        self.single_action_space = spaces.Box(-1.0, 1.0, (size,), dtype=np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        count = self.settings.robots
        self._shape = num_envs, count, size // count
        self._what = f"{num_envs} rooms, {count} robots in each, {size // count} a robot"
        self._randoms = [seeding.np_random(None)[0] for _ in range(num_envs)]
        self._ended = np.zeros(num_envs, dtype=np.bool_)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode in every room. seed: of the first room, the next has the next; or a
        list, a room each."""
        if seed is not None:
            first = None if isinstance(seed, Sequence) else int(seed)
            seeds = list(seed) if isinstance(seed, Sequence) else []
            if first is not None:
                seeds = [first + i for i in range(self.num_envs)]
            if len(seeds) != self.num_envs:
                raise ValueError(f"seed: expected one for each of {self.num_envs} rooms")
            for i, one in enumerate(seeds):
                if one is not None:
                    self._randoms[i] = seeding.np_random(one)[0]
        self.arena.reset(np.arange(self.num_envs), self._randoms, options)
        self._ended[:] = False
        seen = observed(self.arena)
        there = self.arena.reached(seen["achieved_goal"], seen["desired_goal"])
        return seen, {"is_success": there, "time": self.arena.times.copy()}

    def step(self, actions: Any) -> tuple[Observation, Any, Any, Any, dict[str, Any]]:
        """One period in every room."""
        still = self._ended
        told = checked(actions, self._shape, self._what)
        if still.any():
            rooms = np.flatnonzero(still)
            self.arena.reset(rooms, [self._randoms[i] for i in rooms])
        moved = twists(self.settings.action, self.arena.robot, told)
        self.arena.step(moved, still if still.any() else None)
        seen = observed(self.arena)
        goals = seen["achieved_goal"], seen["desired_goal"]
        there = self.arena.reached(*goals)
        terminated = there & ~still
        truncated = self.arena.late() & ~terminated & ~still
        rewards = np.where(still, 0.0, self.arena.rewards(*goals))
        self._ended = terminated | truncated
        info = {"is_success": there, "time": self.arena.times.copy()}
        return seen, rewards, terminated, truncated, info
