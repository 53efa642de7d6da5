import math
from itertools import combinations

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from push_model import SettingsError
from push_scenario.scenario import scenario_from_mapping


def swarm(count, placement, type_="disc", size=(4.0, 4.0), **keys):
    group = {"type": type_, "count": count, "placement": placement}
    values = {"environment": {"size": list(size)}, "robots": {"disc": group}, **keys}
    return scenario_from_mapping(values, "s", "s.yaml")


def positions(scenario):
    return np.array([start for _, start in scenario.robots.values()])


def test_a_grid_goes_row_by_row():
    s = swarm(5, {"grid": {"corner": [-1, -0.5], "spacing": 0.2, "columns": 3, "heading": 0.5}})
    assert list(s.robots) == ["disc1", "disc2", "disc3", "disc4", "disc5"]
    expected = [[-1, -0.5], [-0.8, -0.5], [-0.6, -0.5], [-1, -0.3], [-0.8, -0.3]]
    assert positions(s) == pytest.approx(np.column_stack([expected, np.full(5, 0.5)]))
    assert np.ptp(positions(swarm(9, {"grid": {"corner": [0, 0], "spacing": 0.2}}))[:, 1]) == (
        pytest.approx(0.4)
    )


@pytest.mark.parametrize(
    ("facing", "turn"), [("inward", math.pi), ("outward", 0), ("along", 1.571)]
)
def test_a_ring_goes_round(facing, turn):
    s = swarm(8, {"kind": "ring", "centre": [0.5, 0.2], "radius": 0.7, "facing": facing})
    x, y, theta = positions(s).T
    assert np.hypot(x - 0.5, y - 0.2) == pytest.approx(np.full(8, 0.7))
    out = np.arctan2(y - 0.2, x - 0.5)
    assert np.cos(theta - out - turn) == pytest.approx(np.ones(8), abs=1e-6)
    assert np.diff(np.unwrap(out)) == pytest.approx(np.full(7, math.pi / 4))


@settings(max_examples=40)
@given(st.integers(1, 60), st.integers(0, 2**40), st.floats(0.0, 0.1), st.booleans())
def test_random_places_are_free_apart_and_repeatable(count, seed, gap, flat):
    """Robots with either bumper, beside an object and an obstacle, in an area or anywhere."""
    room = {"size": [6, 4], "boxes": [{"centre": [1, 1], "size": [1, 0.5], "yaw": 0.4}]}
    values = {
        "environment": room,
        "robots": {
            "r": {
                "type": "epuck" if flat else "disc",
                "count": count,
                "placement": {"random": {"seed": seed, "gap": gap, "area": [-1, 3, -2, 2]}},
            }
        },
        "objects": {"o": {"type": "swarm_square", "start": [0, 0, 0.3]}},
    }
    scenario = scenario_from_mapping(values, "s", "s.yaml")  # checks that nothing overlaps
    at = positions(scenario)
    radius = scenario.robot()[1].footprint_radius
    assert (at[:, 0] >= -1).all() and (np.abs(at[:, 1]) <= 2 - radius - gap).all()
    for a, b in combinations(at[:, :2], 2):
        assert np.hypot(*(a - b)) >= 2 * radius + gap
    again = scenario_from_mapping(values, "s", "s.yaml")
    assert np.array_equal(positions(again), at)
    values["robots"]["r"]["placement"]["random"]["seed"] = seed + 1
    assert not np.array_equal(positions(scenario_from_mapping(values, "s", "s.yaml")), at)


def test_groups_keep_clear_of_each_other_and_of_single_bodies():
    random = {"kind": "random", "seed": 3}
    values = {
        "environment": {"size": [2, 2]},
        "robots": {
            "a": {"type": "disc", "count": 15, "placement": random},
            "b": {"type": "epuck", "start": [0.5, 0.5, 0]},
            "c": {"type": "epuck_ring", "count": 15, "placement": random},
        },
        "objects": {"o": {"type": "box9", "count": 5, "placement": random}},
    }
    scenario = scenario_from_mapping(values, "s", "s.yaml")
    assert list(scenario.robots)[14:17] == ["a15", "b", "c1"] and len(scenario.robots) == 31
    assert list(scenario.objects) == ["o1", "o2", "o3", "o4", "o5"]


@pytest.mark.parametrize(
    ("count", "placement", "words"),
    [
        (500, {"random": {}}, ["robots.disc.placement: no room found for number", "of 500"]),
        (
            9,
            {"grid": {"corner": [0, 0], "spacing": 0.05}},
            ["robot 'disc1' starts in robot 'disc2'"],
        ),
        (9, {"grid": {"corner": [0, 0], "spacing": 5}}, ["robot 'disc2' starts outside"]),
        (2, {"spiral": {}}, ["robots.disc.placement: expected one key of grid, ring, random"]),
        (2, {"ring": {"radius": 1}}, ["robots.disc.placement.ring: missing key 'centre'"]),
        (0, {"random": {}}, ["robots.disc.count: 0", "[1, "]),
        (2, {"random": {"area": [1, 0, 0, 1]}}, ["placement", "area", "x_min < x_max"]),
    ],
)
def test_impossible_placements_say_why(count, placement, words):
    with pytest.raises(SettingsError) as error:
        swarm(count, placement, size=(2.0, 2.0))
    for word in words:
        assert word in str(error.value)


def test_names_of_a_group_must_be_free():
    group = {"type": "disc", "count": 2, "placement": {"random": {}}}
    values = {
        "environment": "open",
        "robots": {"d": group, "d2": {"type": "disc", "start": [0, 0, 0]}},
    }
    with pytest.raises(SettingsError, match=r"\['d2'\] are named twice"):
        scenario_from_mapping(values, "s", "s")
    values = {**values, "robots": {"d": group}, "objects": {"d1": {"type": "box9"}}}
    values["objects"]["d1"]["start"] = [1, 0.8, 0]
    with pytest.raises(SettingsError, match=r"\['d1'\] name both"):
        scenario_from_mapping(values, "s", "s")


def test_the_text_of_a_thousand_discs_is_short_and_reads_back():
    """Their type is written once; poses are the same to the bit."""
    s = swarm(1000, {"random": {"seed": 5}}, size=(12.0, 12.0), objects={})
    assert s.text.count("max_turn_rate") == 1 and len(s.text) < 120_000
    again = scenario_from_mapping(yaml.safe_load(s.text), "s", "bag")
    assert np.array_equal(positions(again), positions(s)) and again.text == s.text
