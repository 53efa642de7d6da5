"""Train an agent on ``PlanarPush/Single-v0`` with a library of other people: Stable-Baselines3.

``gym_train.py [SECONDS] [FILE]`` trains soft actor-critic with hindsight replay for so many seconds
of wall time, tests it, and writes it to a file. docs/learning.md says how
to install what it needs.
"""

import sys
import time
from typing import Any

import gymnasium
import numpy as np
from stable_baselines3 import SAC, HerReplayBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.evaluation import evaluate_policy

import push_gym

ROOM: dict[str, Any] = {"room": (1.2, 1.0), "horizon": 20.0, "period": 0.2}
"""A small room, in which an agent meets the object by chance."""
TOLERANCES: dict[str, Any] = {"position_tolerance": 0.05, "orientation_tolerance": None}


class Until(BaseCallback):
    """Ends the training when its time is over; tells how it goes."""

    def __init__(self, seconds: float) -> None:
        super().__init__()
        self._end, self._next = time.monotonic() + seconds, 0.0

    def _on_step(self) -> bool:
        now = time.monotonic()
        if now > self._next:
            self._next = now + 10.0
            recent = self.model.ep_success_buffer or [0.0]
            print(
                f"{self.num_timesteps} steps, {100 * np.mean(recent):.0f} % of the last "
                f"{len(recent)} episodes reached, {self._end - now:.0f} s left",
                flush=True,
            )
        return now < self._end


def main(seconds: str = "600", file: str = "single_sac.zip") -> bool:
    """Whether training and test ended without an error."""
    push_gym.register_all()
    env = gymnasium.make("PlanarPush/Single-v0", reward="sparse", **ROOM, **TOLERANCES)
    model = SAC(
        "MultiInputPolicy",
        env,
        replay_buffer_class=HerReplayBuffer,
        replay_buffer_kwargs={"n_sampled_goal": 4},
        learning_starts=2000,
        seed=1,
    )
    model.learn(10**9, callback=Until(float(seconds)))
    model.save(file)
    rewards, lengths = evaluate_policy(model, env, 20, return_episode_rewards=True)
    reached = int(np.sum(np.array(lengths) < ROOM["horizon"] / ROOM["period"]))
    print(
        f"{file}: {reached} of 20 test episodes reach the goal, mean reward {np.mean(rewards):.1f}"
    )
    return True


if __name__ == "__main__":
    sys.exit(not main(*sys.argv[1:]))
