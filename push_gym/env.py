"""``PlanarPush/…-v0``: one room as a Gymnasium environment with goals."""

from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium import spaces

from push_gym.actions import PUSH_SIZE, action_size, checked, twists
from push_gym.arena import PushArena
from push_gym.picture import picture
from push_gym.pushes import Pushes
from push_gym.settings import env_settings
from push_model.settings import SettingsError

Observation = dict[str, Any]
_ROOM = np.zeros(1, dtype=np.intp)


def observation_space(arena: PushArena) -> spaces.Dict:
    """Of one room: ``observation``, ``achieved_goal``, ``desired_goal``, see ``push_gym.arena``."""
    state, goal = (bound.astype(np.float32) for bound in arena.bounds())
    return spaces.Dict(
        {
            "observation": spaces.Box(-state, state),
            "achieved_goal": spaces.Box(-goal, goal),
            "desired_goal": spaces.Box(-goal, goal),
        }
    )


def observed(arena: PushArena) -> Observation:
    """What all rooms of an arena show, a row a room."""
    names = ("observation", "achieved_goal", "desired_goal")
    return {k: v.astype(np.float32) for k, v in zip(names, arena.observations(), strict=True)}


class PlanarPushEnv(gymnasium.Env[Observation, Any]):
    """Robots push an object to a goal.

    An episode is terminated when the object is at its goal, and truncated when ``horizon`` seconds
    have passed. ``info`` has ``is_success``, ``time`` [s], and after an action of the level "push"
    also ``push_reached`` and ``push_reason``.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(
        self,
        system: str = "single",
        render_mode: str | None = None,
        method: dict[str, object] | None = None,
        **values: Any,
    ) -> None:
        """system: "single", "group" or "swarm", whose defaults hold. method: settings of the
        method that carries out actions of the level "push"; other levels have none. values: see
        ``EnvSettings``.

        Raises
        ------
        SettingsError: a setting that is wrong, by name.
        """
        self._system, self._method = system, dict(method or {})
        self.settings = env_settings(system, values)
        if method is not None and self.settings.action != "push":
            raise SettingsError(
                f"method: the level '{self.settings.action}' uses none; leave it out, or choose "
                "action='push'"
            )
        self.arena = PushArena(1, self.settings)
        self._pushes: Pushes | None = None
        if self.settings.action == "push":
            self._pushes = Pushes(system, self.arena, self.arena.item, self._method)
        self.render_mode = render_mode
        self.observation_space = observation_space(self.arena)
        size = action_size(self.settings, self.arena.robot)
        self.action_space = spaces.Box(-1.0, 1.0, (size,), dtype=np.float32)
        count = self.settings.robots
        self._shape = count, size // count
        self._what = f"{count} robots with {size // count} each"

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode. options: see ``push_gym.arena.OPTIONS``. It raises SettingsError, and
        then the present episode goes on."""
        super().reset(seed=seed)
        drawn = self.arena.drawn(_ROOM, [self.np_random], options)
        pushes = None
        if self.settings.action == "push":  # a new method, which remembers nothing
            pushes = Pushes(self._system, self.arena, drawn.item, self._method)
        self.arena.begin(_ROOM, drawn)
        self._pushes = pushes
        seen = self._seen()
        return seen, {"is_success": self._at_goal(seen), "time": 0.0}

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """One period, or one whole push."""
        info: dict[str, Any] = {}
        if self._pushes is not None:
            told = checked(action, (PUSH_SIZE,), "of a push")
            reached, reason, _ = self._pushes.push(told)
            info = {"push_reached": reached, "push_reason": reason}
        else:
            told = checked(action, (1, *self._shape), self._what)
            self.arena.step(twists(self.settings.action, self.arena.robot, told))
        seen = self._seen()
        terminated = self._at_goal(seen)
        truncated = bool(self.arena.late()[0]) and not terminated
        reward = float(self.compute_reward(seen["achieved_goal"], seen["desired_goal"], info))
        info |= {"is_success": terminated, "time": float(self.arena.times[0])}
        return seen, reward, terminated, truncated, info

    def compute_reward(self, achieved_goal: Any, desired_goal: Any, info: Any) -> Any:
        """Of one goal, or of many ``(n, …)``, e.g. relabelled ones."""
        return self.arena.rewards(achieved_goal, desired_goal)

    def compute_terminated(self, achieved_goal: Any, desired_goal: Any, info: Any) -> Any:
        """Whether an episode ends there; of one goal, or of many."""
        return self.arena.reached(achieved_goal, desired_goal)

    def compute_truncated(self, achieved_goal: Any, desired_goal: Any, info: Any) -> Any:
        """No goal truncates an episode; the time does."""
        return np.zeros(np.shape(achieved_goal)[:-1], dtype=bool)

    def render(self) -> Any:
        """``(height, width, 3)`` of the room from above; None without a render mode."""
        return picture(self.arena) if self.render_mode == "rgb_array" else None

    def _seen(self) -> Observation:
        return {k: v[0] for k, v in observed(self.arena).items()}

    def _at_goal(self, seen: Observation) -> bool:
        return bool(self.arena.reached(seen["achieved_goal"], seen["desired_goal"]))
