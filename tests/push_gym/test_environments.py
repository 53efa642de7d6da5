"""The environments as Gymnasium and PettingZoo want them."""

import math
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import parallel_api_test, parallel_seed_test

import push_gym
from push_gym import PlanarPushEnv, parallel_env
from push_model.settings import SettingsError

LEVELS = [(s, a) for s in ("Single", "Group", "Swarm") for a in ("wheels", "twist")]


def make(system, **values):
    return gymnasium.make(f"PlanarPush/{system}-v0", **values)


def vector(system, count, **values):
    name = f"PlanarPush/{system}-v0"
    mode = gymnasium.VectorizeMode.VECTOR_ENTRY_POINT
    return gymnasium.make_vec(name, num_envs=count, vectorization_mode=mode, **values)


@pytest.mark.parametrize(("system", "action"), LEVELS)
def test_gymnasium_finds_nothing_to_say(system, action):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(make(system, action=action, render_mode="rgb_array").unwrapped)


@pytest.mark.parametrize("system", ["group", "swarm", "single"])
def test_pettingzoo_finds_nothing_to_say(system):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        parallel_api_test(parallel_env(system, horizon=2.0), num_cycles=60)
        parallel_seed_test(lambda: parallel_env(system, horizon=2.0), num_cycles=30)


def test_observations_stay_in_their_space():
    """200 random episodes of all systems, robots at full speed into each other and the walls."""
    for system in ("Single", "Group", "Swarm"):
        env = vector(system, 64, horizon=5.0)
        env.reset(seed=3)
        env.action_space.seed(4)
        for _ in range(110):
            action = np.sign(env.action_space.sample()).astype(np.float32)
            seen, reward, *_ = env.step(action)
            for key, space in env.single_observation_space.items():
                assert (np.abs(seen[key]) <= space.high).all(), key
            assert np.isfinite(reward).all() and (reward <= 0.0).all()


@pytest.mark.parametrize(("system", "action"), LEVELS)
def test_many_rooms_are_many_single_ones(system, action):
    """Equal seeds, equal actions: equal episodes to the bit, resets included."""
    count, steps = 5, 45
    many = vector(system, count, action=action, horizon=2.0)
    alone = [make(system, action=action, horizon=2.0) for _ in range(count)]
    seen, _ = many.reset(seed=11)
    for i, env in enumerate(alone):
        one, _ = env.reset(seed=11 + i)
        assert all(np.array_equal(one[k], seen[k][i]) for k in one)
    many.action_space.seed(1)
    ended = [False] * count
    for _ in range(steps):
        told = many.action_space.sample()
        seen, reward, terminated, truncated, _ = many.step(told)
        for i, env in enumerate(alone):
            if ended[i]:
                one, _ = env.reset()
                answer = 0.0, False, False
            else:
                one, *rest, _ = env.step(told[i])
                answer = tuple(rest)
            assert all(np.array_equal(one[k], seen[k][i]) for k in one)
            assert (reward[i], terminated[i], truncated[i]) == answer
            ended[i] = bool(answer[1] or answer[2])
    assert not any(t < 0 for t in many.unwrapped.arena.times)


def test_a_reset_with_a_seed_is_the_same_whatever_was_before():
    env = make("Group")
    first, _ = env.reset(seed=5)
    for _ in range(20):
        env.step(env.action_space.sample())
    second, _ = env.reset(seed=5)
    assert all(np.array_equal(first[k], second[k]) for k in first)
    third, _ = env.reset(seed=6)
    assert not np.array_equal(first["observation"], third["observation"])


@pytest.mark.parametrize("reward", ["sparse", "dense"])
def test_rewards_can_be_computed_anew(reward):
    """As hindsight relabelling needs: of one goal and of many, equal to those of the steps."""
    env = make("Single", reward=reward).unwrapped
    seen, _ = env.reset(seed=1)
    achieved, rewards, desired = [], [], seen["desired_goal"]
    for k in range(50):
        seen, r, terminated, _, info = env.step(np.array([1.0, 0.3 * math.sin(k)]))
        achieved.append(seen["achieved_goal"])
        rewards.append(r)
        assert r == env.compute_reward(seen["achieved_goal"], desired, info)
        assert terminated == env.compute_terminated(seen["achieved_goal"], desired, info)
    many = env.compute_reward(np.array(achieved), np.tile(desired, (50, 1)), {})
    assert many.tolist() == rewards
    own = env.compute_reward(np.array(achieved), np.array(achieved), {})
    assert own == pytest.approx(0.0, abs=1e-6)
    assert env.compute_terminated(np.array(achieved), np.array(achieved), {}).all()
    assert not env.compute_truncated(np.array(achieved), np.array(achieved), {}).any()


