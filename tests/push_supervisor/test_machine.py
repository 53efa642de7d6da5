"""The state machine: the thesis's walk, everything beyond it, and an exhaustive random walk."""

from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from push_supervisor import JobError, Machine, State, SupervisorSettings
from push_supervisor.arrival import Arrival, arrival
from push_supervisor.commands import (
    CancelPlan,
    FindPath,
    Finish,
    FollowApproach,
    FollowPath,
    FollowPush,
    FollowRetreat,
    FollowTurn,
    MakePlan,
    Repair,
    Stop,
)
from push_supervisor.events import (
    CancelCommanded,
    ClockReset,
    ExecuteCommanded,
    GoalGiven,
    JobAborted,
    MapChanged,
    MotionDone,
    MotionFailed,
    ObjectMoved,
    PathFailed,
    PathFound,
    PlanFailed,
    PlanFound,
    RepairLate,
    WayBlocked,
)


def segment(side, turns=False, length=2.0):
    return SimpleNamespace(side=side, object_end=f"end of {side}", turns=turns, length=length)


def make(there=False, touching=False, close=True, free=False, **changes):
    answer = {"there": there, "touching": touching, "close": close, "free": free}
    machine = Machine(
        SupervisorSettings(**changes),
        lambda goal: Arrival(answer["there"], answer["close"], "error"),
        lambda: answer["touching"],
        beginning=lambda push, goal: push if answer["free"] else None,
    )
    return machine, answer


def commands(out):
    return [type(command) for command in out]


def walk(machine, *events):
    out = []
    for event in events:
        out = machine.handle(event)
    return out


GOAL = GoalGiven("g")
DONE = MotionDone()
PATH = PathFound("t")


def planned(*sides):
    return PlanFound(tuple(segment(s) for s in sides))


def test_algorithm_4_with_a_change_of_side():
    machine, answer = make()
    seen = []
    for event in [
        GOAL,
        planned(0, 0, 1),
        PATH,
        DONE,
        DONE,
        DONE,
        DONE,
        DONE,
        PATH,
        DONE,
        DONE,
        DONE,
    ]:
        out = machine.handle(event)
        seen.append((machine.state.name, *commands(out)))
    assert seen == [
        ("PLANNING", MakePlan),
        ("POSITIONING", FindPath),
        ("POSITIONING", FollowPath),
        ("APPROACH", FollowApproach),
        ("PUSHING", FollowPush),
        ("PUSHING", FollowPush),  # same side: on without letting go
        ("DETACHING", FollowRetreat),
        ("POSITIONING", FindPath),
        ("POSITIONING", FollowPath),
        ("APPROACH", FollowApproach),
        ("PUSHING", FollowPush),
        ("DETACHING", FollowRetreat),
    ]
    answer["there"] = True
    out = machine.handle(DONE)
    assert machine.state is State.IDLE and out[-1].code is JobError.NONE


def turning(*sides):
    """A plan that begins with a push on a corner, which leaves the first side flush."""
    return PlanFound((segment(sides[0], True), *(segment(s) for s in sides)))


def test_after_a_push_on_a_corner_the_robot_backs_off_and_a_new_plan_is_made():
    machine, _ = make()
    out = walk(machine, GOAL, turning(0, 1), PATH, DONE, DONE)
    assert machine.state is State.PUSHING and commands(out) == [FollowTurn]
    out = machine.handle(DONE)
    assert machine.state is State.DETACHING and commands(out) == [FollowRetreat]
    out = machine.handle(DONE)
    assert machine.state is State.PLANNING and commands(out) == [MakePlan]
    assert "turned" in machine.reason and machine.pushes == machine.replans == 1


def test_pushes_on_corners_that_lead_nowhere_come_to_an_end():
    machine, _ = make(max_replans=3)
    walk(machine, GOAL)
    count = 0
    while machine.busy and count < 10:
        out = walk(machine, turning(0), PATH, DONE, DONE, DONE, DONE)
        count += 1
    assert count == 4 and out[-1].code is JobError.EXECUTION_FAILED


