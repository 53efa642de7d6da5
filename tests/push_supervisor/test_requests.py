"""Asking, waiting and giving up, with a clock of our own; and an exhaustive random walk."""

import math
import typing

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as budget
from hypothesis import strategies as st

from push_model.jobs import JobError
from push_supervisor import Moment, Peer, Request, Requests, Step, SupervisorSettings
from push_supervisor.commands import (
    FindPath,
    FollowApproach,
    FollowPath,
    FollowPush,
    FollowRetreat,
    FollowTurn,
    MakePlan,
    Question,
)
from push_supervisor.requests import ASKS, PEERS

SETTINGS = SupervisorSettings(
    node_timeout=5.0, answer_timeout=2.0, controller_timeout=1.0, wait=3.0
)
PLAN, PUSH = Request(MakePlan("g")), Request(FollowPush("s"))
QUESTIONS = (
    MakePlan("g"),
    FindPath("s"),
    FollowPath("t"),
    FollowApproach("s"),
    FollowPush("s"),
    FollowTurn("s"),
    FollowRetreat(),
)
ALL = frozenset(Peer)


def at(wall, stamp=None, poses=True, ready=ALL):
    return Moment(wall, wall if stamp is None else stamp, poses, ready.__contains__)


def begun(request, now=None):
    requests = Requests(SETTINGS)
    requests.begin(request, now or at(0.0))
    return requests


def test_everything_that_is_asked_for_has_somebody_to_ask():
    assert set(PEERS) == set(typing.get_args(Question)) == set(map(type, QUESTIONS))


def test_asked_at_once_and_answered():
    requests = begun(PLAN)
    assert requests.tend(at(0.0)).step is Step.ASK and requests.request is PLAN
    assert requests.tend(at(1.0)).step is Step.WAIT
    assert not requests.answer(requests.number - 1)
    assert requests.answer(requests.number) and requests.request is None
    assert not requests.answer(requests.number)  # once
    assert requests.tend(at(100.0)).step is Step.WAIT


@pytest.mark.parametrize("missing", ["poses", "node"])
def test_waits_for_poses_and_for_the_node_and_gives_up_in_the_end(missing):
    requests = begun(PLAN)
    poses, ready = missing != "poses", frozenset() if missing == "node" else ALL
    for wall in (0.0, 3.0, 5.0):
        assert requests.tend(at(wall, 0.0, poses, ready)).step is Step.WAIT
    verdict = requests.tend(at(5.1, 0.0, poses, ready))
    assert verdict.step is Step.GIVE_UP and verdict.message
    assert verdict.code is (JobError.POSES_STALE if missing == "poses" else JobError.NODE_LOST)
    assert requests.request is None


def test_a_node_that_returns_in_time_is_asked():
    requests = begun(PLAN)
    assert requests.tend(at(0.0, ready=frozenset())).step is Step.WAIT
    assert requests.tend(at(4.9)).step is Step.ASK


def test_only_the_peer_of_the_errand_counts():
    assert begun(PLAN).tend(at(0.0, ready=ALL - {Peer.PLANNER})).step is Step.WAIT
    assert begun(PLAN).tend(at(0.0, ready=frozenset({Peer.PLANNER}))).step is Step.ASK


def test_a_silent_planner_is_asked_again_and_given_up_on_after_three_times():
    requests = begun(PLAN)
    numbers = set()
    for wall in (0.0, 2.1, 4.2):
        assert requests.tend(at(wall)).step is Step.ASK
        assert not any(requests.answer(late) for late in numbers)
        numbers.add(requests.number)
    assert len(numbers) == requests.asks == ASKS
    verdict = requests.tend(at(6.3))
    assert (verdict.step, verdict.code) == (Step.GIVE_UP, JobError.NODE_LOST)


