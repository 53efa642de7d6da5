"""Objects whose centre of mass is off the middle, concave ones, and robots that cannot push."""

from dataclasses import replace

import numpy as np
import pytest

from push_model import SettingsError, se2
from push_model.belief import Interval
from push_model.occupancy import rasterise
from push_model.outlines import distance
from push_model.pushable_sides import pushable_sides
from push_model.settings import from_mapping
from push_model.specs import BoxSpec, EnvironmentSpec, ObjectSpec
from push_model.stick_certificate import ContactBelief, certified_limits
from push_planner import PlanError, PlannerSettings, PlanningFailed, PushPlanner, push_sides
from push_scenario.scenario import load_scenario

QUICK = replace(PlannerSettings(), improvement_rounds=2, arc_nodes=2000)
GRID = rasterise(EnvironmentSpec((3.0, 2.0)))
START, GOAL = np.array([-0.8, -0.3, 0.4]), np.array([0.7, 0.3, 1.2])
BOX = [[0.0, 0.0], [0.09, 0.0], [0.09, 0.09], [0.0, 0.09]]
L = [[0, 0], [0.12, 0], [0.12, 0.05], [0.05, 0.05], [0.05, 0.12], [0, 0.12]]
U = [[0, 0], [0.12, 0], [0.12, 0.1], [0.08, 0.1], [0.08, 0.05], [0.04, 0.05], [0.04, 0.1], [0, 0.1]]
NICHE = [[0, 0], [0.24, 0], [0.24, 0.1], [0.18, 0.1], [0.18, 0.04], [0.06, 0.04], [0.06, 0.1]]
NICHE = [*NICHE, [0, 0.1]]


def item_of(vertices, com=(0.0, 0.0)):
    values = {
        "shape": {"polygon": {"vertices": vertices}},
        "mass": 0.05,
        "height": 0.06,
        "floor_friction": 0.3,
        "contact_friction": 0.2,
        "com": list(com),
    }
    return from_mapping(ObjectSpec, values, "")


@pytest.mark.parametrize("com", [(0.01, 0.0), (-0.006, 0.008), (0.0, -0.01)])
def test_a_plan_for_an_object_with_its_mass_off_the_middle_is_one_of_its_outline(robot, com):
    item = item_of(BOX, com)
    plan = PushPlanner(QUICK, GRID, robot, item).solve(START, GOAL)
    assert plan.segments[0].object_start == pytest.approx(START)
    assert plan.segments[-1].object_end == pytest.approx(GOAL)
    assert plan.goal == pytest.approx(GOAL)
    nominal = {s.index: s.nominal for s in push_sides(robot, item, 1.0)}
    ahead = {s.index: s.distance for s in item.geometry.sides}
    d, half = robot.push_distance, robot.flat_bumper.width / 2.0
    face = np.array([[d, -half], [d, 0.0], [d, half]])
    for before, after in zip(plan.segments, plan.segments[1:], strict=False):
        assert before.object_end == pytest.approx(after.object_start)
    for segment in plan.segments:
        for machine, body in (
            (segment.robot_start, segment.object_start),
            (segment.robot_end, segment.object_end),
        ):
            outline = se2.transform(body, item.outline)
            assert distance(outline, se2.transform(machine, face)).max() < 1e-9
            assert se2.between(machine, body) == pytest.approx(segment.grasp, abs=1e-9)
        # limits about the centre of mass: the bumper lies behind it, so far away
        assert segment.limits == nominal[segment.side]
        tightest = item.contact_friction / (ahead[segment.side] + d)
        assert segment.limits.maximum == pytest.approx(tightest, rel=1e-6)
        assert segment.limits.minimum == pytest.approx(-tightest, rel=1e-6)


def test_mass_in_the_middle_changes_nothing(robot, box):
    plain, same = (
        PushPlanner(QUICK, GRID, robot, i).solve(START, GOAL)
        for i in (box, replace(box, com=(0.0, 0.0)))
    )
    assert plain.cost == same.cost
    assert np.array_equal(plain.segments[0].object_end, same.segments[0].object_end)


@pytest.mark.parametrize("vertices", [L, U, NICHE])
def test_concave_objects_are_pushed_on_the_sides_that_the_bumper_reaches(robot, vertices):
    item = item_of(vertices)
    reached = {s.index: s for s in pushable_sides(item.geometry, robot)}
    planner = PushPlanner(QUICK, GRID, robot, item)
    assert {s.index for s in planner.scene.sides} <= set(reached)
    for side in planner.scene.sides:
        # Back at the stand-off, the robot can turn without touching the object.
        contact = side.robot_pose(np.zeros(3))
        far = planner.scene.standoff(contact, side)
        away = distance(item.geometry.outline, far[None, :2])[0]
        assert away > robot.footprint_radius
        assert se2.between(contact, far)[0] == pytest.approx(
            -QUICK.standoff - reached[side.index].depth
        )
    plan = planner.solve(START, GOAL)
    assert plan.segments[-1].object_end == pytest.approx(GOAL)
    for segment in plan.segments:
        side = reached[segment.side]
        back = se2.between(segment.robot_start, segment.standoff)
        assert back == pytest.approx([-QUICK.standoff - side.depth, 0.0, 0.0], abs=1e-9)


