from dataclasses import fields, replace

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from push_model import SettingsError
from push_scenario.events import Displace, DropPoses, Kill, Place, Remove
from push_scenario.scenario import (
    Scenario,
    load_scenario,
    scenario_from_mapping,
    scenario_from_text,
)
from push_scenario.teams import TimedPose

BASE = {
    "environment": "open",
    "robots": {
        "a": {"type": "epuck", "start": [-1, 0.5, 0]},
        "d": {
            "type": "disc",
            "count": 3,
            "placement": {"grid": {"corner": [0, 0], "spacing": 0.2}},
        },
    },
    "objects": {
        "x": {"type": "box9", "start": [-0.5, 0.5, 0]},
        "y": {"type": "swarm_square", "start": [0.5, -0.5, 0]},
    },
}


def made(**keys):
    return scenario_from_mapping({**BASE, **keys}, "s", "s.yaml")


def test_without_teams_all_robots_are_one():
    team = made(goal=[1, 0.5, 0]).team()
    assert (team.name, team.robots, team.object) == ("", ("a", "d1", "d2", "d3"), "x")
    assert team.goal == pytest.approx([1, 0.5, 0]) and len(team.aims) == 1
    assert made().team().goal is None and made().goal is None
    several = made(goals=[[1, 0, 0], [0, 0.5, 1]])
    assert len(several.team().aims) == 2 and several.goal == pytest.approx([1, 0, 0])
    with pytest.raises(SettingsError, match="no teams"):
        made().team("left")


def test_teams_have_robots_groups_objects_and_aims():
    poses = [{"at": 0, "pose": [0.5, -0.5, 0]}, {"at": 2.5, "pose": [0.9, -0.5, 0.1]}]
    scenario = made(
        teams={
            "single": {"robots": ["a"], "object": "x", "goal": [1, 0.5, 0]},
            "swarm": {"robots": ["d"], "object": "y", "trajectory": poses},
        }
    )
    assert scenario.team().name == "single" and scenario.goal == pytest.approx([1, 0.5, 0])
    swarm = scenario.team("swarm")
    assert swarm.robots == ("d1", "d2", "d3") and swarm.goal is None
    assert swarm.trajectory[1] == TimedPose(2.5, (0.9, -0.5, 0.1))
    assert swarm.aims[1] == pytest.approx([0.9, -0.5, 0.1])
    with pytest.raises(
        SettingsError, match="unknown team 'third'; the scenario has: single, swarm"
    ):
        scenario.team("third")


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"teams": {"t": {"robots": ["z"], "object": "x"}}}, ["teams.t.robots[0]", "'z'", "a, d"]),
        ({"teams": {"t": {"robots": [], "object": "x"}}}, ["teams.t.robots", "at least one"]),
        ({"teams": {"t": {"robots": ["a"]}}}, ["teams.t.object", "x, y"]),
        ({"teams": {"t": {"robots": ["a"], "object": "z"}}}, ["teams.t.object", "'z'"]),
        ({"teams": {"t": {"robots": ["d", "d2"], "object": "x"}}}, ["'d2'", "twice"]),
        (
            {
                "teams": {
                    "t": {"robots": ["a"], "object": "x"},
                    "u": {"robots": ["d"], "object": "x"},
                }
            },
            ["teams.u", "'x' belongs to team 't'"],
        ),
        (
            {"teams": {"t": {"robots": ["a"], "object": "x"}}, "goal": [0, 0, 0]},
            ["goals belong to the teams"],
        ),
        ({"trajectory": [{"at": 0, "pose": [0, 0, 0]}]}, ["at least two"]),
        (
            {"trajectory": [{"at": t, "pose": [0, 0, 0]} for t in (0, 2, 2)]},
            ["trajectory[2].at: 2.0 must come after 2.0"],
        ),
        (
            {"events": [{"kind": "kill", "at": 1, "robot": "x"}]},
            ["events[0].robot", "'x'", "a, d1"],
        ),
        (
            {"events": [{"kind": "displace", "at": 1, "body": "q", "by": [0, 0, 0]}]},
            ["events[0].body", "'q'"],
        ),
        (
            {"events": [{"kind": "drop_poses", "at": 1, "bodies": ["a", "q"], "duration": 1}]},
            ["events[0].bodies", "'q'"],
        ),
        ({"events": [{"kind": "kill", "at": -1, "robot": "a"}]}, ["events[0].at: -1", "[0.0"]),
        ({"events": [{"kind": "kill", "robot": "a"}]}, ["events[0]", "missing key 'at'"]),
    ],
)
def test_wrong_teams_and_events_name_the_place(keys, words):
    with pytest.raises(SettingsError) as error:
        made(**keys)
    for word in words:
        assert word in str(error.value)


def test_events_come_in_the_order_of_time():
    scenario = made(
        events=[
            {"kind": "remove", "at": 9, "robot": "d3"},
            {"kind": "displace", "at": 2, "body": "x", "by": [0.05, 0, 0.1]},
            {"kind": "place", "at": 3.5, "body": "y", "pose": [1, 0, 0]},
            {"kind": "drop_poses", "at": 2, "bodies": ["x", "a"], "duration": 0.5},
            {"kind": "kill", "at": 4, "robot": "a"},
        ]
    )
    assert scenario.events == (
        Displace(2.0, "x", (0.05, 0.0, 0.1)),
        DropPoses(2.0, ("x", "a"), 0.5),
        Place(3.5, "y", (1.0, 0.0, 0.0)),
        Kill(4.0, "a"),
        Remove(9.0, "d3"),
    )