def test_a_planner_that_shows_signs_of_life_may_take_for_ever():
    requests = begun(PLAN)
    requests.tend(at(0.0))
    for wall in range(1, 1000):
        requests.sign(requests.number, at(float(wall)))
        assert requests.tend(at(wall + 0.9)).step is Step.WAIT
    requests.sign(requests.number - 1, at(1000.0))  # of an earlier question: says nothing
    assert requests.tend(at(1001.1)).step is Step.ASK


@pytest.mark.parametrize(
    ("wall", "stamp", "lost"), [(5.0, 0.9, False), (0.9, 5.0, False), (1.1, 1.1, True)]
)
def test_a_controller_is_lost_when_both_clocks_say_so(wall, stamp, lost):
    requests = begun(PUSH)
    requests.tend(at(0.0))
    verdict = requests.tend(at(wall, stamp))
    assert verdict.step is (Step.LOST if lost else Step.WAIT)
    assert (requests.request is None) == lost


def locked(clock, ready=ALL):
    """In lockstep: the clock is that of the poses."""
    return Moment(clock, clock, True, ready.__contains__, lockstep=True)


@pytest.mark.parametrize("request_", [PLAN, Request(FindPath("s"))])
def test_in_lockstep_a_planner_is_lost_only_when_it_leaves_the_graph(request_):
    requests = begun(request_, locked(0.0))
    assert requests.tend(locked(0.0)).step is Step.ASK
    for clock in (3.0, 1e3, 1e9):  # fast simulations and slow planners
        assert requests.tend(locked(clock)).step is Step.WAIT and requests.asks == 1
    gone = frozenset()
    assert requests.tend(locked(1e9 + 2.1, gone)).step is Step.WAIT and requests.asks == 1
    assert requests.tend(locked(1e9 + 7.0, gone)).step is Step.WAIT
    verdict = requests.tend(locked(1e9 + 7.2, gone))  # 5 s after it was to be asked again
    assert (verdict.step, verdict.code) == (Step.GIVE_UP, JobError.NODE_LOST)


@pytest.mark.parametrize("request_", [PLAN, Request(FindPath("s"))])
@pytest.mark.parametrize("away", [0.5, 3.0])  # [s] shorter and longer than answer_timeout
def test_in_lockstep_a_planner_that_was_restarted_is_asked_again(request_, away):
    requests = begun(request_, locked(0.0))
    requests.tend(locked(0.0))
    for clock in np.arange(0.1, away, 0.1):
        assert requests.tend(locked(clock, frozenset())).step is Step.WAIT
    steps = [requests.tend(locked(clock)).step for clock in np.arange(away, away + 2.2, 0.1)]
    assert steps.count(Step.ASK) == 1 and requests.asks == 2
    assert requests.tend(locked(1e9)).step is Step.WAIT


def test_in_lockstep_a_planner_that_was_only_frozen_is_not_asked_again():
    """Its server leaves the graph while it is stopped; then it goes on, and says so."""
    requests = begun(PLAN, locked(0.0))
    requests.tend(locked(0.0))
    assert requests.tend(locked(1.0, frozenset())).step is Step.WAIT
    requests.sign(requests.number, locked(1.5))
    for clock in (2.1, 1e3):
        assert requests.tend(locked(clock)).step is Step.WAIT and requests.asks == 1


def test_without_poses_a_silent_controller_is_not_waited_for_for_ever():
    """Bridge and controller are gone: pose time stands still."""
    requests = begun(PUSH)
    requests.tend(at(0.0, 0.0))
    for wall in (1.1, 4.9):
        assert requests.tend(at(wall, 0.0, poses=False, ready=frozenset())).step is Step.WAIT
    verdict = requests.tend(at(5.1, 0.0, poses=False, ready=frozenset()))
    assert (verdict.step, verdict.code) == (Step.GIVE_UP, JobError.POSES_STALE)
    assert requests.request is None


def test_in_lockstep_a_controller_answers_in_pose_time():
    requests = begun(PUSH, locked(0.0))
    requests.tend(locked(0.0))
    assert requests.tend(locked(1.0)).step is Step.WAIT
    assert requests.tend(locked(1.1)).step is Step.LOST