def test_sides_in_recesses_and_across_them_are_planned_with(robot):
    across = {s.index for s in push_sides(robot, item_of(U), 0.75)}
    assert any(index >= len(U) for index in across)
    within = [s for s in push_sides(robot, item_of(NICHE), 0.75) if s.depth > 0.0]
    assert [s.depth for s in within] == pytest.approx([0.06])


def test_a_wall_where_the_robot_would_back_out_of_a_recess(robot):
    """There is room for the stand-off of an outer side, but not for the recess's."""
    item = item_of(NICHE)
    planner = PushPlanner(QUICK, GRID, robot, item)
    side = next(s for s in planner.scene.sides if s.depth > 0.0)
    contact = side.robot_pose(np.zeros(3))
    far = planner.scene.standoff(contact, side)
    beyond = se2.compose(far, np.array([-robot.footprint_radius + 0.01, 0.0, 0.0]))
    wall = BoxSpec((float(beyond[0]), float(beyond[1])), (0.02, 0.02))
    walled = PushPlanner(QUICK, rasterise(EnvironmentSpec((3.0, 2.0), (wall,))), robot, item)
    assert planner.scene.has_room(contact, side)
    assert not walled.scene.has_room(contact, side)
    assert walled.scene.has_room(contact, replace(side, depth=0.0))


def test_an_object_that_cannot_be_pushed_says_which_sides_there_are(robot, box):
    angle = np.arange(12) * np.pi / 6.0
    star = np.column_stack([np.cos(angle), np.sin(angle)]) * np.tile([0.15, 0.03], 6)[:, None]
    with pytest.raises(
        PlanningFailed, match=r"of its 12 sides .* reaches 0, 1, .* stable"
    ) as error:
        PushPlanner(QUICK, GRID, robot, item_of(star.tolist())).solve(START, GOAL)
    assert error.value.code is PlanError.NO_PUSH_SEQUENCE
    curved = from_mapping(
        ObjectSpec,
        {
            "shape": {"ellipse": {"semi_axis_x": 0.1, "semi_axis_y": 0.05}},
            "mass": 0.05,
            "height": 0.06,
            "floor_friction": 0.3,
            "contact_friction": 0.2,
        },
        "",
    )
    with pytest.raises(PlanningFailed, match="its outline is curved"):
        PushPlanner(QUICK, GRID, robot, curved).solve(START, GOAL)


def test_robots_that_cannot_push_are_refused(box):
    ring, disc = load_scenario("ring20").robot()[1], load_scenario("discs1000").robot()[1]
    with pytest.raises(SettingsError, match="flat bumper is needed, the robot's is a 'ring'"):
        PushPlanner(QUICK, GRID, ring, box)
    with pytest.raises(SettingsError, match="two driven wheels"):
        PushPlanner(QUICK, GRID, disc, box)


@pytest.mark.long
def test_plans_turn_more_tightly_where_friction_is_known_and_not_less_where_it_is_not(robot):
    """The certified curvatures replace the trusted part of the stable ones where they allow more;
    a wide interval leaves the plan as it was."""
    item, exact = item_of(BOX), (Interval.exact(0.0), Interval.exact(0.0))
    cheapest = replace(QUICK, easing=0.0)
    plain = PushPlanner(cheapest, GRID, robot, item)
    known = ContactBelief(Interval(0.2, 0.19, 0.21), *exact)
    vague = ContactBelief(Interval(0.2, 0.08, 0.5), *exact)
    sure, unsure = (PushPlanner(cheapest, GRID, robot, item, b) for b in (known, vague))
    for before, tight, same in zip(
        plain.scene.sides, sure.scene.sides, unsure.scene.sides, strict=True
    ):
        assert same.trusted == before.trusted
        certified = certified_limits(item, robot, known, before.index)
        assert tight.trusted.maximum == pytest.approx(0.9 * certified.maximum)
        assert before.trusted.maximum < tight.trusted.maximum < certified.maximum
    random, cheaper = np.random.default_rng(3), []
    for _ in range(10):
        start, goal = random.uniform([-1.2, -0.7, -np.pi], [1.2, 0.7, np.pi], (2, 3))
        first, second = (p.solve(start, goal) for p in (plain, sure))
        assert unsure.solve(start, goal).cost == first.cost
        for segment in second.segments:
            (side,) = (s for s in sure.scene.sides if s.index == segment.side)
            v, omega = segment.trajectory.twist.T
            bends = np.abs(omega[v > 0.01] / v[v > 0.01])
            assert bends.max() <= side.trusted.maximum + 1e-6
        cheaper.append(second.cost / first.cost)
    assert np.median(cheaper) < 0.98
