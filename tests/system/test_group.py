"""A group in the whole graph: goals, trajectories, refusals, a robot that dies, poses that stop."""

import math

import numpy as np
import pytest
from rclpy.action import ActionClient

from grasp_opt.object_trajectory import polynomial, sampled, screw
from push_model.jobs import JobError
from push_msgs.action import PushAlong
from push_msgs.msg import JobState, Report
from push_ros.qos import STATUS
from push_ros.report_conversions import report_from_ros
from push_scenario.scenario import load_scenario, scenario_from_mapping
from push_study.graph_run import LockstepRun

VALUES = {
    "environment": {"size": [3.6, 2.6]},
    "robots": {
        f"e{i}": {"type": "epuck_ring", "start": [-0.9, y, 0.0]}
        for i, y in enumerate((-0.4, 0.0, 0.4))
    },
    "objects": {"plate": {"type": "plate_ellipse", "start": [0.0, 0.0, -1.5708]}},
    "goal": [0.5, 0.3, -1.0],
    "parameters": {"bridge": {"world": "planar"}},
}


def running(**changes):
    scenario = scenario_from_mapping({**VALUES, **changes}, "test", "test")
    return LockstepRun(scenario, system="group", quiet=True)


@pytest.fixture
def run():
    with running() as started:
        started.start()
        yield started


def error(run, goal):
    pose = run.observer.trace.object[-1]
    off = math.remainder(float(pose[2] - goal[2]), 2.0 * math.pi)
    return float(np.hypot(*(pose - goal)[:2])), abs(off)


def test_a_goal_is_reached_and_told(run):
    """And what is asked of the robots is told at every tick of a push."""
    told = []
    run.observer.create_subscription(Report, "/report", told.append, STATUS)
    goal = np.array(VALUES["goal"])
    state = run.reach(goal)
    assert state is not None and state.error_code == 0 and state.system == "group"
    assert state.progress == 1.0 and state.state == JobState.IDLE
    away, turned = error(run, goal)
    assert away < 5e-3 and turned < 0.03 and run.observer.trace.collisions == 0
    reports = [report_from_ros(m) for m in told]
    pushing = [r for r in reports if any(s.layer == "forces" for s in r.shapes)]
    assert len(pushing) > 40
    for r in pushing[::10]:
        (forces,) = [s for s in r.shapes if s.layer == "forces"]
        cones = [s for s in r.shapes if s.layer == "friction cones"]
        assert len(forces.points) == 2 * len(cones)
        for tail, head, cone in zip(forces.points[::2], forces.points[1::2], cones, strict=True):
            left, point, right = cone.points
            assert tail == pytest.approx(point)
            for edge, side in ((left - point, -1.0), (right - point, 1.0)):
                cross = edge[0] * (head - tail)[1] - edge[1] * (head - tail)[0]
                assert side * cross >= -1e-9
        assert r.figure("grasp margin") > 0.0 and r.figure("position error") < 0.02


@pytest.mark.parametrize(
    ("goal", "code"),
    [
        ((9.0, 0.0, 0.0), JobError.OUTSIDE_MAP),
        ((1.75, 0.0, 0.0), JobError.GOAL_OCCUPIED),
        ((math.nan, 0.0, 0.0), JobError.INVALID_GOAL),
    ],
)
def test_goals_that_cannot_be_are_refused_with_a_code(run, goal, code):
    before = run.observer.state.job
    run.teams[""].send_goal(np.array(goal))
    assert run.spin_until(lambda: run.teams[""].refused, 5.0)
    assert run.observer.state.refusal_code == code and run.observer.state.job == before


def along(run, task):
    """What the action says of a trajectory."""
    client = ActionClient(run.observer, PushAlong, "/push_along")
    assert run.spinner.until(client.server_is_ready, 5.0)
    x, y, theta = task.pose.T.tolist()
    goal = PushAlong.Goal(time=task.time.tolist(), x=x, y=y, theta=theta)
    told = []
    sent = client.send_goal_async(goal, told.append)
    assert run.spin_until(sent.done, 5.0) and sent.result().accepted
    answer = sent.result().get_result_async()
    assert run.spin_until(answer.done, 200.0)
    result = answer.result().result
    if not result.error_code:
        assert {m.feedback.state_name for m in told} >= {"POSITIONING", "PUSHING"}
        assert all(0.0 <= m.feedback.progress <= 1.0 for m in told)
    return result


