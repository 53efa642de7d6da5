"""What is drawn for the world of a trial, and what nobody is told."""

from dataclasses import replace

import numpy as np
import pytest

from push_model.settings import SettingsError
from push_scenario.bodies import load_object
from push_scenario.scenario import load_scenario
from push_study.uncertainty import UNCERTAINTIES, uncertainty


def drawn(level, name="short", seeds=range(200)):
    scenario = load_scenario(name)
    return [uncertainty(level).draw(scenario, seed) for seed in seeds]


def test_hard_draws_fill_their_ranges_and_nobody_believes_them():
    rows = drawn("hard")
    mu = np.array([r["box_contact_friction"] for _, _, r in rows])
    com = np.array([[r["box_com_x_m"], r["box_com_y_m"]] for _, _, r in rows])
    latency = np.array([r["latency_s"] for _, _, r in rows])
    assert 0.1 <= mu.min() < 0.12 and 0.38 < mu.max() <= 0.4
    away = np.hypot(*com.T)
    assert away.max() <= 0.01 and away.max() > 0.0095 and abs(com.mean()) < 0.001
    assert 0.02 <= latency.min() < 0.023 and 0.057 < latency.max() <= 0.06
    for believed, world, row in rows[:20]:
        item, real = believed.object()[1], world.object()[1]
        assert item == load_scenario("short").object()[1]
        assert real.contact_friction == row["box_contact_friction"]
        assert real.com == (row["box_com_x_m"], row["box_com_y_m"]) and item.com == (0.0, 0.0)
        controller, bridge = (believed.parameters[n] for n in ("controller", "bridge"))
        assert controller["tracker"]["pose_delay"] == 0.04
        capture = bridge["motion_capture"]
        assert capture["latency"] == row["latency_s"] and capture["rate"] == 60.0
        assert capture["position_noise"] == 1e-3
        assert capture["orientation_noise"] == pytest.approx(0.5 * np.pi / 180)


def test_unknown_draws_the_outline_too_and_only_the_estimator_may_find_it_out():
    rows = drawn("unknown")
    out = np.array([r["box_outline_m"] for _, _, r in rows])
    mu = np.array([r["box_contact_friction"] for _, _, r in rows])
    assert -0.005 <= out.min() < -0.0047 and 0.0047 < out.max() <= 0.005
    assert 0.08 <= mu.min() < 0.09 and 0.48 < mu.max() <= 0.5
    for believed, world, row in rows[:20]:
        assert believed.object()[1] == load_scenario("short").object()[1]
        real = world.object()[1].outline
        assert np.abs(real).max() == pytest.approx(0.045 + row["box_outline_m"], abs=1e-6)
        assert believed.parameters["estimator"]["enabled"] is True
        assert believed.parameters["bridge"]["motion_capture"]["dropout"] == 0.01


def test_shape_differs_from_mild_in_outline_and_centre_of_mass_alone():
    rows = drawn("shape")
    out = np.array([r["box_outline_m"] for _, _, r in rows])
    away = np.array([np.hypot(r["box_com_x_m"], r["box_com_y_m"]) for _, _, r in rows])
    assert -0.005 <= out.min() < -0.0047 and 0.0047 < out.max() <= 0.005
    assert away.max() <= 0.015 and away.max() > 0.0145
    mild, shape = uncertainty("mild"), uncertainty("shape")
    assert replace(shape, com=0.0, outline=0.0, own_draws=False) == mild


@pytest.mark.parametrize("name", ["transport_l", "plate_triangle", "swarm_rectangle"])
def test_every_side_lies_as_far_out_as_was_drawn_in_the_frame_that_motion_capture_sees(name):
    item = load_object(name)
    for seed in range(50):
        row = {}
        level = uncertainty("unknown")
        real = level.draw_item("box", item, np.random.default_rng(seed), row)
        edges = np.roll(item.outline, -1, axis=0) - item.outline
        outward = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.hypot(*edges.T)[:, None]
        moved = ((real.outline - item.outline) * outward).sum(axis=1)
        assert moved == pytest.approx(row["box_outline_m"], abs=1e-9)