def test_an_episode_ends_at_the_goal_and_is_cut_off_by_time():
    """Pushed straight on to a goal ahead: terminated. Standing: truncated when time is over."""
    env = make("Single", horizon=6.0, room=(3.0, 1.6))
    put = {"start": [0.0, 0.0, 0.0], "robots": [[-0.12, 0.0, 0.0]], "goal": [0.2, 0.0, 0.0]}
    env.reset(seed=1, options=put)
    for _ in range(60):
        seen, _, terminated, truncated, info = env.step(np.array([0.8, 0.0], dtype=np.float32))
        if terminated or truncated:
            break
    assert terminated and not truncated and info["is_success"]
    assert abs(seen["achieved_goal"][0] - 0.2) < 0.02 and info["time"] < 6.0
    env.reset(seed=1, options=put)
    steps = 0
    while True:
        steps += 1
        _, _, terminated, truncated, info = env.step(np.zeros(2, dtype=np.float32))
        if terminated or truncated:
            break
    assert truncated and not terminated and steps == 60 and not info["is_success"]


def test_wheels_and_twists_are_two_ways_to_say_the_same():
    put = {"start": [0.3, 0.0, 0.0], "robots": [[-0.3, 0.0, 0.4]], "goal": [0.6, 0.0, 0.0]}
    wheels, twist = (make("Single", action=a).unwrapped for a in ("wheels", "twist"))
    drive = wheels.arena.robot.differential
    for env in (wheels, twist):
        env.reset(seed=1, options=put)
    left, right = 0.5, 0.9
    v, omega = drive.twist(left * drive.max_wheel_speed, right * drive.max_wheel_speed)
    told = np.array([v / drive.max_speed, omega / drive.max_turn_rate])
    for _ in range(10):
        a, *_ = wheels.step(np.array([left, right]))
        b, *_ = twist.step(told)
    assert a["observation"] == pytest.approx(b["observation"], abs=1e-6)
    gone = a["observation"][:2] - [-0.3, 0.0]
    assert np.hypot(*gone) == pytest.approx(1.0 * v, rel=0.1)


