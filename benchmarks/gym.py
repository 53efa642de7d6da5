"""Steps per second of one core: rooms of push_gym beside PushT of gym-pusht, in one run.

A step of either is 0.1 s with physics steps of 10 ms, which are those of gym-pusht; ours are also
measured with 5 ms, our default. Twice: with random actions, and while the object is pushed. Blocks
of both take turns, and ratios are of blocks side by side.
"""

import time
import warnings
from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np

import push_gym
from benchmarks.measure import at_least

ROOMS, BLOCKS, STEPS = 256, 9, 40
_PUSHT_STEPS = 1000  # of a block
_NAME = "PlanarPush/Single-v0"


class Rooms:
    """Ours."""

    def __init__(self, time_step: float) -> None:
        mode = gymnasium.VectorizeMode.VECTOR_ENTRY_POINT
        self._envs = gymnasium.make_vec(
            _NAME, num_envs=ROOMS, vectorization_mode=mode, time_step=time_step, horizon=1e4
        )
        self._random = np.random.default_rng(1)
        self._envs.reset(seed=1)

    def random(self) -> float:
        """Steps per second of a block with random actions."""
        actions = self._random.uniform(-1.0, 1.0, (STEPS, ROOMS, 2)).astype(np.float32)
        return self._rate(actions)

    def pushing(self) -> float:
        """Of a block in which every robot pushes its object."""
        put = {"start": [0.0, 0.0, 0.0], "robots": [[-0.1, 0.0, 0.0]], "goal": [0.7, 0.5, 0.0]}
        self._envs.reset(options=put)
        actions = self._random.uniform([0.6, -0.1], [1.0, 0.1], (STEPS, ROOMS, 2))
        return self._rate(actions.astype(np.float32))

    def _rate(self, actions: Any) -> float:
        began = time.thread_time()
        for action in actions:
            self._envs.step(action)
        return ROOMS * len(actions) / (time.thread_time() - began)


class PushT:
    """The rival."""

    def __init__(self) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import gym_pusht  # noqa: F401

            self._env = gymnasium.make("gym_pusht/PushT-v0", obs_type="state").unwrapped
        self._random = np.random.default_rng(1)
        self._env.reset(seed=1)

    def random(self) -> float:
        """Steps per second of a block with random actions."""
        actions = self._random.uniform(0.0, 512.0, (_PUSHT_STEPS, 2))
        return self._rate(lambda k, seen: actions[k])

    def pushing(self) -> float:
        """Of a block in which the disc presses on the middle of the T."""
        return self._rate(lambda k, seen: seen[2:4])

    def _rate(self, act: Callable[[int, Any], Any]) -> float:
        spent = 0.0
        for k in range(_PUSHT_STEPS):
            if k % 100 == 0:
                seen, _ = self._env.reset(seed=k)
            action = act(k, seen)
            began = time.thread_time()
            seen, *_ = self._env.step(action)
            spent += time.thread_time() - began
        return _PUSHT_STEPS / spent


def run() -> dict[str, Any]:
    """Steps per second and their ratios."""
    assert _NAME in push_gym.ENVIRONMENTS
    ours = {"10 ms": Rooms(1e-2), "5 ms": Rooms(5e-3)}
    try:
        rival: PushT | None = PushT()
    except ImportError:
        rival = None
        print('  gym-pusht is not installed; pip install -c constraints.txt -e ".[rivals]" adds it')
    result: dict[str, Any] = {"bounds": {}}
    for what in ("random", "pushing"):
        for env in (*ours.values(), *([rival] if rival else [])):
            getattr(env, what)()  # compiled, and in the caches
        rates: dict[str, list[float]] = {name: [] for name in (*ours, "gym-pusht")}
        for _ in range(BLOCKS):
            for name, env in ours.items():
                rates[name].append(getattr(env, what)())
            if rival is not None:
                rates["gym-pusht"].append(getattr(rival, what)())
        for name, found in rates.items():
            if found:
                result[f"{what} {name} [steps/s]"] = float(np.median(found))
                print(f"  {what:8s} {name:10s} {np.median(found):9.0f} steps/s", flush=True)
        if rival is not None:
            for name in ours:
                ratio = np.median(np.array(rates[name]) / rates["gym-pusht"])
                result[f"{what} {name} / gym-pusht"] = float(ratio)
                print(f"  {what:8s} {name:10s} {ratio:9.1f} times gym-pusht", flush=True)
            same = result[f"{what} 10 ms / gym-pusht"]
            result["bounds"][f"{what}, equal physics steps / gym-pusht"] = at_least(same, 10.0)
    return result