def test_own_draws_for_each_scenario_only_where_they_are_hard():
    def friction(level, name):
        return drawn(level, name, [3])[0][2]["box_contact_friction"]

    assert friction("hard", "env1-target1") != friction("hard", "env1-target2")
    assert friction("mild", "env1-target1") == friction("mild", "env1-target2")


def test_mild_keeps_friction_within_a_fifth_and_tells_the_latency():
    for believed, world, row in drawn("mild"):
        factor = row["box_contact_friction"] / believed.object()[1].contact_friction
        assert 0.8 <= factor <= 1.2 and world.object()[1].com == (0.0, 0.0)
        assert believed.parameters["controller"]["tracker"]["pose_delay"] == 0.01
        assert "latency_s" not in row


def test_none_is_what_is_believed():
    ((believed, world, row),) = drawn("none", seeds=[5])
    assert world.object()[1] == believed.object()[1] and world.robot()[1] == believed.robot()[1]
    assert row["box_contact_friction"] == believed.object()[1].contact_friction


def test_of_a_robot_without_wheels_the_rest_is_drawn():
    believed, world, _ = replace(UNCERTAINTIES["mild"]).draw(load_scenario("discs1000"), 1)
    drive, other = world.robot()[1].drive, believed.robot()[1].drive
    assert drive.max_force != other.max_force and replace(drive, max_force=1.0) == replace(
        other, max_force=1.0
    )
    assert world.object()[1].contact_friction != believed.object()[1].contact_friction


@pytest.mark.parametrize(
    ("level", "low", "high"), [("none", 1.0, 1.0), ("mild", 0.8, 1.2), ("hard", 0.2, 1.0)]
)
def test_friction_between_robots_is_drawn_once_for_all_of_them(level, low, high):
    found = []
    for believed, world, row in drawn(level, "group-ellipse", range(100)):
        values = {robot.robot_friction for robot, _ in world.robots.values()}
        assert values == {row["robot_friction"]} and len(world.robots) > 1
        assert {robot.robot_friction for robot, _ in believed.robots.values()} == {1.0}
        found.append(row["robot_friction"])
    assert low <= min(found) <= low + 0.03 and high - 0.03 <= max(found) <= high
    assert "robot_friction" not in drawn(level, "short", [1])[0][2]  # one robot has none


def test_hard_poses_have_jitter_and_mild_ones_have_not():
    for level, jitter in (("none", 0.0), ("mild", 0.0), ("hard", 0.005)):
        ((_, world, _),) = drawn(level, seeds=[1])
        believed = drawn(level, seeds=[1])[0][0]
        assert believed.parameters["bridge"]["motion_capture"]["latency_jitter"] == jitter
        assert world.parameters == believed.parameters


def test_an_unknown_name_is_refused():
    with pytest.raises(SettingsError, match="none, mild, contest, hard"):
        uncertainty("much")


def test_a_row_of_a_crowd_has_the_extremes_and_not_a_column_for_each_robot():
    believed = load_scenario("swarm-square")
    ((robot, _), *_) = believed.robots.values()
    crowd = {f"e{i}": (robot, np.array([0.3 * i, 9.0, 0.0])) for i in range(50)}
    _, world, drawn = uncertainty("mild").draw(replace(believed, robots=crowd), 3)
    grips = [r.drive.wheel_friction for r, _ in world.robots.values()]
    assert drawn["robots_least_wheel_friction"] == min(grips)
    assert drawn["robots_greatest_wheel_friction"] == max(grips)
    assert not any(key.startswith("e1") for key in drawn)
    few = dict(list(crowd.items())[:20])
    _, world, drawn = uncertainty("mild").draw(replace(believed, robots=few), 3)
    assert drawn["e7_wheel_friction"] == world.robots["e7"][0].drive.wheel_friction
