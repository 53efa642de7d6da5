"""The level "push": actions displace the object, and the suite's methods do the rest."""

import importlib
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import push_gym
from push_gym.pushes import REACH, TURN
from push_model import se2
from push_model.settings import SettingsError

assert push_gym.ENVIRONMENTS


def towards_the_goal(env):
    """The scripted baseline: as much of the way as one action can say."""
    arena = env.unwrapped.arena
    goal = arena.goals[0].copy()
    here = arena.world.poses[0, -1]
    if not arena.headings:
        goal[2] = here[2]
    return np.clip(se2.between(here, goal) / [REACH, REACH, TURN], -1.0, 1.0)


SYSTEMS = ["Single", *(pytest.param(s, marks=pytest.mark.long) for s in ("Group", "Swarm"))]


@pytest.mark.parametrize("system", SYSTEMS)
def test_a_script_of_three_lines_reaches_the_goal(system):
    env = gymnasium.make(f"PlanarPush/{system}-v0", action="push", horizon=900.0)
    env.reset(seed=2)
    for _ in range(8):
        _, _, terminated, truncated, info = env.step(towards_the_goal(env))
        assert "push_reached" in info and info["push_reason"]
        if terminated or truncated:
            break
    assert terminated, info


def test_a_push_that_cannot_be_done_says_why_and_moves_nothing():
    env = gymnasium.make("PlanarPush/Single-v0", action="push")
    env.reset(seed=1, options={"start": [0.6, 0.0, 0.0], "robots": [[0.0, 0.0, 0.0]]})
    before = env.unwrapped.arena.world.poses
    _, _, terminated, _, info = env.step(np.array([1.0, 0.0, 0.0]))  # into the wall
    assert not terminated and not info["push_reached"]
    assert "wall" in info["push_reason"] or "map" in info["push_reason"], info
    assert np.abs(env.unwrapped.arena.world.poses - before).max() < 1e-6
    assert info["time"] > 0.0, "time passes, or an agent could be refused for ever"


@pytest.mark.long
@pytest.mark.parametrize("system", SYSTEMS)
def test_equal_seeds_give_equal_pushes_whatever_was_before(system):
    ends = []
    env = gymnasium.make(f"PlanarPush/{system}-v0", action="push")
    for k in range(2):
        env.reset(seed=4)
        seen, *_ = env.step(np.array([0.4, 0.1, 0.2]))
        ends.append(seen["observation"])
        if k == 0:
            env.reset(seed=5)
            env.step(np.array([-0.3, 0.2, -0.4]))
    assert np.array_equal(*ends)


def test_a_team_that_the_method_cannot_drive_is_refused():
    with pytest.raises(SettingsError, match="one"):
        gymnasium.make("PlanarPush/Single-v0", action="push", robots=2)
    with pytest.raises(SettingsError, match="one room"):
        push_gym.PlanarPushVectorEnv(2, "single", action="push")
    with pytest.raises(SettingsError, match="team"):
        push_gym.parallel_env("group", action="push")


def test_an_object_that_the_method_cannot_push_is_refused_and_changes_nothing():
    env = gymnasium.make("PlanarPush/Group-v0", action="push").unwrapped
    env.reset(seed=1)
    item, poses, method = env.arena.item, env.arena.world.poses.copy(), env._pushes
    with pytest.raises(SettingsError, match="convex"):
        env.reset(seed=1, options={"object": "transport_l"})
    assert env.arena.item is item and env._pushes is method
    assert np.array_equal(env.arena.world.poses, poses)


@pytest.mark.long
def test_the_example_reaches_its_goals(monkeypatch, capsys):
    monkeypatch.syspath_prepend(str(Path(__file__).resolve().parents[2] / "examples"))
    example = importlib.import_module("gym_push_by_push")
    assert example.main("Single", "2") and "2 of 2 reached" in capsys.readouterr().out
