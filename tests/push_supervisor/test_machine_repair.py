"""Repairs of a plan while the robot pushes: which events lead to one, and how it ends."""

import pytest

from push_supervisor import JobError, Machine, State, SupervisorSettings
from push_supervisor.arrival import Arrival
from push_supervisor.commands import (
    CancelRepair,
    Finish,
    FollowPush,
    FollowRetreat,
    MakePlan,
    Repair,
    Stop,
)
from push_supervisor.events import (
    CancelCommanded,
    ClockReset,
    GoalGiven,
    JobAborted,
    MapChanged,
    MotionDone,
    MotionFailed,
    PathFound,
    PlanFailed,
    PlanFound,
    PushLeft,
    RepairLate,
    WayBlocked,
)
from tests.push_supervisor.test_machine import commands, planned, segment, walk

PREEMPTED = JobAborted(JobError.PREEMPTED, "a new goal replaces this one")
BEGINNING = segment("beginning", length=1.0)


def pushing(free=True, there=False, **changes):
    """A machine in the first of three pushes."""
    machine = Machine(
        SupervisorSettings(**changes),
        lambda goal: Arrival(there, there, "error"),
        lambda: True,
        beginning=lambda push, goal: BEGINNING if free else None,
    )
    walk(machine, GoalGiven("g", item="box"), MotionDone(), planned(0, 1, 2))
    walk(machine, PathFound("t"), MotionDone(), MotionDone())
    return machine


def repaired(machine, *sides):
    return machine.handle(planned(*sides))


def test_a_new_goal_does_not_stop_a_push_that_is_free():
    machine = pushing()
    assert machine.state is State.PUSHING
    (finish,) = machine.handle(PREEMPTED)
    assert finish == Finish(JobError.PREEMPTED, PREEMPTED.message, going_on=True)
    out = machine.handle(GoalGiven("h", item="box"))
    assert out == [Repair("h", BEGINNING)]
    assert machine.state is State.PUSHING and machine.repairing and machine.busy
    assert machine.remaining == [BEGINNING]
    out = repaired(machine, 5, 6)
    assert commands(out) == [FollowPush] and out[0].going_on and out[0].segment.side == 5
    assert not machine.repairing and machine.replans == 0 and machine.goal == "h"
    assert commands(machine.handle(MotionDone())) == [FollowRetreat]  # as after any push


@pytest.mark.parametrize(
    "event",
    [
        GoalGiven("h", item="other"),
        GoalGiven("h", plan_only=True, item="box"),
        CancelCommanded(),
        ClockReset(),
        MotionDone(),
        MapChanged("problem"),
        PushLeft(),
    ],
)
def test_a_push_that_was_left_to_go_on_stops_unless_a_goal_of_the_same_object_follows(event):
    machine = pushing()
    assert not machine.left
    machine.handle(PREEMPTED)
    assert machine.left
    assert Stop in commands(machine.handle(event))


def test_a_new_goal_stops_a_push_that_is_not_free():
    machine = pushing(free=False)
    machine.handle(PREEMPTED)
    assert commands(machine.handle(GoalGiven("h", item="box"))) == [Stop, FollowRetreat]


def test_a_goal_at_which_the_object_is_already_ends_the_push():
    machine = pushing(there=True)
    machine.state, machine.segments, machine.busy = State.PUSHING, [segment(0)], True
    machine._execute = True
    machine.handle(PREEMPTED)
    out = machine.handle(GoalGiven("h", item="box"))
    assert commands(out) == [Stop, Finish] and machine.error is JobError.NONE


@pytest.mark.parametrize("event", [MapChanged("problem"), WayBlocked("problem")])
def test_a_plan_that_is_blocked_further_on_is_repaired(event):
    machine = pushing()
    out = machine.handle(event)
    assert out == [Repair("g", BEGINNING)] and machine.reason.endswith("problem")
    assert commands(repaired(machine, 0, 3)) == [FollowPush]
    assert machine.replans == 1


@pytest.mark.parametrize("event", [MapChanged("problem"), WayBlocked("problem")])
def test_the_robot_backs_off_where_the_push_itself_is_blocked(event):
    machine = pushing(free=False)
    assert commands(machine.handle(event)) == [FollowRetreat]
    again = pushing()
    again.handle(event)
    assert commands(again.handle(event)) == [CancelRepair, FollowRetreat]


