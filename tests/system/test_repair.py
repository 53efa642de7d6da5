"""The plan is repaired while the robot pushes, which stops only when it must."""

from dataclasses import replace

import numpy as np
import pytest

from push_model import se2
from push_model.jobs import JobError
from push_model.occupancy import rasterise
from push_model.specs import BoxSpec, EnvironmentSpec
from push_msgs.action import MoveObject
from push_ros.conversions import grid_to_ros, pose_stamped_to_ros
from push_scenario.scenario import load_scenario
from tests.samples import mostly_long
from tests.system.test_supervision import runs

REPLACED = "a new goal replaces this one"
BEHIND = EnvironmentSpec((3.0, 2.0), boxes=(BoxSpec((-0.75, 0.0), (0.06, 0.06)),))


def states_since(run, count):
    """Without that of the end of the job before, which is often replaced before it is sent."""
    states = [(name, reason) for _, name, reason, _ in run.run.observer.trace.states[count:]]
    return states[1:] if states and states[0][1] == REPLACED else states


def slowest(run, begun, ended):
    """[m/s] of the robot between two times [s], in steps of 0.1 s."""
    trace = run.run.observer.trace
    first, last = (round(100 * t) for t in (begun, ended))
    poses = np.array(trace.robot[first : last + 1 : 10])
    return np.hypot(*np.diff(poses[:, :2], axis=0).T).min() / 0.1


def ahead(run, way, aside=0.0, turn=0.0):
    """A pose of the object further along its heading and beside."""
    item = run.run.observer.trace.object[-1]
    robot = run.run.observer.trace.robot[-1]
    there = se2.compose(np.array([*item[:2], robot[2]]), np.array([way, aside, turn]))
    there[2] = item[2] + turn
    return there


@pytest.mark.parametrize("aside", mostly_long([-0.05, 0.05], 1))
def test_a_goal_that_moves_is_planned_for_while_the_robot_pushes(aside):
    """It never stops: the new plan begins with the push under way."""
    with runs(load_scenario("short")) as run:
        run.by_action(run.goal)
        run.pushing(0.1)
        begun, count = run.run.bridge.time, len(run.run.observer.trace.states)
        goal = ahead(run, 0.6, aside, 0.1 * np.sign(aside))
        run.by_topic(goal)
        run.until(lambda: len(run.driven) == 2, 5.0)
        ended = run.run.bridge.time + 1.5
        run.until(lambda: run.run.bridge.time > ended)
        told = states_since(run, count)
        assert [name for name, _ in told] == ["PUSHING", "PUSHING"], told
        assert told[0][1].startswith("pushing on meanwhile")
        assert slowest(run, begun, ended) > 0.06
        (result,) = run.results
        assert result.error_code == JobError.PREEMPTED
        run.reached(goal)
        assert run.state.job == 2


@pytest.mark.long
@pytest.mark.parametrize("repair_time", [0.0, 0.6])
def test_without_time_for_a_plan_the_robot_backs_off_first(repair_time):
    scenario = load_scenario("short").settings("supervisor", repair_time=repair_time)
    with runs(scenario) as run:
        run.by_topic(run.goal)
        run.pushing(0.1)
        count = len(run.run.observer.trace.states)
        goal = ahead(run, 0.5, -0.1)
        run.by_topic(goal)
        run.until(lambda: run.state.state_name == "PLANNING", 20.0)
        assert [name for name, _ in states_since(run, count)] == ["DETACHING", "PLANNING"]
        run.reached(goal)


@pytest.mark.long
def test_the_robot_backs_off_first_where_going_on_leads_away_from_the_goal():
    with runs(load_scenario("short")) as run:
        run.by_topic(run.goal)
        run.pushing(0.2)
        count = len(run.run.observer.trace.states)
        goal = ahead(run, -0.4)
        run.by_topic(goal)
        run.until(lambda: run.state.state_name == "PLANNING", 20.0)
        assert [name for name, _ in states_since(run, count)] == ["DETACHING", "PLANNING"]
        run.reached(goal)


