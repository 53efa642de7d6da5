"""A swarm in the whole graph: goals, targets in a row, refusals, robots that die and leave."""

import math

import numpy as np
import pytest
from rclpy.action import ActionClient

from push_model.jobs import JobError
from push_msgs.action import SwarmMove
from push_msgs.msg import JobState, Report
from push_ros.qos import STATUS
from push_ros.report_conversions import report_from_ros
from push_scenario.scenario import scenario_from_mapping
from push_study.graph_run import LockstepRun

VALUES = {
    "environment": {"size": [4.0, 3.0]},
    "robots": {
        "e": {
            "type": "epuck_ring",
            "count": 8,
            "placement": {"random": {"seed": 2, "gap": 0.03, "area": [-1.9, 0.0, -1.4, 1.4]}},
        }
    },
    "objects": {"box": {"type": "swarm_square", "start": [0.3, 0.0, 0.0]}},
    "goal": [0.8, 0.4, 1.0],
    "parameters": {"bridge": {"world": "planar"}},
}

LAW = {"law": {"law": "thesis"}}


def running(**changes):
    scenario = scenario_from_mapping({**VALUES, **changes}, "test", "test")
    return LockstepRun(scenario, system="swarm", quiet=True)


@pytest.fixture
def run():
    with running() as started:
        started.start()
        yield started


