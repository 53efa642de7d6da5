"""Plans of groups as messages, and what is refused."""

import math

import numpy as np
import pytest

from grasp_opt.group_messages import plan_from_ros, plan_to_ros, trajectory_from_ros
from grasp_opt.step_planner import StepPlanner
from push_model.occupancy import rasterise
from push_model.specs import EnvironmentSpec, ObjectSpec
from push_msgs.action import PushAlong
from push_ros.validation import InvalidMessage
from push_scenario.bodies import load_object, load_robot

NAMES = ("a", "b", "c")
ITEM, ROBOT = load_object("plate_ellipse"), load_robot("epuck_ring")
ROBOTS = np.array([[-1.0, y, 0.0] for y in (-0.4, 0.0, 0.4)])


@pytest.fixture(scope="module")
def plan():
    planner = StepPlanner(rasterise(EnvironmentSpec((4.0, 3.0), resolution=0.02)), ITEM, ROBOT)
    return planner.plan(np.zeros(3), np.array([0.3, 0.6, 0.4]), ROBOTS, (), np.zeros((0, 3)))


def test_a_plan_is_the_same_on_the_other_side(plan):
    message = plan_to_ros(plan, "plate", NAMES, 12.5)
    assert message.object == "plate" and message.header.stamp.sec == 12
    back = plan_from_ros(message, NAMES)
    assert back.pushers == plan.pushers and back.left == plan.left
    assert np.array_equal(back.placement.way, plan.placement.way)
    assert np.array_equal(back.placement.contacts.points, plan.placement.contacts.points)
    assert back.placement.margin == plan.placement.margin
    assert np.array_equal(back.trajectory.pose, plan.trajectory.pose)
    assert np.array_equal(back.trajectory.twist, plan.trajectory.twist)
    assert [len(b) for b in back.batches] == [len(b) for b in plan.batches]
    for ours, theirs in zip(sum(plan.batches, ()), sum(back.batches, ()), strict=True):
        assert ours.robot == theirs.robot and ours.heading == theirs.heading
        assert np.array_equal(ours.points, theirs.points)
    again = plan_from_ros(plan_to_ros(plan, "plate", NAMES, 0.0), ("c", "b", "a"))
    assert again.pushers == tuple(2 - i for i in plan.pushers), "robots are known by name"


def test_plans_for_others_and_without_numbers_are_refused(plan):
    with pytest.raises(InvalidMessage, match="not in the group"):
        plan_from_ros(plan_to_ros(plan, "plate", NAMES, 0.0), ("d", "e", "f"))
    broken = plan_to_ros(plan, "plate", NAMES, 0.0)
    broken.x[3] = math.nan
    with pytest.raises(InvalidMessage, match="the plan"):
        plan_from_ros(broken, NAMES)
    broken = plan_to_ros(plan, "plate", NAMES, 0.0)
    broken.moves[0].y[0] = math.inf
    with pytest.raises(InvalidMessage, match="a move"):
        plan_from_ros(broken, NAMES)


def test_trajectories_are_of_the_object_and_become_those_of_its_centre_of_mass():
    values = {"mass": 0.3, "height": 0.02, "floor_friction": 0.5, "contact_friction": 0.2}
    item = ObjectSpec({"rectangle": {"length": 0.3, "width": 0.2}}, com=(0.05, -0.02), **values)
    time = np.linspace(0.0, 4.0, 9)
    goal = PushAlong.Goal(time=time.tolist(), x=(0.1 * time).tolist())
    goal.y, goal.theta = [0.0] * 9, (0.2 * time).tolist()
    task = trajectory_from_ros(goal, item)
    for k in (0, 4, 8):
        pose = np.array([goal.x[k], goal.y[k], goal.theta[k]])
        assert task.pose[k] == pytest.approx(item.mass_pose(pose), abs=1e-12)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"time": [0.0, 1.0]}, "equally long"),
        ({"time": [0.0, 2.0, 1.0]}, "ascend from 0"),
        ({"x": [0.0, math.nan, 0.2]}, "the trajectory"),
    ],
)
def test_what_is_no_trajectory_is_refused(change, why):
    values = {"time": [0.0, 1.0, 2.0], "x": [0.0, 0.1, 0.2], "y": [0.0] * 3, "theta": [0.0] * 3}
    with pytest.raises(InvalidMessage, match=why):
        trajectory_from_ros(PushAlong.Goal(**{**values, **change}), ITEM)