def test_physics_and_shapes_come_with_the_options():
    """A heavier floor does not move what a light one does; another shape has another outline."""
    env = make("Single", room=(3.0, 1.6)).unwrapped
    put = {"start": [0.0, 0.0, 0.0], "robots": [[-0.12, 0.0, 0.0]], "goal": [1.0, 0.0, 0.0]}
    ends = []
    for change in ({"floor_friction": 0.2}, {"mass": 20.0, "floor_friction": 1.5}):
        env.reset(seed=1, options=put | {"object": change})
        for _ in range(30):
            seen, *_ = env.step(np.array([0.8, 0.0]))
        ends.append(float(seen["achieved_goal"][0]))
    assert ends[0] > 0.15 and abs(ends[1]) < 0.02
    shape = {"ellipse": {"semi_axis_x": 0.1, "semi_axis_y": 0.05}}
    env.reset(seed=1, options={"object": {"shape": shape}})
    assert env.arena.item.outline[:, 0].max() == pytest.approx(0.1, rel=1e-3)
    env.reset(seed=1, options={"object": "plate_hexagon"})
    assert len(env.arena.item.outline) == 6
    env.reset(seed=2)
    assert len(env.arena.item.outline) == 6, "an object stays until another one is asked for"


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"robots": 0}, "robots"),
        ({"robots": 2.5}, "robots"),
        ({"object": "no_such"}, "no_such"),
        ({"robot": "pioneer", "object": "pioneer_box", "room": (6.0, 6.0)}, "torque"),
        ({"robot": "disc", "action": "wheels"}, "wheels"),
        ({"action": "fly"}, "action"),
        ({"period": math.nan}, "period"),
        ({"speed": 1.0}, "unknown setting 'speed'"),
        ({"method": {"nonsense": 1}}, "method: the level 'twist' uses none"),
        ({"method": {}, "action": "wheels"}, "method: the level 'wheels' uses none"),
        ({"action": "push", "period": 0.5}, "period: an action of the level 'push'"),
        ({"room": (0.2, 0.2)}, "room"),
        ({"room": "no_such"}, "no_such"),
    ],
)
def test_wrong_settings_are_named(values, told):
    with pytest.raises(SettingsError, match=told):
        PlanarPushEnv("group", **values).reset(seed=1)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"robot": [0, 0, 0]}, "unknown key 'robot'"),
        ({"start": [0.0, 0.0]}, "start"),
        ({"goal": [0.0, math.nan, 0.0]}, "goal"),
        ({"robots": [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]}, "robots"),
        ({"object": {"colour": "red"}}, "colour"),
        ({"object": {"mass": -1.0}}, "mass"),
        ({"start": ["a", 0.0, 0.0]}, "start"),
        ({"robots": [[0.0], [1.0, 2.0]]}, "robots"),
        ({"start": [0.98, 0.0, 0.0]}, "start: the object would touch a wall"),
        ({"goal": [0.0, 5.0, 0.0]}, "goal: the object would touch a wall"),
        (
            {"start": [0.0, 0.0, 0.0], "robots": [[0.01, 0.0, 0.0]]},
            "robot 0 would be in the object",
        ),
        ({"robots": [[0.99, 0.0, 0.0]], "start": [0.0, 0.0, 0.0]}, "robot 0 would touch a wall"),
    ],
)
def test_wrong_options_are_named(options, told):
    with pytest.raises(SettingsError, match=told):
        make("Single").reset(seed=1, options=options)


REFUSED = [
    {"object": "plate_square", "start": [9.0, 9.0, 0.0]},
    {"object": "plate_square", "goal": [9.0, 9.0, 0.0]},
    {"object": "plate_square", "start": ["a", 0.0, 0.0]},
    {"goal": [9.0, 9.0, 0.0]},
    {"start": [0.0, 0.0, 0.0], "robots": [[0.01, 0.0, 0.0]]},
    {"object": {"shape": {"rectangle": {"width": 3.0, "height": 3.0}}}},
]


def state(arena):
    world = arena.world
    return [arena.item, world, *(a.tolist() for a in (world.poses, arena.goals, arena.times))]


@pytest.mark.parametrize("options", REFUSED)
@pytest.mark.parametrize("kind", ["one", "vector", "agents"])
def test_a_refused_reset_changes_nothing(options, kind):
    if kind == "agents":
        env = parallel_env("single")
    else:
        env = make("Single").unwrapped if kind == "one" else vector("Single", 3).unwrapped
    env.reset(seed=1)
    before = state(env.arena)
    with pytest.raises(SettingsError):
        env.reset(seed=2, options=options)
    assert state(env.arena) == before
    if kind == "agents":
        env.step({"robot_0": np.array([0.1, 0.0])})
    else:
        env.step(np.zeros(env.action_space.shape))
    seen, _ = env.reset(seed=1)
    fresh, _ = type(env)(*([3] if kind == "vector" else []), "single").reset(seed=1)
    for key, value in seen.items():
        assert np.array_equal(value, fresh[key]), key


def test_a_refused_reset_does_not_revive_episodes_that_have_ended():
    agents, rooms = parallel_env("single", horizon=0.1), vector("Single", 2, horizon=0.1).unwrapped
    agents.reset(seed=1)
    rooms.reset(seed=1)
    agents.step({"robot_0": np.zeros(2)})
    *_, cut, _ = rooms.step(np.zeros((2, 2)))
    assert agents.agents == [] and cut.all()
    for env in (agents, rooms):
        with pytest.raises(SettingsError):
            env.reset(options={"goal": [9.0, 9.0, 0.0]})
    assert agents.agents == []
    _, _, _, cut, info = rooms.step(np.zeros((2, 2)))
    assert not cut.any() and (info["time"] == 0.0).all()  # they begin anew