@pytest.mark.long
def test_a_goal_for_another_object_stops_the_push():
    scenario = load_scenario("short")
    spec, _ = scenario.objects["box"]
    objects = dict(scenario.objects) | {"crate": (spec, np.array([0.8, 0.6, 0.0]))}
    with runs(replace(scenario, objects=objects)) as run:
        run.by_topic(run.goal)
        run.pushing(0.1)
        count = len(run.run.observer.trace.states)
        goal = pose_stamped_to_ros(np.array([0.6, 0.5, 0.0]), 0.0)
        run.action.send_goal_async(MoveObject.Goal(object="crate", goal=goal))
        run.until(lambda: run.state.object == "crate" and len(states_since(run, count)) > 1, 5.0)
        (name, _), *_ = states_since(run, count)
        assert name == "DETACHING"


@pytest.mark.long
def test_a_wall_behind_the_robot_changes_nothing():
    """Only what lies ahead matters."""
    with runs(load_scenario("short")) as run:
        run.by_topic(run.goal)
        run.pushing(0.3)
        count = len(run.run.observer.trace.states)
        run.maps.publish(grid_to_ros(rasterise(BEHIND), 0.0))
        run.until(lambda: run.run.supervisor.surroundings.grid.equals(rasterise(BEHIND)), 5.0)
        run.reached(run.goal)
        assert [name for name, _ in states_since(run, count)] == ["IDLE"]


@pytest.mark.long
def test_a_wall_further_on_is_gone_round_without_a_stop():
    with runs(load_scenario("short")) as run:
        goal = np.array([0.8, 0.0, 0.0])
        run.by_topic(goal)
        run.pushing(0.1)
        begun, count = run.run.bridge.time, len(run.run.observer.trace.states)
        x, y, _ = ahead(run, 0.55, -0.08)
        grid = rasterise(EnvironmentSpec((3.0, 2.0), boxes=(BoxSpec((x, y), (0.05, 0.1)),)))
        run.maps.publish(grid_to_ros(grid, 0.0))
        run.until(lambda: len(run.driven) == 2, 5.0)
        ended = run.run.bridge.time + 1.0
        run.until(lambda: run.run.bridge.time > ended)
        told = states_since(run, count)
        assert [name for name, _ in told] == ["PUSHING", "PUSHING"], told
        assert "the map has changed" in told[0][1]
        assert slowest(run, begun, ended) > 0.06
        run.reached(goal, replans=1)
        assert run.run.observer.trace.collisions == 0


@pytest.mark.long
def test_cancel_during_a_repair_stops_the_robot():
    with runs(load_scenario("short")) as run:
        run.by_topic(run.goal)
        run.pushing(0.1)
        run.by_topic(ahead(run, 0.6, 0.1))
        run.until(lambda: run.run.supervisor.machine.repairing, 5.0)
        run.run.supervisor.end_job(JobError.CANCELED, "canceled")
        begun = run.run.bridge.time
        run.until(lambda: run.run.bridge.time > begun + 0.6)
        assert run.state.error_code == JobError.CANCELED and len(run.driven) == 1
        assert not run.run.controller.tracker.active
        robot = run.run.observer.trace.robot
        assert np.hypot(*(robot[-1] - robot[-20])[:2]) < 1e-3


@pytest.mark.long
def test_a_planner_that_hangs_during_a_repair_is_waited_for_without_contact():
    """The push ends in time, and the job goes on when the planner does."""
    with runs(load_scenario("short")) as run:
        run.by_topic(run.goal)
        run.pushing(0.1)
        goal = ahead(run, 0.6, 0.1)
        run.by_topic(goal)
        run.until(lambda: run.run.supervisor.machine.repairing, 5.0)
        begun, item = run.run.bridge.time, run.run.observer.trace.object[-1]
        planner = run.run.planner
        work, planner._continue = planner._continue, lambda: None
        run.until(lambda: not run.run.supervisor.machine.repairing, 5.0)
        assert run.run.bridge.time - begun < 1.5
        run.until(lambda: run.state.state_name == "PLANNING", 10.0)
        assert np.hypot(*(run.run.observer.trace.object[-1] - item)[:2]) < 0.2
        planner._continue = work
        work()
        run.reached(goal)


@pytest.mark.long
def test_equal_runs_have_equal_repairs():
    """To the bit, also where the plan is made while the world goes on."""

    def trace():
        with runs(load_scenario("short")) as run:
            run.by_topic(run.goal)
            run.pushing(0.1)
            goal = ahead(run, 0.5, 0.1)
            run.by_topic(goal)
            run.until(lambda: len(run.driven) == 2, 5.0)
            run.reached(goal)
            return run.run.observer.trace

    first, second = trace(), trace()
    assert np.array_equal(first.object, second.object)
    assert np.array_equal(first.robot, second.robot)
