"""One robot as a method, hosted by the node that hosts any: one process in the place of three."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from push_bringup.one_robot_method import ONE_ROBOT
from push_bringup.preparation import prepare
from push_bringup.systems import nodes_of, system_of
from push_job.method import Task, method_spec
from push_model.belief import Interval
from push_model.jobs import JobError, JobPhase
from push_model.settings import SettingsError
from push_msgs.msg import Belief
from push_ros.qos import BELIEF
from push_ros.report_conversions import belief_to_ros
from push_scenario.scenario import load_scenario
from push_study.graph_run import LockstepRun
from push_study.team_run import OBJECT, run_team
from push_study.uncertainty import uncertainty

NAME = "push_bringup.one_robot_method:ONE_ROBOT"
PYPROJECT = Path(__file__).resolve().parents[2] / "pyproject.toml"


def scenario(name):
    """A scenario of the single robot whose object has the name that studies of teams give it."""
    found = load_scenario(name)
    (body,) = found.objects.values()
    return replace(found, objects={OBJECT: body}).settings("bridge", world="planar")


@pytest.mark.parametrize(
    ("name", "doubt"),
    [pytest.param("env1-target1", "none", marks=pytest.mark.long), ("short", "mild")],
)
def test_a_study_runs_it_and_the_object_ends_at_its_goal(name, doubt):
    believed, doubts, delays = scenario(name), uncertainty(doubt), set()

    def watch(run, time, poses):
        delays.add(run.supervisor.method._drive.tracker.settings.pose_delay)

    outcome = run_team(NAME, believed, Task((believed.goal,)), doubts, 1, 120.0, watch)
    assert outcome.success, outcome.reason
    assert delays == {doubts.latency[0]}, "it is told the latency, as a controller is"
    assert outcome.error[0] < 2e-3 and outcome.error[1] < 0.02
    assert outcome.pushes == 1 and outcome.replans == 0 and outcome.planning > 0.0
    assert {"positioning", "approach", "pushing"} <= set(outcome.trace.phases)
    assert "detaching" not in outcome.trace.phases, "nothing follows the only push"
    assert outcome.trace.collision_ticks == 0


def test_equal_seeds_give_equal_runs():
    believed = scenario("short")
    runs = [
        run_team(NAME, believed, Task((believed.goal,)), uncertainty("mild"), 7, 120.0)
        for _ in range(2)
    ]
    ways = [np.array(run.trace.ways) for run in runs]
    assert np.array_equal(*ways) and runs[0].seconds == runs[1].seconds


def test_what_cannot_be_is_refused_at_the_door():
    believed = scenario("env1-target1")
    for goal, code in (
        ((9.0, 0.0, 0.0), JobError.OUTSIDE_MAP),
        ((believed.grid.extent[0] + 0.02, 0.0, 0.0), JobError.GOAL_OCCUPIED),
    ):
        task = Task((np.array(goal),))
        outcome = run_team(NAME, believed, task, uncertainty("none"), 1, 60.0)
        assert outcome.code is code and outcome.seconds == 0.0


def test_a_belief_published_in_mid_push_changes_its_limits_in_the_next_frame():
    believed = scenario("short").settings(NAME, planner__easing=0.0)  # with tight bends
    friction = believed.objects[OBJECT][0].contact_friction
    with LockstepRun(believed, quiet=True, system=NAME) as run:
        run.start()
        said = run.observer.create_publisher(Belief, "/belief", BELIEF)
        assert run.spin_until(lambda: said.get_subscription_count() > 0, 5.0)
        run.teams[""].send_goal(believed.goal)
        method = run.supervisor.method
        assert run.spin_until(lambda: method.status.phase == JobPhase.PUSHING, 60.0)
        tracker = method._drive.tracker
        assert run.spin_until(lambda: tracker.push is not None, 1.0)
        before = tracker.push.limits.maximum

        def tell(part):
            values = {(OBJECT, "contact_friction"): Interval.exact(part * friction)}
            said.publish(belief_to_ros("person", values))

        tell(0.9)  # the object still sticks on the way that is planned
        assert run.spin_until(lambda: tracker.push.limits.maximum < 0.95 * before, 0.1)
        assert tracker.push.limits.maximum == pytest.approx(0.9 * before, rel=0.05)
        tell(0.5)  # and now no more
        machine = method.machine
        assert run.spin_until(lambda: "may slip in" in machine.reason, 1.0)
        assert run.spin_until(lambda: run.teams[""].ended, 60.0)
        assert run.observer.state.error_code == 0 and run.observer.state.system == "one-robot"


def test_it_is_a_system_of_one_node_beside_that_of_three():
    row = tomllib.loads(PYPROJECT.read_text())["project"]["entry-points"]["planar_push.methods"]
    assert method_spec(row["one-robot"]) is ONE_ROBOT and "single" not in row
    believed = scenario("short")
    assert [n.kind for n in nodes_of(NAME, believed)] == ["bridge", NAME]
    three = ["bridge", "controller", "planner", "supervisor"]
    assert [n.kind for n in nodes_of("single", believed)] == three
    assert system_of(NAME).example == "env1-target1"
    full = prepare(believed.settings(NAME, planner__push_speed=0.05), system=NAME).scenario
    assert full.parameters[NAME]["planner"]["push_speed"] == 0.05
    assert full.parameters[NAME]["tracker"]["give_up"] == 5.0, "defaults are written out"
    with pytest.raises(SettingsError, match="takes one"):
        nodes_of(NAME, load_scenario("group-ellipse"))


def test_poses_that_drop_out_are_known_as_old_and_do_no_harm():
    """Every third pose is missing, of robot and object each: the last one is handed on with its
    age."""
    believed = scenario("short").settings("bridge", motion_capture__dropout=0.3)
    ages = []

    def watch(run, time, poses):
        ages.append(dict(run.supervisor.seen.ages) if run.supervisor.seen is not None else {})

    task = Task((believed.goal,))
    outcome = run_team(NAME, believed, task, uncertainty("none"), 1, 120.0, watch)
    assert outcome.success and outcome.error[0] < 2e-3
    for body in (OBJECT, "epuck1"):
        share = sum(body in seen for seen in ages) / len(ages)
        assert 0.2 < share < 0.4
        assert all(0.0 < seen[body] <= 0.15 for seen in ages if body in seen)