def test_a_push_on_a_corner_that_fails_is_backed_off_from():
    machine, _ = make()
    walk(machine, GOAL, turning(0), PATH, DONE, DONE)
    assert commands(machine.handle(MotionFailed("stuck"))) == [FollowRetreat]
    assert commands(machine.handle(DONE)) == [MakePlan]


def test_the_last_push_ends_the_job_without_a_retreat():
    machine, answer = make()
    walk(machine, GOAL, planned(0, 1), PATH, DONE)
    answer["there"] = True  # a goal that a push passes by ends nothing
    assert commands(walk(machine, DONE, DONE)) == [FollowRetreat]
    out = walk(machine, DONE, PATH, DONE, DONE)
    assert machine.state is State.PUSHING and machine.index == 1
    out = machine.handle(DONE)
    assert commands(out) == [Stop, Finish] and out[-1].code is JobError.NONE
    assert machine.state is State.IDLE and machine.pushes == 2 and "reached" in machine.reason
    answer["there"], answer["touching"] = False, True
    assert commands(machine.handle(GOAL)) == [FollowRetreat], "the next job begins with it"


def almost(**changes):
    """A job whose last push has brought the object within tolerance, but not close."""
    machine, answer = make(close=False, **changes)
    walk(machine, GOAL, planned(0), PATH, DONE, DONE)
    answer["there"] = True
    return machine, answer, machine.handle(DONE)


def test_an_object_that_arrived_but_not_close_is_corrected_once():
    machine, _, out = almost()
    assert commands(out) == [FollowRetreat] and "error from its goal" in machine.reason
    out = machine.handle(DONE)
    assert commands(out) == [MakePlan] and machine.state is State.PLANNING and machine.replans == 1
    out = walk(machine, planned(2), PATH, DONE, DONE)
    assert commands(out) == [FollowPush] and machine.state is State.PUSHING
    out = machine.handle(DONE)
    assert commands(out) == [Stop, Finish], "one correction, whatever is left"
    assert out[-1].code is JobError.NONE and machine.pushes == 2


def test_without_corrections_an_object_that_arrived_is_there():
    machine, _, out = almost(max_corrections=0)
    assert commands(out) == [Stop, Finish] and out[-1].code is JobError.NONE
    assert machine.replans == 0


def test_a_correction_that_fails_leaves_the_goal_reached():
    machine, _, _ = almost()
    machine.handle(DONE)
    out = machine.handle(failed())
    assert commands(out) == [Finish], "no pre-emptive push for a correction"
    assert out[0].code is JobError.NONE and "the error was not corrected: m" in machine.reason

    machine, _, _ = almost(max_retries=0)
    walk(machine, DONE, planned(1))
    out = walk(machine, PathFailed("no way"))
    assert commands(out) == [Stop, Finish] and out[-1].code is JobError.NONE
    assert "no way" in machine.reason


def test_a_correction_that_loses_the_goal_is_followed_by_new_plans():
    machine, answer, _ = almost()
    walk(machine, DONE, planned(1), PATH, DONE, DONE)
    answer["there"] = False
    assert commands(machine.handle(MotionFailed("slipped"))) == [FollowRetreat]
    assert commands(machine.handle(DONE)) == [MakePlan]
    out = machine.handle(failed(retry=False))
    assert commands(out) == [Finish] and out[0].code is JobError.PLANNING_FAILED


def test_a_canceled_correction_is_canceled():
    machine, _, _ = almost()
    walk(machine, DONE, planned(1), PATH)
    out = machine.handle(CancelCommanded())
    assert out[-1].code is JobError.CANCELED


def test_the_next_job_may_be_corrected_again():
    machine, answer, _ = almost()
    walk(machine, DONE, failed())
    answer["there"] = False
    walk(machine, GOAL, planned(0), PATH, DONE, DONE)
    answer["there"] = True
    assert commands(machine.handle(DONE)) == [FollowRetreat]