def test_a_delay_is_counted_in_pose_time():
    requests = begun(Request(MakePlan("g"), 3.0), at(10.0, 20.0))
    assert requests.tend(at(1000.0, 22.9)).step is Step.WAIT
    assert requests.tend(at(1000.0, 23.0)).step is Step.ASK


def test_what_is_dropped_is_not_asked_and_not_answered():
    requests = begun(PLAN)
    requests.tend(at(0.0))
    number = requests.number
    requests.drop()
    assert not requests.answer(number) and requests.tend(at(50.0)).step is Step.WAIT


EVENTS = st.one_of(
    st.tuples(st.just("begin"), st.sampled_from(QUESTIONS), st.sampled_from([0.0, 3.0])),
    st.tuples(st.just("tend"), st.floats(0.0, 4.0), st.sets(st.sampled_from(Peer))),
    st.tuples(st.just("blind"), st.floats(0.0, 4.0), st.none()),
    st.tuples(st.just("sign"), st.integers(-1, 0), st.none()),
    st.tuples(st.just("answer"), st.integers(-1, 0), st.none()),
    st.tuples(st.just("drop"), st.none(), st.none()),
)


@budget(max_examples=200)
@given(st.lists(EVENTS, max_size=60))
def test_invariants_of_any_walk(events):
    requests = Requests(SETTINGS)
    wall, since_heard, asks, current, begun_at = 0.0, 0.0, 0, None, 0.0
    for kind, a, b in events:
        if kind == "begin":
            requests.begin(Request(a, b), at(wall))
            asks, current, begun_at = 0, None, wall + b
        elif kind == "drop":
            requests.drop()
            assert requests.request is None
            current = None
        elif kind == "sign":
            requests.sign(requests.number + a, at(wall))
            since_heard = wall if a == 0 else since_heard
        elif kind == "answer":
            number = requests.number + a
            accepted = requests.answer(number)
            assert accepted == (current is not None and number == current)
            current = None if accepted else current
        else:
            wall += a
            now = at(wall, poses=kind == "tend", ready=frozenset(b or ()))
            request = requests.request
            verdict = requests.tend(now)
            if verdict.step is Step.ASK:
                assert request is not None and now.poses and now.ready(request.peer)
                assert wall >= begun_at  # not before its delay
                assert requests.number != current  # earlier questions are void
                if current is not None:
                    assert request.peer is not Peer.CONTROLLER
                    assert wall - since_heard > SETTINGS.answer_timeout
                asks, current, since_heard = asks + 1, requests.number, wall
                assert asks == requests.asks <= ASKS
            elif verdict.step is Step.WAIT:
                if request is not None and current is not None and current != requests.number:
                    current = None  # given up on, to be asked again
                if current is not None:
                    least = SETTINGS.answer_timeout
                    if request.peer is Peer.CONTROLLER:
                        least = SETTINGS.controller_timeout
                    assert wall - since_heard <= least
            else:
                assert requests.request is None and verdict.code in (
                    JobError.NODE_LOST,
                    JobError.POSES_STALE,
                )
                current = None


@pytest.mark.parametrize("command", QUESTIONS)
@pytest.mark.parametrize("seed", range(60))
def test_every_errand_ends_when_nobody_answers(command, seed):
    """Whatever comes and goes in between: bounded by the times of waiting and asking."""
    random = np.random.default_rng(seed)
    often = random.uniform(0.0, 1.0, 2)
    requests = begun(Request(command))
    ended = math.inf
    for step in range(200):
        poses, there = random.random(2) < often
        now = at(0.5 * step, poses=bool(poses), ready=ALL if there else frozenset())
        if requests.tend(now).step in (Step.GIVE_UP, Step.LOST):
            ended = now.clock
            break
    assert ended <= ASKS * (SETTINGS.node_timeout + SETTINGS.answer_timeout + 1.0)