def test_draws_leave_room_between_all_bodies():
    """300 resets: nothing overlaps, the object has room for a robot on every side."""
    env = vector("Swarm", 300)
    env.reset(seed=9)
    arena = env.unwrapped.arena
    poses, radius = arena.world.poses, arena.robot.footprint_radius
    before = poses.copy()
    half = 0.5 * np.array(arena.environment.size)
    reach = np.hypot(*arena.item.outline.T).max()
    assert (np.abs(poses[:, -1, :2]) < half - reach - 2.0 * radius).all()
    robots = poses[:, :-1, :2]
    apart = np.hypot(*(robots[:, :, None] - robots[:, None]).transpose(3, 0, 1, 2))
    apart += 10.0 * np.eye(robots.shape[1])
    assert apart.min() > 2.0 * radius
    env.step(np.zeros(env.action_space.shape, dtype=np.float32))
    assert np.abs(arena.world.poses - before).max() < 1e-9, "bodies that overlap would be parted"
    assert np.abs(arena.goals[:, 2]).max() > 3.0


def test_all_names_are_registered():
    assert set(push_gym.ENVIRONMENTS) <= set(gymnasium.registry)
    push_gym.register_all()  # again: nothing happens
    env = make("Single", render_mode="rgb_array")
    env.reset(seed=1)
    image = env.render()
    assert image.shape == (384, 480, 3) and len(np.unique(image.reshape(-1, 3), axis=0)) > 4


def test_robots_may_touch_the_object_but_not_overlap_each_other():
    touching = {"start": [0.0, 0.0, 0.0], "robots": [[-0.0951, 0.0, 0.0]]}
    make("Single").reset(seed=1, options=touching)
    stacked = {"start": [0.7, 0.0, 0.0], "robots": [[-0.5, 0, 0], [-0.45, 0, 0], [-0.5, 0.4, 0]]}
    with pytest.raises(SettingsError, match="robot 1 would be in another one"):
        make("Group").reset(seed=1, options=stacked)
    with pytest.raises(SettingsError, match="expected a mapping"):
        make("Single").unwrapped.reset(options=["start"])


def test_fields_of_an_object_replace_those_of_the_present_one():
    env = make("Single").unwrapped
    env.reset(seed=1, options={"object": "plate_ellipse"})
    before = env.arena.item
    env.reset(seed=1, options={"object": {"floor_friction": 0.45}})
    assert env.arena.item.floor_friction == 0.45 and env.arena.item.mass == before.mass
    assert np.array_equal(env.arena.item.outline, before.outline)


@pytest.mark.parametrize("action", [[0.1, 0.2, 0.3], [0.1], 0.5, [math.nan, 0.0]])
def test_actions_of_another_size_are_refused(action):
    env = make("Single").unwrapped
    env.reset(seed=1)
    with pytest.raises(ValueError, match="action: expected"):
        env.step(np.array(action))
    many = vector("Single", 3)
    many.reset(seed=1)
    with pytest.raises(ValueError, match="action: expected 6 numbers"):
        many.unwrapped.step(np.zeros((3, 1)))


def test_what_many_rooms_and_many_agents_refuse():
    with pytest.raises(SettingsError, match="num_envs"):
        push_gym.PlanarPushVectorEnv(0)
    with pytest.raises(SettingsError, match="render_mode"):
        push_gym.PlanarPushVectorEnv(2, render_mode="rgb_array")
    many = vector("Single", 3)
    with pytest.raises(ValueError, match="seed: expected one for each of 3 rooms"):
        many.unwrapped.reset(seed=[1, 2])
    first, _ = many.reset(seed=np.int64(4))
    second, _ = many.reset(seed=[4, 5, 6])
    assert np.array_equal(first["observation"], second["observation"])
    agents = parallel_env("group")
    agents.reset(seed=1)
    with pytest.raises(ValueError, match="no agent called 'robot0'"):
        agents.step({"robot0": np.zeros(2)})
    with pytest.raises(ValueError, match="action: expected 2 numbers"):
        agents.step({"robot_0": np.zeros(3)})
    with pytest.raises(SettingsError, match="unknown key 'strat'"):
        agents.reset(options={"strat": 1})