@pytest.mark.parametrize(
    ("away", "turned", "there", "close"),
    [
        (0.0, 0.0, True, True),
        (0.0039, 0.039, True, True),
        (0.0041, 0.0, True, False),
        (0.0, 0.041, True, False),
        (0.0121, 0.0, False, False),
        (0.0, 0.061, False, False),
        (float("inf"), float("inf"), False, False),
    ],
)
def test_arrival(away, turned, there, close):
    found = arrival(SupervisorSettings(), away, turned)
    assert (found.there, found.close) == (there, close)


def test_waits_for_the_execute_command():
    machine, _ = make(auto_execute=False)
    walk(machine, GOAL, planned(0))
    assert machine.state is State.IDLE and machine.plan_ready
    out = machine.handle(ExecuteCommanded())
    assert machine.state is State.POSITIONING and commands(out) == [FindPath]


def test_plan_only_waits_even_when_execution_is_automatic():
    machine, _ = make()
    machine.handle(GoalGiven("g", plan_only=True))
    walk(machine, planned(0))
    assert machine.plan_ready


def test_already_there_needs_no_plan():
    machine, _ = make(there=True)
    out = walk(machine, GOAL)
    assert type(out[-1]) is Finish and out[-1].code is JobError.NONE


def failed(retry=True, crowded=False):
    return PlanFailed(JobError.PLANNING_FAILED, "m", retry, crowded)


def asked(preemptive=False, later=False):
    return MakePlan("g", preemptive, later)


def test_after_a_failure_a_pre_emptive_push_is_asked_for_once():
    """Section 2.5, S2: the plan that comes back has it as its first push."""
    machine, _ = make()
    assert walk(machine, GOAL) == [asked()]
    assert walk(machine, failed()) == [asked(preemptive=True)]
    assert machine.state is State.PLANNING and "pre-emptive push" in machine.reason
    walk(machine, planned(3, 1))
    assert [s.side for s in machine.segments] == [3, 1]


def test_gives_up_when_no_pre_emptive_push_helps():
    machine, _ = make()
    out = walk(machine, GOAL, failed(), failed())
    assert out[-1].code is JobError.PLANNING_FAILED and machine.state is State.IDLE


def test_others_in_the_way_are_waited_for_and_given_up_on_in_the_end():
    machine, _ = make(max_waits=2)
    crowd = failed(crowded=True)
    walk(machine, GOAL)
    for _ in range(2):
        assert walk(machine, crowd) == [asked(preemptive=True)]
        assert walk(machine, crowd) == [asked(later=True)]
    assert walk(machine, crowd) == [asked(preemptive=True)]
    assert walk(machine, crowd)[-1].code is JobError.PLANNING_FAILED


def test_others_in_the_robots_way_are_waited_for_after_the_retries():
    machine, _ = make(max_retries=1, max_waits=2)
    no_path = PathFailed("m", crowded=True)
    walk(machine, GOAL, planned(0))
    assert commands(walk(machine, no_path)) == [FollowRetreat]
    walk(machine, DONE, planned(0))
    for _ in range(2):
        (out,) = walk(machine, no_path)
        assert type(out) is FindPath and out.later
    assert walk(machine, no_path)[-1].code is JobError.POSITIONING_FAILED


@pytest.mark.parametrize("failure", [False, True])
def test_a_robot_at_the_object_backs_off_before_it_plans(failure):
    """After a cancel, a new goal in a push, or another supervisor's end: no planning round lost."""
    machine, answer = make(touching=True)
    assert commands(walk(machine, GOAL)) == [FollowRetreat]
    assert machine.state is State.DETACHING and "backing off first" in machine.reason
    # Not even the way back may be free: plan from here, and do not try again.
    event = MotionFailed("stuck") if failure else DONE
    assert (
        walk(machine, event) == [asked()]
        and machine.state is State.PLANNING
        and machine.replans == 0
    )
    answer["touching"] = False
    walk(machine, planned(0))
    assert machine.state is State.POSITIONING


