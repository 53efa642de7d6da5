"""Other bodies on the way of pushes, and what a robot beside its path will meet."""

from types import SimpleNamespace

import numpy as np
import pytest

from push_model import CurvatureLimits, PushSegment, along_curve, se2
from push_model.kinematics import DifferentialDrive
from push_model.occupancy import rasterise
from push_model.outlines import distance, inside
from push_model.specs import BoxSpec, EnvironmentSpec
from push_supervisor import SupervisorSettings, Surroundings
from push_supervisor.blocked_way import BlockedWay, obstruction
from push_supervisor.state import State

DRIVE = DifferentialDrive(0.0205, 0.0265, 6.28)


def arc(robot, box, begin, curvature, length=0.6):
    """A push along an arc from a pose of the robot."""
    s = np.linspace(0.0, length, 121)
    angle = begin[2] + curvature * s
    step = np.diff(s) * np.array([np.cos(angle[1:]), np.sin(angle[1:])])
    points = begin[:2] + np.vstack([np.zeros(2), np.cumsum(step.T, axis=0)])
    way = along_curve(points, angle, np.full_like(s, curvature), DRIVE, 0.1, 0.2)
    grasp = np.array([robot.push_distance - box.outline[:, 0].min(), 0.0, 0.0])
    ends = way.pose[0], way.pose[-1]
    items = [se2.compose(e, grasp) for e in ends]
    limits = CurvatureLimits(-2.0, 2.0)
    return PushSegment(0, *items, *ends, ends[0], 0.2, 0.2, length, limits, 0.1, way)


def gaps(segment, outlines, x, y, radius):
    """``(n,)`` exact gap of robot and object to a disc at each pose of a push."""
    result = []
    for pose in segment.trajectory.pose:
        least = np.inf
        item = se2.compose(pose, segment.grasp)
        for outline, at in zip(outlines, (pose, item), strict=True):
            points, middle = se2.transform(at, outline), np.array([[x, y]])
            sign = -1.0 if inside(points, middle)[0] else 1.0
            least = min(least, sign * distance(points, middle)[0] - radius)
        result.append(least)
    return np.array(result)


@pytest.mark.long
def test_bodies_on_the_way_of_random_pushes_are_seen_and_no_others(robot, box):
    random = np.random.default_rng(5)
    outlines = robot.outline, box.outline
    seen = 0
    for _ in range(300):
        begin = np.array([*random.uniform(-1, 1, 2), random.uniform(-np.pi, np.pi)])
        push = arc(robot, box, begin, random.uniform(-1.5, 1.5))
        passed = push.trajectory.pose[random.integers(len(push.trajectory.pose))]
        where = se2.compose(passed, push.grasp)[:2] + random.uniform(-0.15, 0.15, 2)
        body = np.array([[*where, random.uniform(0.02, 0.08)]])
        exact = gaps(push, outlines, *body[0])
        if exact[0] < 0.01:
            continue  # beside robot or object at the beginning, see the next test
        found = obstruction([push], outlines, body, push.object_start)
        if exact.min() < 0.004:
            assert found is not None and found.at == pytest.approx(where)
            first = int(np.argmax(exact < 0.005))
            item = se2.compose(push.trajectory.pose[first], push.grasp)
            assert found.ahead >= np.hypot(*(item - push.object_start)[:2]) - 0.01
            seen += 1
        elif exact.min() > 0.006:
            assert found is None
    assert seen > 40


def test_a_body_behind_or_beside_the_object_is_not_on_its_way(robot, box):
    push = arc(robot, box, np.zeros(3), 0.0)
    outlines = robot.outline, box.outline
    beside = np.array([[push.object_start[0], box.outline[:, 1].max() + 0.031, 0.03]])
    assert obstruction([push], outlines, beside, push.object_start) is None
    ahead = np.array([[push.object_start[0] + 0.3, 0.0, 0.03]])
    passed = push.object_start + np.array([0.45, 0.0, 0.0])
    assert obstruction([push], outlines, ahead, push.object_start).number == 1
    assert obstruction([push], outlines, ahead, passed) is None
    following = arc(robot, box, push.robot_end, 0.0)
    later = np.array([[following.object_end[0], 0.0, 0.03]])
    found = obstruction([push, following], outlines, later, push.object_start)
    assert found.number == 2 and found.ahead > 0.9


@pytest.mark.parametrize(("ahead", "looks"), [(0.25, 2), (0.5, 10)])
def test_a_near_body_stops_a_push_at_once_and_a_far_one_when_it_stays(robot, box, ahead, looks):
    push = arc(robot, box, np.zeros(3), 0.0)
    machine = SimpleNamespace(state=State.PUSHING, remaining=[push], segment=push, plan_ready=False)
    watch, near = BlockedWay(machine), Surroundings(robot, box, {}, SupervisorSettings())
    x = push.object_start[0] + ahead
    body, gone = np.array([[x, 0.0, 0.04]]), np.array([[x, 0.5, 0.04]])
    for _ in range(looks - 1):
        assert watch.look(near, push.robot_start, push.object_start, body) is None
    assert watch.look(near, push.robot_start, push.object_start, gone) is None, "it has passed"
    told = [watch.look(near, push.robot_start, push.object_start, body) for _ in range(looks)]
    assert told[:-1] == [None] * (looks - 1)
    assert told[-1].message == f"a body at ({x:.2f}, 0.00) stands on the way of push 1"


def test_a_robot_that_has_drifted_towards_a_wall_is_told_before_it_touches_it(robot, box):
    """On the path itself the robot's bumper passes the wall at 15 mm."""
    side = robot.outline[:, 1].max()
    wall = BoxSpec((0.55, side + 0.015 + 0.1), (0.2, 0.2))
    around = Surroundings(robot, box, {}, SupervisorSettings())
    around.take_map(rasterise(EnvironmentSpec((3.0, 2.0), boxes=(wall,))))
    push = arc(robot, box, np.zeros(3), 0.0)
    told = {}
    for off in (0.0, 0.004, 0.008, 0.014, 0.02, -0.02):
        where = []
        for k, pose in enumerate(push.trajectory.pose):
            here = se2.compose(pose, np.array([0.0, off, 0.0]))
            if around.drift(push, here, se2.compose(here, push.grasp)):
                where.append(k)
        told[off] = where
    assert not told[0.0] and not told[0.004] and not told[-0.02]
    for off in (0.014, 0.02):
        x = push.trajectory.pose[told[off][0], 0]
        front = robot.outline[:, 0].max()
        assert x + front < 0.45 - 0.03, "more than 3 cm before the wall"
    text = around.drift(push, *(
        se2.compose(push.trajectory.pose[told[0.014][0]], np.array([0.0, 0.014, 0.0])),
        se2.compose(push.trajectory.pose[told[0.014][0]], np.array([0.1, 0.014, 0.0])),
    ))  # fmt: skip
    assert text.startswith("the robot is 14 mm beside its path, on which the ")