def test_a_pose_is_reached_and_told(run):
    """And what the swarm covers is told at every tick."""
    told = []
    run.observer.create_subscription(Report, "/report", told.append, STATUS)
    goal = np.array(VALUES["goal"])
    state = run.reach(goal)
    assert state is not None and state.error_code == 0 and state.system == "swarm", state.reason
    assert state.progress == 1.0 and state.state == JobState.IDLE
    off = run.observer.trace.object[-1] - goal
    assert np.hypot(*off[:2]) < 0.03 and abs(math.remainder(off[2], 2.0 * math.pi)) < 0.06
    assert {m.phase for m in told} >= {"go round", "push"} and len(told) > 100
    for m in told[:: len(told) // 20]:
        report = report_from_ros(m)
        assert report.figure("taking part") == 8 and report.figure("not moving") == 0
        layers = [s.layer for s in report.shapes]
        assert layers.count("cells") == 8 and {"region", "density", "centroids"} <= set(layers)
        (centroids,) = [s for s in report.shapes if s.layer == "centroids"]
        assert len(centroids.points) == 8 and m.solve_time < 1.0
        assert math.isfinite(report.figure("to the target"))


def move(run, x, y, theta=(), limit=400.0, feedback=None):
    """What the action says of targets."""
    client = ActionClient(run.observer, SwarmMove, "/swarm_move")
    assert run.spinner.until(client.server_is_ready, 5.0)
    goal = SwarmMove.Goal(x=list(x), y=list(y), theta=list(theta))
    sent = client.send_goal_async(goal, feedback.append if feedback is not None else None)
    assert run.spin_until(sent.done, 5.0) and sent.result().accepted
    answer = sent.result().get_result_async()
    assert run.spin_until(answer.done, limit)
    return answer.result().result


@pytest.mark.long
def test_targets_in_a_row_are_reached_without_headings(run):
    told = []
    result = move(run, [0.9, 0.0], [0.5, -0.5], feedback=told)
    assert result.error_code == 0, result.error_msg
    assert len(result.times) == 2 and min(result.times) > 2.0
    assert {m.feedback.target for m in told} == {0, 1}
    assert {m.feedback.state_name for m in told} >= {"POSITIONING", "PUSHING"}
    assert all(math.isfinite(m.feedback.position_error) for m in told)
    assert np.hypot(*(run.observer.trace.object[-1] - [0.0, -0.5, 0.0])[:2]) < 0.03


@pytest.mark.parametrize(
    ("x", "y", "theta", "code"),
    [
        ([0.5, 9.0], [0.0, 0.0], [], JobError.OUTSIDE_MAP),
        ([1.9], [0.0], [], JobError.GOAL_OCCUPIED),
        ([math.nan], [0.0], [], JobError.INVALID_GOAL),
        ([0.1], [0.0, 1.0], [], JobError.INVALID_GOAL),
        ([], [], [], JobError.INVALID_GOAL),
    ],
)
def test_targets_that_cannot_be_are_refused(run, x, y, theta, code):
    before = run.observer.state.job
    result = move(run, x, y, theta, 5.0)
    assert result.error_code == code and result.error_msg
    assert run.observer.state.job == before and run.observer.state.state == JobState.IDLE


@pytest.mark.parametrize(
    ("goal", "code"),
    [
        ((9.0, 0.0, 0.0), JobError.OUTSIDE_MAP),
        ((1.95, 0.0, 0.0), JobError.GOAL_OCCUPIED),
        ((math.inf, 0.0, 0.0), JobError.INVALID_GOAL),
    ],
)
def test_goals_that_cannot_be_are_refused_with_a_code(run, goal, code):
    before = run.observer.state.job
    run.teams[""].send_goal(np.array(goal))
    assert run.spin_until(lambda: run.teams[""].refused, 5.0)
    assert run.observer.state.refusal_code == code and run.observer.state.job == before


BEYOND = [1.4, 0.0, 0.0]
WALL = {"size": [4.0, 3.0], "boxes": [{"centre": [0.6, -0.5], "size": [0.2, 2.0]}]}


@pytest.mark.long
def test_an_object_is_brought_round_a_wall():
    with running(environment=WALL, goal=[1.3, -0.8, 0.5]) as run:
        run.start()
        state = run.reach(np.array([1.3, -0.8, 0.5]), 300.0)
        assert state is not None and state.error_code == 0, state.reason
        ways = run.observer.trace.object
        off = ways[-1] - [1.3, -0.8, 0.5]
        assert np.hypot(*off[:2]) < 0.03 and abs(math.remainder(off[2], 2.0 * math.pi)) < 0.06
        assert np.array(ways)[:, 1].max() > 0.6  # there is no other way


def test_goals_in_walls_or_without_a_way_are_refused():
    with running(environment=WALL, goal=BEYOND) as run:
        run.start()
        run.teams[""].send_goal(np.array([0.6, -0.5, 0.0]))
        assert run.spin_until(lambda: run.teams[""].refused, 5.0)
        assert run.observer.state.refusal_code == JobError.GOAL_OCCUPIED
    shut = {"size": [4.0, 3.0], "boxes": [{"centre": [0.8, 0.0], "size": [0.2, 2.6]}]}
    with running(environment=shut, goal=BEYOND) as run:
        run.start()
        run.teams[""].send_goal(np.array([1.4, 0.0, 0.0]))
        assert run.spin_until(lambda: run.teams[""].refused, 5.0)
        assert run.observer.state.refusal_code == JobError.PLANNING_FAILED
        assert "no way" in run.observer.state.refusal


def test_the_printed_law_refuses_walls():
    parameters = {**VALUES["parameters"], "swarm": LAW}
    with running(environment=WALL, goal=BEYOND, parameters=parameters) as run:
        run.start()
        run.teams[""].send_goal(np.array(BEYOND))
        assert run.spin_until(lambda: run.teams[""].refused, 5.0)
        assert run.observer.state.refusal_code == JobError.PLANNING_FAILED
        assert "printed law" in run.observer.state.refusal


@pytest.mark.long
def test_the_rest_finish_when_robots_die_and_leave():
    events = [
        {"kind": "kill", "at": 5.0, "robot": "e1"},
        {"kind": "kill", "at": 6.0, "robot": "e2"},
        {"kind": "remove", "at": 7.0, "robot": "e3"},
    ]
    with running(events=events) as run:
        run.start()
        told = []
        run.observer.create_subscription(Report, "/report", told.append, STATUS)
        state = run.reach(np.array(VALUES["goal"]), 300.0)
        assert state is not None and state.error_code == 0, state.reason
        reports = [report_from_ros(m) for m in told]
        assert {r.figure("taking part") for r in reports} >= {8, 7}
        assert any(r.figure("not moving") > 0 for r in reports)


def decentralised(**agents):
    swarm = {"agents": {"decentralised": True, **agents}}
    robots = {"e": {**VALUES["robots"]["e"], "count": 5}}
    return {"parameters": {**VALUES["parameters"], "swarm": swarm}, "robots": robots}


@pytest.mark.long
def test_they_stand_when_a_job_is_canceled_and_go_on_with_the_next():
    with running(**decentralised()) as run:
        run.start()
        run.teams[""].send_goal(np.array(VALUES["goal"]))
        assert run.spin_until(lambda: run.observer.state.state == JobState.PUSHING, 60.0)
        run.supervisor.end_job(JobError.CANCELED, "enough")
        run.spin_until(lambda: False, 0.5)
        before = run.bridge.world.poses()
        run.spin_until(lambda: False, 1.0)
        after = run.bridge.world.poses()
        assert max(np.abs(after[n] - before[n]).max() for n in before) < 1e-3
        run.teams[""].send_goal(np.array(VALUES["goal"]))
        assert run.spin_until(lambda: run.observer.state.state == JobState.PUSHING, 60.0)