def test_a_robot_at_the_object_does_not_move_before_it_may():
    machine, _ = make(touching=True)
    assert machine.handle(GoalGiven("g", plan_only=True)) == [asked()]
    walk(machine, planned(0))
    assert machine.plan_ready
    assert commands(machine.handle(ExecuteCommanded())) == [FollowRetreat]
    assert commands(walk(machine, DONE)) == [FindPath] and machine.replans == 0


def test_a_robot_that_was_backing_off_goes_on_with_it_when_its_controller_returns():
    machine, _ = make(touching=True)
    walk(machine, GOAL)
    lost = machine.handle(MotionFailed("gone", lost=True))
    assert commands(lost) == [FollowRetreat]
    assert walk(machine, DONE) == [asked()] and machine.replans == 0


def test_a_moved_object_next_to_the_robot_is_backed_off_from():
    machine, answer = make()
    walk(machine, GOAL, planned(0), PATH)
    answer["touching"] = True
    out = machine.handle(ObjectMoved("moved"))
    assert commands(out) == [Stop, FollowRetreat]
    assert walk(machine, DONE) == [asked()] and machine.replans == 1


NEW_MAP = MapChanged("push 1 meets a wall")


@pytest.mark.parametrize("blocked", [NEW_MAP, WayBlocked("a body stands there")])
@pytest.mark.parametrize("steps", range(8))
def test_a_map_or_a_body_that_blocks_the_plan_makes_it_anew_in_every_state(steps, blocked):
    machine, _ = make()
    walk(machine, *[GOAL, planned(0, 1), PATH, DONE, DONE, DONE, DONE][:steps])
    before = machine.state
    out = commands(machine.handle(blocked))
    if before in (State.IDLE, State.PLANNING):
        assert out == [] and machine.state is before
    elif before in (State.POSITIONING, State.APPROACH):
        assert out == [Stop, MakePlan] and machine.replans == 1
    else:
        assert out == ([FollowRetreat] if before is State.PUSHING else [])
        assert walk(machine, DONE) == [asked()] and machine.replans == 1


def test_a_map_that_blocks_nothing_only_makes_the_way_anew():
    machine, _ = make()
    free = MapChanged()
    walk(machine, GOAL, planned(0), PATH)
    assert commands(walk(machine, free)) == [Stop, FindPath]
    for event in (PATH, DONE, DONE):
        before = walk(machine, event)
        assert before and (machine.state is State.POSITIONING or walk(machine, free) == [])
    assert machine.replans == 0


def test_a_waiting_plan_that_a_map_blocks_is_made_anew_and_waits_again():
    machine, _ = make(auto_execute=False, touching=True)
    walk(machine, GOAL, planned(0))
    assert walk(machine, NEW_MAP) == [asked()]
    walk(machine, planned(1))
    assert machine.plan_ready and machine.replans == 0


def test_what_remains_of_a_plan():
    machine, _ = make()
    walk(machine, GOAL, planned(0, 1))
    left = []
    for event in (PATH, DONE, DONE, DONE, DONE, PATH, DONE, DONE, DONE):
        left.append(len(machine.remaining))
        walk(machine, event)
    assert left == [2, 2, 2, 2, 1, 1, 1, 1, 1] and machine.remaining == []


def test_hopeless_goal_is_not_retried():
    machine, _ = make()
    out = walk(machine, GOAL, failed(retry=False))
    assert commands(out) == [Finish]


def test_failed_push_backs_off_and_plans_anew_from_where_the_object_is():
    machine, _ = make()
    walk(machine, GOAL, planned(0), PATH, DONE, DONE)
    out = machine.handle(MotionFailed("contact lost"))
    assert machine.state is State.DETACHING and commands(out) == [FollowRetreat]
    out = walk(machine, DONE)
    assert machine.state is State.PLANNING and out == [asked()]
    assert "contact lost" in machine.reason