def same(first, second):
    """Whether two scenarios are equal to the bit."""
    for f in fields(Scenario):
        a, b = getattr(first, f.name), getattr(second, f.name)
        if f.name in ("robots", "objects"):
            if list(a) != list(b):
                return False
            if not all(a[n][0] == b[n][0] and np.array_equal(a[n][1], b[n][1]) for n in a):
                return False
        elif f.name == "goals":
            if not (len(a) == len(b) and all(map(np.array_equal, a, b))):
                return False
        elif f.name == "teams":
            plain = [[replace(t, goals=()) for t in s.values()] for s in (a, b)]
            if plain[0] != plain[1]:
                return False
            if not all(
                map(np.array_equal, (t.goals for t in a.values()), (t.goals for t in b.values()))
            ):
                return False
        elif a != b:
            return False
    return True


coordinate = st.floats(-0.45, 0.45).map(lambda v: round(v, 6)) | st.floats(-0.45, 0.45)
pose = st.tuples(coordinate, coordinate, st.floats(-4, 4)).map(list)
events = st.lists(
    st.fixed_dictionaries(
        {
            "kind": st.just("displace"),
            "at": st.floats(0, 100),
            "body": st.sampled_from("xyab"),
            "by": pose,
        }
    )
    | st.fixed_dictionaries(
        {"kind": st.just("kill"), "at": st.integers(0, 9), "robot": st.just("a")}
    )
    | st.fixed_dictionaries(
        {
            "kind": st.just("drop_poses"),
            "at": st.floats(0, 9),
            "bodies": st.lists(st.sampled_from("xya"), max_size=3),
            "duration": st.floats(0, 9),
        }
    ),
    max_size=4,
)
aims = st.one_of(
    st.just({}),
    st.fixed_dictionaries({"goal": pose}),
    st.fixed_dictionaries({"goals": st.lists(pose, min_size=1, max_size=3)}),
    st.lists(pose, min_size=2, max_size=4).map(
        lambda p: {"trajectory": [{"at": 0.5 * i, "pose": q} for i, q in enumerate(p)]}
    ),
)


@settings(max_examples=60)
@given(
    st.data(),
    st.booleans(),
    events,
    st.integers(1, 12),
    st.floats(0.01, 5.0),
    st.dictionaries(
        st.sampled_from(("bridge", "planner", "swarm", "package.module:METHOD")),
        st.dictionaries(
            st.text("abc_", min_size=1, max_size=4),
            st.none()
            | st.booleans()
            | st.integers()
            | st.floats(allow_nan=False)
            | st.text(max_size=4),
            max_size=3,
        ),
        max_size=2,
    ),
)
def test_a_scenario_is_what_its_text_says(data, teams, events, count, mass, parameters):
    values = {
        "environment": {"size": [4, 3], "circles": [{"centre": [1.5, 1], "radius": 0.1}]},
        "robots": {
            "a": {"type": "epuck", "start": [-1, 1, data.draw(st.floats(-4, 4))], "mass": 0.5},
            "b": {"type": "pioneer", "start": [1, -1, 0]},
            "d": {
                "type": "disc",
                "count": count,
                "placement": {
                    "random": {"seed": data.draw(st.integers(0, 99)), "area": [-2, -1, -1, 1]}
                },
            },
        },
        "objects": {
            "x": {"type": "box9", "start": [0, 0, 0], "mass": mass, "com": [0.01, -0.02]},
            "y": {"type": "swarm_flower", "start": [0.8, 0.2, 1.0]},
        },
        "events": events,
        "parameters": parameters,
    }
    if teams:
        values["teams"] = {
            "first": {"robots": ["a", "b"], "object": "x", **data.draw(aims)},
            "second": {"robots": ["d"], "object": "y", **data.draw(aims)},
        }
    else:
        values.update(data.draw(aims))
    scenario = scenario_from_mapping(values, "s", "s.yaml")
    again = scenario_from_text(scenario.text, "s", "bag")
    assert same(again, scenario) and again.text == scenario.text


def test_a_value_has_no_settings():
    scenario = load_scenario("short").settings("group", steps=40)
    with pytest.raises(SettingsError, match=r"group\.steps\.speed: 'steps' has the value 40"):
        scenario.settings("group", steps__speed=0.1)


def test_defaults_of_nodes_are_filled_in_where_the_scenario_is_silent():
    scenario = load_scenario("short").settings("controller", mpc__horizon=12, mpc__new=1)
    nodes = {
        "controller": {"mpc": {"horizon": 20, "step": 0.1}, "on": True},
        "planner": {"seed": 1},
    }
    full = scenario.with_defaults(nodes)
    assert full.parameters == {
        "planner": {"seed": 1},
        "controller": {"mpc": {"horizon": 12, "new": 1, "step": 0.1}, "on": True},
    }
    assert scenario.parameters == {"controller": {"mpc": {"horizon": 12, "new": 1}}}
    assert yaml.safe_load(full.text)["parameters"] == full.parameters
