"""A scripted baseline for the environments of ``push_gym``: push the object towards the goal.

``gym_push_by_push.py [Single|Group|Swarm] [EPISODES]`` uses actions of the level "push", each of
which says where the object shall go next. docs/learning.md says how to install what it needs.
"""

import sys

import gymnasium
import numpy as np

import push_gym
from push_gym.pushes import REACH, TURN
from push_model import se2


def main(system: str = "Single", episodes: str = "5") -> bool:
    """Whether all episodes ended at the goal."""
    push_gym.register_all()
    env = gymnasium.make(f"PlanarPush/{system}-v0", action="push", horizon=900.0)
    reached = 0
    for seed in range(int(episodes)):
        seen, info = env.reset(seed=seed)
        over, pushes = False, 0
        while not over:
            here, goal = pose(seen["achieved_goal"]), pose(seen["desired_goal"])
            away = se2.between(here, goal) / [REACH, REACH, TURN]
            seen, _, terminated, truncated, info = env.step(np.clip(away, -1.0, 1.0))
            over, pushes = terminated or truncated, pushes + 1
        reached += info["is_success"]
        end = "at the goal" if info["is_success"] else info["push_reason"]
        print(f"episode {seed}: {pushes} actions, {info['time']:.0f} s: {end}", flush=True)
    print(f"{reached} of {episodes} reached")
    return reached == int(episodes)


def pose(goal: np.ndarray) -> np.ndarray:
    """``(3,)`` of the four numbers of a goal, or of two where headings do not matter."""
    heading = 0.0 if len(goal) == 2 else np.arctan2(goal[3], goal[2])
    return np.array([goal[0], goal[1], heading])


if __name__ == "__main__":
    sys.exit(not main(*sys.argv[1:]))
