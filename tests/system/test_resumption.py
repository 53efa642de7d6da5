"""The node of a group or a swarm dies during its job; the one in its place takes the job up again.

Row 11 of the table of faults. Nodes die and are made anew within one process, in lockstep.
"""

import os
from contextlib import contextmanager

import numpy as np
import pytest
from std_srvs.srv import Trigger

from push_bringup.systems import nodes_of
from push_model.jobs import JobError
from push_msgs.msg import JobState
from push_msgs.srv import Reset
from push_ros.job_memory import VARIABLE, new_memory
from tests.system import test_group, test_swarm
from tests.system.test_group_faults import commands
from tests.system.test_swarm import move

SYSTEMS = {"group": test_group, "swarm": test_swarm}


@contextmanager
def running(monkeypatch, system):
    """A run whose nodes keep their job, as those that a launcher starts again."""
    memory = new_memory()
    monkeypatch.setenv(VARIABLE, str(memory))
    try:
        with SYSTEMS[system].running() as run:
            run.system = system
            run.start()
            yield run
    finally:
        os.close(memory)


def die(run):
    """The owner of the job is gone without a word."""
    run.spinner.remove(run.supervisor)


def respawn(run):
    """Another one in its place."""
    (spec,) = (s for s in nodes_of(run.system, run.scenario, "") if s.traits.owner)
    run.supervisor = run.teams[""].supervisor = node = spec.make(run.scenario)
    run.spinner.add(node)
    run.observer.state = None
    assert run.spin_until(lambda: run.observer.state is not None, 30.0)


def away(run, seconds):
    """Nobody owns the job for so long [s]; no robot may be driven then."""
    began = run.bridge.time
    assert run.spin_until(lambda: run.bridge.time > began + seconds, 2.0 * seconds + 1.0)
    assert not any(run.bridge.driving(n) for n in run.scenario.robots)


def pushing(run, goal):
    run.teams[""].send_goal(goal)
    assert run.spin_until(lambda: run.observer.state.state == JobState.PUSHING, 120.0)
    run.spin_until(lambda: False, 1.0)


@pytest.mark.long
@pytest.mark.parametrize("system", ["swarm", "group"])
def test_the_job_is_taken_up_again_and_ends_at_the_goal(monkeypatch, system):
    goal = np.array(SYSTEMS[system].VALUES["goal"])
    with running(monkeypatch, system) as run:
        pushing(run, goal)
        job, sent = run.observer.state.job, run.observer.state.goal
        die(run)
        away(run, 1.0)
        respawn(run)
        state = run.observer.state
        assert state.state != JobState.IDLE and state.job == job and state.goal == sent
        assert run.spin_until(lambda: run.observer.state.state == JobState.IDLE, 400.0)
        state = run.observer.state
        assert state.error_code == 0 and state.job == job, state.reason
        off = run.observer.trace.object[-1] - goal
        assert np.hypot(*off[:2]) < 0.03


@pytest.mark.long
def test_targets_in_a_row_go_on_with_those_that_are_left(monkeypatch):
    with running(monkeypatch, "swarm") as run:
        move_on = {"x": [0.5, 0.9], "y": [0.2, -0.3]}
        with pytest.raises(AssertionError):  # the client of the action waits for its answer
            move(run, **move_on, limit=0.5)
        job = run.supervisor.method.job
        assert run.spin_until(lambda: job.index == 1, 200.0)
        run.spin_until(lambda: False, 1.0)
        die(run)
        away(run, 0.5)
        respawn(run)
        assert run.spin_until(lambda: run.supervisor.busy, 10.0)
        (target,) = run.supervisor.method.job.targets
        assert target[:2] == pytest.approx([0.9, -0.3]) and np.isnan(target[2])


def spoilt(run, how):
    """What happens while nobody owns the job."""
    if how == "moved":
        run.bridge.world.place("box", np.array([0.5, -0.5, 0.0]))
    if how == "reset":
        client = run.observer.create_client(Reset, "/bridge/reset")
        assert run.spinner.until(client.service_is_ready, 5.0)
        answer = client.call_async(Reset.Request())
        assert run.spinner.until(answer.done, 5.0)


@pytest.mark.parametrize(
    ("how", "code"),
    [
        pytest.param("moved", JobError.JOB_FORGOTTEN, marks=pytest.mark.long),
        pytest.param("reset", JobError.CLOCK_RESET, marks=pytest.mark.long),
        pytest.param("late reset", JobError.CLOCK_RESET, marks=pytest.mark.long),
        pytest.param("died too often", JobError.JOB_FORGOTTEN, marks=pytest.mark.long),
        pytest.param("another team", JobError.NONE, marks=pytest.mark.long),
        pytest.param("ended in good order", JobError.NONE, marks=pytest.mark.long),
    ],
)
def test_a_job_of_another_world_is_not_taken_up(monkeypatch, how, code):
    """No robot is driven, and the state says why."""
    goal = np.array(test_swarm.VALUES["goal"])
    with running(monkeypatch, "swarm") as run:
        pushing(run, goal)
        if how == "ended in good order":
            run.supervisor.stop()
        memory = run.supervisor._intake._keeper._memory
        die(run)
        away(run, 0.5)
        spoilt(run, "reset" if how == "late reset" else how)
        if how == "late reset":  # its clock is later than when the node died
            kept = memory.read()
            memory.write(kept.__class__(**{**kept.__dict__, "stamp": 0.01, "bodies": ()}))
            away(run, 0.5)
        if how in ("died too often", "another team"):
            kept = memory.read()
            change = {"restarts": 3} if how == "died too often" else {"team": ("box", "e0")}
            memory.write(kept.__class__(**{**kept.__dict__, **change}))
        told = commands(run)
        respawn(run)
        assert run.spin_until(lambda: run.observer.state.state == JobState.IDLE, 5.0)
        state = run.observer.state
        assert state.error_code == code, state.reason
        run.spin_until(lambda: False, 1.0)
        assert not run.supervisor.busy and max(speed for _, speed in told) == 0.0
        assert memory.read() is None
        again = run.reach(goal, 300.0)
        assert again is not None and again.error_code == 0


def test_a_cancel_ends_a_job_that_has_not_been_taken_up_yet(monkeypatch):
    goal = np.array(test_swarm.VALUES["goal"])
    with running(monkeypatch, "swarm") as run:
        pushing(run, goal)
        die(run)
        away(run, 0.5)
        with monkeypatch.context() as patch:
            patch.setattr("push_ros.method_node.MethodNode.ready", False)
            cancel_before_it_is_taken_up(run)
        run.spin_until(lambda: False, 1.0)
        assert not run.supervisor.busy


def cancel_before_it_is_taken_up(run):
    respawn(run)
    assert run.observer.state.state == JobState.PLANNING
    client = run.observer.create_client(Trigger, "/cancel")
    assert run.spinner.until(client.service_is_ready, 5.0)
    answer = client.call_async(Trigger.Request())
    assert run.spin_until(answer.done, 5.0)
    assert answer.result().success
    assert run.spin_until(lambda: run.observer.state.state == JobState.IDLE, 5.0)
    assert run.observer.state.error_code == JobError.CANCELED
