"""PettingZoo's parallel environments: every robot is an agent, and all share one reward."""

from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces
from gymnasium.utils import seeding
from pettingzoo import ParallelEnv

from push_gym.actions import checked, robot_action_size, twists
from push_gym.arena import PER_BODY, PushArena
from push_gym.env import observed
from push_gym.picture import picture
from push_gym.settings import env_settings
from push_model.settings import SettingsError

_ROOM = np.zeros(1, dtype=np.intp)


class PlanarPushParallelEnv(ParallelEnv[str, Any, Any]):
    """One room. An agent sees itself, the object, the goal, and the others in the order of their
    names, all in the world frame (see ``push_gym.arena``)."""

    metadata: ClassVar[dict[str, Any]] = {
        "render_modes": ["rgb_array"],
        "render_fps": 10,
        "name": "planar_push_v0",
    }

    def __init__(self, system: str = "group", render_mode: str | None = None, **values: Any):
        """Parameters as of ``PlanarPushEnv``.

        Raises
        ------
        SettingsError: a setting that is wrong; the level "push", which commands a whole team.
        """
        self.settings = env_settings(system, values)
        if self.settings.action == "push":
            raise SettingsError("action 'push': it commands a whole team; use PlanarPushEnv")
        self.arena, self.render_mode = PushArena(1, self.settings), render_mode
        self.possible_agents = [f"robot_{i}" for i in range(self.settings.robots)]
        self.agents: list[str] = []
        size = robot_action_size(self.settings.action, self.arena.robot)
        state, goal = (bound.astype(np.float32) for bound in self.arena.bounds())
        most = np.concatenate([state[: 2 * PER_BODY], goal, state[2 * PER_BODY :]])
        box = spaces.Box(-most, most)
        self.observation_spaces = dict.fromkeys(self.possible_agents, box)
        self._size = size
        action = spaces.Box(-1.0, 1.0, (size,), dtype=np.float32)
        self.action_spaces = dict.fromkeys(self.possible_agents, action)
        self._random = seeding.np_random(None)[0]

    def observation_space(self, agent: str) -> spaces.Box:
        """The same object for every call."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Box:
        """The same object for every call."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin an episode. options: see ``push_gym.arena.OPTIONS``."""
        if seed is not None:
            self._random = seeding.np_random(seed)[0]
        told = dict(options or {})
        told.pop("options", None)  # PettingZoo's own test hands that in
        self.arena.reset(_ROOM, [self._random], told)
        self.agents = list(self.possible_agents)
        return self._seen(), {agent: {} for agent in self.agents}

    def step(self, actions: dict[str, Any]) -> tuple[dict[str, Any], ...]:
        """One period. A robot without an action stands."""
        unknown = set(actions) - set(self.possible_agents)
        if unknown:
            known = ", ".join(self.possible_agents)
            raise ValueError(f"no agent called '{min(unknown)}'; known: {known}")
        told = [
            checked(actions.get(a, np.zeros(self._size)), (self._size,), f"of {a}")
            for a in self.possible_agents
        ]
        self.arena.step(twists(self.settings.action, self.arena.robot, np.array(told)[None]))
        seen = observed(self.arena)
        goals = seen["achieved_goal"][0], seen["desired_goal"][0]
        there = bool(self.arena.reached(*goals))
        late = bool(self.arena.late()[0]) and not there
        reward, agents = float(self.arena.rewards(*goals)), self.agents
        answer = (
            self._seen(),
            dict.fromkeys(agents, reward),
            dict.fromkeys(agents, there),
            dict.fromkeys(agents, late),
            {agent: {"is_success": there} for agent in agents},
        )
        if there or late:
            self.agents = []
        return answer

    def state(self) -> Any:
        """All bodies and the goal."""
        seen = observed(self.arena)
        return np.concatenate([seen["observation"][0], seen["desired_goal"][0]])

    def render(self) -> Any:
        """As of ``PlanarPushEnv``."""
        return picture(self.arena) if self.render_mode == "rgb_array" else None

    def _seen(self) -> dict[str, Any]:
        seen = observed(self.arena)
        bodies, goal = seen["observation"][0].reshape(-1, PER_BODY), seen["desired_goal"][0]
        robots, item = bodies[:-1], bodies[-1]
        return {
            agent: np.concatenate([robots[i], item, goal, np.delete(robots, i, axis=0).ravel()])
            for i, agent in enumerate(self.possible_agents)
            if agent in self.agents
        }
