"""The estimator in the graph: it publishes intervals that hold, and bad poses do not move them."""

from dataclasses import replace

import numpy as np
import pytest

from push_bringup.systems import nodes_of
from push_estimation.push_estimates import Contradiction
from push_msgs.msg import Belief
from push_ros.claims import own_domain
from push_ros.qos import BELIEF
from push_scenario.scenario import load_scenario
from push_study import probing
from push_study.experiments.calibration import CalibrationTask, drawn_worlds, trial
from push_study.graph_run import LockstepRun

TASK = CalibrationTask("line", 3, "", "probing", way=0.6)


def test_it_is_part_of_a_system_of_one_robot_where_the_scenario_asks_for_it():
    scenario = load_scenario("short")
    plain = [n.kind for n in nodes_of("single", scenario)]
    asked = scenario.settings("estimator", enabled=True)
    assert [n.kind for n in nodes_of("single", asked)] == [*plain, "estimator"]
    assert [n.kind for n in nodes_of("one-robot", asked)][-1] == "estimator"
    teams = load_scenario("two-singles").settings("estimator", enabled=True)
    names = [n.name for n in nodes_of("single", teams) if n.kind == "estimator"]
    assert len(set(names)) == 2


@pytest.fixture(scope="module")
def pushed():
    """What was published during a probing push, the truth, and the estimates; then bad poses."""
    believed, world, drawn = drawn_worlds(TASK)
    with (
        own_domain(),
        LockstepRun(believed, world=world, quiet=True, system=probing.NAME) as run,
    ):
        (node,) = (n for n in run.nodes if n.get_name() == "estimator")
        said: list[Belief] = []
        run.observer.create_subscription(Belief, "/belief", said.append, BELIEF)
        run.start()
        run.reach(np.array([0.0, 0.0, 0.0]), 60.0)
        latency, _ = run.bridge.applied_latency
        learned = node.estimates.intervals()
        stamp, robot = 1e3 + run.bridge.time, np.zeros(3)
        for k in range(200):
            node.estimates.frame(stamp + 0.01 * k, robot, np.array([np.nan, 0.0, 0.0]))
        after = node.estimates.intervals()
        node.estimates.contradictions.append(Contradiction(stamp, ("com_x",), False, "before"))
        return said, drawn, latency, learned, after, node._state()


def test_what_it_publishes_holds_the_truth(pushed):
    said, drawn, latency, *_ = pushed
    assert 3 <= len(said) <= 16  # at most one a second
    assert {m.source for m in said} == {"estimator"}
    last = said[-1]
    truth = {
        "contact_friction": drawn["box_contact_friction"],
        "com_x": drawn["box_com_x_m"],
        "com_y": drawn["box_com_y_m"],
        "latency": latency,
    }
    columns = (last.bodies, last.quantities, last.values, last.lows, last.highs)
    found = {q: (b, v, low, high) for b, q, v, low, high in zip(*columns, strict=True)}
    assert set(found) == set(truth)
    for quantity, true in truth.items():
        body, value, low, high = found[quantity]
        assert body == ("" if quantity == "latency" else "box")
        assert low <= value <= high and low <= true <= high, quantity


def test_poses_that_are_not_finite_change_nothing(pushed):
    *_, before, after, _ = pushed
    assert before == after


def test_after_the_clock_was_set_back_no_warning_of_before_is_shown(pushed):
    assert "warning" not in pushed[-1]


@pytest.mark.long
@pytest.mark.parametrize("kind", ["ordinary", "probing"])
def test_intervals_hold_in_the_study(kind):
    """Three seeds in a row of the study ``calibration``: twelve intervals."""
    rows = [trial(replace(TASK, seed=seed, kind=kind, way=1.0)) for seed in (11, 12, 13)]
    held = [row[f"{q}_holds"] for row in rows for q in ("contact_friction", "com_x", "com_y")]
    held += [row["latency_holds"] for row in rows]
    assert sum(held) >= 11
    assert all(row["success"] for row in rows)
    assert np.median([row["latency_ratio"] for row in rows]) < 1 / 3
    if kind == "probing":
        assert np.median([row["contact_friction_ratio"] for row in rows]) < 1 / 3