@pytest.mark.long
def test_a_trajectory_is_followed_and_one_that_begins_elsewhere_refused(run):
    bend = polynomial((0.25,), 0.5, 0.05, 0.05, -0.5 * math.pi)
    result = along(run, bend)
    assert result.error_code == 0, result.error_msg
    assert result.position_error < 5e-3 and result.orientation_error < 0.03 and result.margin > 0.0
    away, turned = error(run, bend.pose[-1])
    assert away < 5e-3 and turned < 0.03
    again = along(run, bend)
    assert again.error_code == JobError.INVALID_GOAL
    assert "from where the trajectory begins" in again.error_msg


@pytest.mark.long
def test_on_a_trajectory_that_no_placement_holds_the_robots_change_places(run):
    """Ahead, and then aside with the same heading: nobody can push both ways at once."""
    first = screw(np.array([0.0, 0.0, -1.5708]), np.array([0.0, 0.25, 0.0]), 0.05, 0.05, 0.2)
    second = screw(first.pose[-1], np.array([0.25, 0.0, 0.0]), 0.05, 0.05, 0.2)
    time = np.concatenate([first.time, first.duration + second.time[1:]])
    pose = np.vstack([first.pose, second.pose[1:]])
    result = along(run, sampled(time, pose))
    assert result.error_code == 0, result.error_msg
    assert run.supervisor.method.job.pushes >= 2
    assert error(run, pose[-1])[0] < 5e-3


def test_what_cannot_be_held_is_refused_before_anybody_moves():
    """Two robots on a triangle have no couple for a turn on the spot."""
    two = {name: VALUES["robots"][name] for name in ("e0", "e1")}
    plate = {"type": "plate_triangle", "start": [0.0, 0.0, 0.0]}
    with running(robots=two, objects={"plate": plate}) as run:
        run.start()
        run.spin_until(lambda: bool(run.observer.trace.robot), 5.0)
        before = run.observer.trace.robot[-1]
        turn = screw(np.zeros(3), np.array([0.0, 0.0, 1.0]), 0.05, 0.05, 0.2)
        result = along(run, turn)
        assert result.error_code == JobError.PLANNING_FAILED
        assert "no placement of 2 robots" in result.error_msg
        assert run.observer.trace.robot[-1] == pytest.approx(before, abs=1e-3)


@pytest.mark.long
def test_a_robot_that_dies_is_left_and_the_others_go_on():
    events = [{"kind": "kill", "at": 22.0, "robot": "e1"}]
    with running(events=events) as run:
        run.start()
        goal = np.array([1.0, 0.4, -1.0])
        state = run.reach(goal, 500.0)
        assert state is not None and state.error_code == 0, state and state.reason
        away, turned = error(run, goal)
        assert away < 5e-3 and turned < 0.03
        job = run.supervisor.method.job
        assert job.dead in ((), (1,)), "it may have stood out of everybody's way"


@pytest.mark.long
def test_a_new_goal_replaces_the_old_and_cancel_stops_all(run):
    first, second = np.array([1.0, 0.4, -1.5]), np.array([0.2, -0.2, -1.5708])
    run.teams[""].send_goal(first)
    assert run.spin_until(lambda: run.observer.state.state == JobState.PUSHING, 100.0)
    state = run.reach(second)
    assert state is not None and state.error_code == 0
    assert error(run, second)[0] < 5e-3


@pytest.mark.long
def test_the_scenario_of_the_demo_is_reached():
    scenario = load_scenario("group-ellipse").settings("bridge", world="planar")
    with LockstepRun(scenario, system="group", quiet=True) as run:
        run.start()
        state = run.reach(np.array(scenario.goal))
        assert state is not None and state.error_code == 0
        assert error(run, scenario.goal)[0] < 5e-3 and run.observer.trace.collisions == 0