@pytest.mark.parametrize(
    "event",
    [
        PlanFailed(JobError.PLANNING_FAILED, "no plan"),
        RepairLate(),
        MotionDone(),
        MotionFailed("the object has slipped"),
        MotionFailed("the controller is gone", lost=True),
    ],
)
def test_without_a_plan_in_time_the_robot_backs_off_and_plans(event):
    machine = pushing()
    machine.handle(WayBlocked("problem"))
    out = commands(machine.handle(event))
    assert out[-1] is FollowRetreat
    assert CancelRepair in out or isinstance(event, PlanFailed)
    assert commands(repaired(machine, 5)) == []  # too late
    assert commands(machine.handle(MotionDone())) == [MakePlan]
    assert machine.replans == 1


@pytest.mark.parametrize(
    "event", [PlanFailed(JobError.PLANNING_FAILED, "no plan"), RepairLate(), MotionDone()]
)
def test_that_the_plan_for_a_new_goal_is_late_is_no_setback(event):
    machine = pushing(max_replans=0)
    machine.handle(PREEMPTED)
    machine.handle(GoalGiven("h", item="box"))
    out = commands(machine.handle(event))
    assert out[-1] is FollowRetreat and machine.state is State.DETACHING
    (ask,) = machine.handle(MotionDone())
    assert isinstance(ask, MakePlan) and ask.goal == "h" and machine.replans == 0


def test_what_was_found_on_the_map_before_does_not_count():
    machine = pushing()
    machine.handle(WayBlocked("problem"))
    machine.handle(PlanFound(planned(6).segments, improving=True))
    assert machine.handle(MapChanged()) == []
    assert commands(machine.handle(RepairLate())) == [CancelRepair, FollowRetreat]


def test_a_plan_that_is_still_improved_is_taken_when_the_time_is_up():
    machine = pushing()
    machine.handle(WayBlocked("problem"))
    for sides in ((4, 5), (6,)):
        assert machine.handle(PlanFound(planned(*sides).segments, improving=True)) == []
    out = machine.handle(RepairLate())
    assert commands(out) == [CancelRepair, FollowPush] and out[1].going_on
    assert [push.side for push in machine.segments] == [6] and machine.replans == 1
    machine.handle(WayBlocked("problem"))  # what was found then does not count any more
    assert commands(machine.handle(RepairLate())) == [CancelRepair, FollowRetreat]
    assert machine.handle(PlanFound(planned(7).segments, improving=True)) == []
    machine.handle(MotionDone())
    assert machine.handle(PlanFound(planned(7).segments, improving=True)) == []
    assert machine.state is State.PLANNING


def test_a_plan_that_is_still_improved_is_not_taken_where_the_robot_has_to_back_off_anyway():
    machine = pushing()
    machine.handle(WayBlocked("problem"))
    assert machine.handle(PlanFound((BEGINNING, segment(3)), improving=True)) == []
    assert commands(machine.handle(RepairLate())) == [CancelRepair, FollowRetreat]


@pytest.mark.parametrize("event", [CancelCommanded(), ClockReset()])
def test_a_job_that_ends_during_a_repair_stops_the_robot(event):
    machine = pushing()
    machine.handle(WayBlocked("problem"))
    assert commands(machine.handle(event)) == [CancelRepair, Stop, Finish]
    assert commands(repaired(machine, 5)) == [] and machine.state is State.IDLE


def test_another_goal_during_a_repair_is_planned_for_from_the_same_push():
    machine = pushing()
    machine.handle(WayBlocked("problem"))
    whole = machine._repair
    assert commands(machine.handle(PREEMPTED)) == [CancelRepair, Finish]
    seen = []
    machine.beginning = lambda push, goal: seen.append((push, goal)) or BEGINNING
    assert machine.handle(GoalGiven("h", item="box")) == [Repair("h", BEGINNING)]
    assert seen == [(whole, "h")]


def test_repairs_are_bounded_like_other_new_plans():
    machine = pushing(max_replans=2)
    for _ in range(2):
        assert commands(machine.handle(MapChanged("problem"))) == [Repair]
        repaired(machine, 0, 1, 2)
    assert commands(machine.handle(MapChanged("problem"))) == [FollowRetreat]
    out = machine.handle(MotionDone())
    assert commands(out) == [Stop, Finish] and machine.error is JobError.EXECUTION_FAILED


def test_a_push_on_a_corner_is_not_gone_on_with():
    machine = pushing()
    machine.segments[0] = segment(0, turns=True)
    assert commands(machine.handle(WayBlocked("problem"))) == [FollowRetreat]