def test_replans_are_bounded():
    machine, _ = make(max_replans=2)
    out = walk(machine, GOAL)
    for _ in range(3):
        walk(machine, planned(0), PATH, DONE, DONE)
        out = machine.handle(MotionFailed("slipped"))
        out = walk(machine, DONE)
    assert out[-1].code is JobError.EXECUTION_FAILED and "slipped" in machine.reason


def push_once(machine, *sides):
    """From PLANNING through the first push of a plan."""
    walk(machine, planned(*sides), PATH, DONE, DONE, DONE)


def test_a_move_by_somebody_else_costs_nothing_when_a_push_was_done_in_between():
    """Each time the second side of the plan is to be pushed, the object is moved again."""
    machine, _ = make(max_replans=2)
    walk(machine, GOAL)
    for count in range(1, 11):
        push_once(machine, 0, 1)
        walk(machine, DONE)
        assert machine.state is State.POSITIONING
        walk(machine, ObjectMoved("moved"))
        assert machine.state is State.PLANNING and machine.replans == count
    push_once(machine, 0)
    assert machine.pushes == 11 and machine.error is JobError.NONE


def test_an_object_that_is_moved_before_any_push_has_its_own_code():
    machine, _ = make(max_replans=2)
    walk(machine, GOAL)
    for _ in range(2):
        walk(machine, planned(0), ObjectMoved("moved"))
        assert machine.state is State.PLANNING
    out = walk(machine, planned(0), ObjectMoved("moved"))
    assert commands(out) == [Stop, Finish] and out[-1].code is JobError.OBJECT_MOVED
    assert "3 times" in machine.reason and machine.replans == 2


def test_progress_renews_the_budget_of_new_plans():
    """Four sides to push; each push fails once, and so does the way back from all but the last."""
    machine, _ = make(max_replans=2)
    walk(machine, GOAL)
    for left in (3, 2, 1, 0):
        walk(machine, planned(*range(left + 1)), PATH, DONE, DONE, MotionFailed("slipped"), DONE)
        assert machine.state is State.PLANNING
        push_once(machine, *range(left + 1))
        if left:
            walk(machine, MotionFailed("slipped on the way back"))
            assert machine.state is State.PLANNING
    assert machine.replans == 7 and machine.error is JobError.NONE


def test_pushes_that_lead_nowhere_do_not_renew_it():
    """The first of two pushes is always done, the second never: that ends."""
    machine, _ = make(max_replans=2)
    walk(machine, GOAL)
    for _ in range(3):
        push_once(machine, 0, 1)
        out = walk(machine, DONE, PATH, DONE, DONE, MotionFailed("slipped"), DONE)
    assert out[-1].code is JobError.EXECUTION_FAILED and machine.pushes == 3


def test_off_target_after_the_last_push_plans_anew():
    machine, _ = make(max_replans=0)
    out = walk(machine, GOAL, planned(0), PATH, DONE, DONE, DONE, DONE)
    assert out[-1].code is JobError.OFF_TARGET


def test_moved_object_stops_the_robot_and_plans_anew():
    machine, _ = make()
    walk(machine, GOAL, planned(0), PATH)
    out = machine.handle(ObjectMoved("moved"))
    assert commands(out) == [Stop, MakePlan] and machine.state is State.PLANNING


def test_lost_controller_is_waited_for_and_given_up_on_in_the_end():
    machine, _ = make(max_losses=3)
    lost = MotionFailed("gone", lost=True)
    walk(machine, GOAL, planned(0), PATH, DONE, DONE)
    for _ in range(3):  # back off first, whoever does it: the robot stands at the object
        assert commands(walk(machine, lost)) == [FollowRetreat]
    assert commands(walk(machine, DONE)) == [MakePlan] and "gone" in machine.reason
    walk(machine, planned(0), PATH)
    assert commands(walk(machine, lost)) == [FindPath]
    walk(machine, PATH, DONE, *[lost] * 3)
    assert walk(machine, lost)[-1].code is JobError.NODE_LOST


@pytest.mark.parametrize("steps", range(1, 8))
@pytest.mark.parametrize(
    ("event", "code"),
    [(CancelCommanded(), JobError.CANCELED), (ClockReset(), JobError.CLOCK_RESET)],
)
def test_cancel_and_reset_stop_in_every_state(steps, event, code):
    machine, _ = make()
    walk(machine, *[GOAL, planned(0), PATH, DONE, DONE, DONE][:steps])
    halt = {State.IDLE: [], State.PLANNING: [CancelPlan]}.get(machine.state, [Stop])
    out = machine.handle(event)
    assert commands(out) == [*halt, Finish]
    assert out[-1].code is code and machine.state is State.IDLE and not machine.busy


def test_new_goal_replaces_the_old_one():
    machine, _ = make()
    walk(machine, GOAL, planned(0), PATH)
    out = machine.handle(GoalGiven("h"))
    assert commands(out) == [Stop, Finish, MakePlan]
    assert out[1].code is JobError.PREEMPTED and machine.goal == "h"


ANY = st.sampled_from(
    [
        GOAL,
        ExecuteCommanded(),
        CancelCommanded(),
        planned(0),
        planned(0, 1),
        planned(1, 1),
        turning(0, 1),
        failed(),
        failed(False),
        failed(crowded=True),
        PATH,
        PathFailed("m"),
        PathFailed("m", crowded=True),
        DONE,
        MotionFailed("m"),
        MotionFailed("m", lost=True),
        ObjectMoved("m"),
        MapChanged("p"),
        WayBlocked("p"),
        MapChanged(),
        RepairLate(),
        PlanFound((segment(2),), improving=True),
        JobAborted(JobError.PREEMPTED, "m"),
        ClockReset(),
    ]
)
MOTIONS = {
    FollowPath,
    FollowApproach,
    FollowPush,
    FollowTurn,
    FollowRetreat,
}


@given(st.lists(ANY, max_size=60), *[st.booleans()] * 5)
def test_invariants_of_any_walk(events, automatic, there, touching, close, free):
    machine, _ = make(there, touching, close, free, auto_execute=automatic)
    allowed, left = automatic, False
    for event in events:
        before = machine.state
        allowed = automatic or (
            isinstance(event, ExecuteCommanded) if machine.plan_ready else allowed and machine.busy
        )
        told = machine.handle(event)
        out = commands(told)
        assert sum(c in MOTIONS for c in out) <= 1
        assert not left or Stop in out or Repair in out  # a push that went on for a new goal
        left = any(isinstance(c, Finish) and c.going_on for c in told)
        assert not left or before is State.PUSHING
        assert machine.state is State.PUSHING or not machine.repairing
        if MOTIONS & set(out):
            assert machine.state not in (State.IDLE, State.PLANNING)
            assert allowed  # nothing moves a robot before it may
        if machine.state is State.PUSHING:
            assert machine.index < len(machine.segments)
        if machine.state is State.IDLE and before not in (State.IDLE, State.PLANNING):
            # nothing moves a robot after a job has ended
            assert Stop in out or before is State.DETACHING or left
            assert Finish in out
        if Finish in out and machine.state is State.IDLE:
            assert not machine.busy and machine.segments == []
        assert machine.reason


def test_bodies_on_the_way_cost_no_setback_but_not_without_end():
    machine, _ = make(max_replans=1, max_waits=6)
    walk(machine, GOAL, planned(0))
    for _ in range(6):
        assert commands(machine.handle(WayBlocked("a body"))) == [Stop, MakePlan]
        walk(machine, planned(0))
    out = walk(machine, WayBlocked("a body"))
    assert commands(out) == [Stop, Finish] and out[1].code is JobError.EXECUTION_FAILED
