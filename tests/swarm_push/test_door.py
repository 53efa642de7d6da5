"""A task is judged beside the ticks of the job under way: none is long, and the answer is the same
as at once."""

import time

import numpy as np
import pytest

from push_job.method import Arena, Certificate, Refusal, Seen, Task
from push_model.belief import Belief
from push_model.jobs import GoalRefused, JobError
from push_model.occupancy import rasterise
from push_model.specs import BoxSpec, EnvironmentSpec
from push_ros.door import Door
from push_scenario.bodies import load_object, load_robot
from swarm_push.swarm_method import SwarmMethod
from tests.samples import mostly_long
from tests.swarm_push.test_object_track import PART, TICK, snake

ITEM, ROBOT = load_object("transport_l"), load_robot("epuck_ring")
NAMES = tuple(f"e{k}" for k in range(20))
BELIEF = Belief({"box": ITEM}, dict.fromkeys(NAMES, ROBOT))


def method_in(grid):
    return SwarmMethod(Arena(grid, dict.fromkeys(NAMES, ROBOT), "box", ITEM))


def team(pose):
    random = np.random.default_rng(1)
    spots = pose[:2] + random.uniform(0.5, 1.2, (len(NAMES), 2))
    return {n: np.array([*p, 0.0]) for n, p in zip(NAMES, spots, strict=True)}


def door_of(method, seen):
    """A door as a method's node has it."""

    def judge(task):
        found = yield from method.assess_in_slices(task, BELIEF, seen())
        if isinstance(found, Refusal):
            raise GoalRefused(found.code, found.reason)

    return Door(judge)


def rehearse(goals, ticks):
    """A job to the first goal; at tick 20 the others are asked for, as one task. Thread CPU [s] of
    each tick, the tick at which the answer came, the answer."""
    grid, pose, _ = snake(16.0, 0.01)
    method, robots = method_in(grid), team(pose)
    method.begin(Task(goals[:1]), BELIEF)
    state, answers, spent, answered = [Seen(0.0, pose, robots)], [], [], None
    door = door_of(method, lambda: state[0])
    for tick in range(ticks):
        state[0] = Seen(tick * TICK, pose, robots)
        began = time.thread_time()
        told = method.step(state[0], BELIEF)
        if tick == 20:
            door.ask(Task(goals[1:]), answers.append)
        door.go_on()
        if answers and answered is None:
            answered = tick
        spent.append(time.thread_time() - began)
        assert method.job.busy, method.job.reason
        for name, (v, w) in told.commands.items():
            here = robots[name]
            here += TICK * np.array([v * np.cos(here[2]), v * np.sin(here[2]), w])
    return np.array(spent), answered, answers


def judge_at_once(grid, pose, goals):
    """Thread CPU [s]."""
    method, seen = method_in(grid), Seen(0.0, pose, team(pose))
    began = time.thread_time()
    assert isinstance(method.assess(Task(goals), BELIEF, seen), Certificate)
    return time.thread_time() - began


@pytest.mark.live  # alone: others make its ticks longer
@pytest.mark.parametrize("targets", [1, pytest.param(2, marks=pytest.mark.long)])
def test_no_tick_is_long_while_a_task_is_judged_in_a_large_room_with_walls(targets):
    """20 robots, 16 m; each tick by the shortest of its times in three equal runs, against the
    answer at once on the same machine, which may be slow or busy."""
    grid, pose, goal = snake(16.0, 0.01)
    goals = (goal, goal + [-0.3, -0.4, 0.2], pose)[: 1 + targets]
    runs = [rehearse(goals, 60 + 300 * targets) for _ in range(3)]
    whole = min(judge_at_once(grid, pose, goals[1:2]) for _ in range(3))
    spent = np.min([run[0] for run in runs], axis=0)
    _, tick, (refusal,) = runs[0]
    longest = f"longest {1e3 * spent.max():.1f} ms, answered after {tick - 20} ticks"
    print(f"{longest}; at once {whole:.2f} s")
    assert runs[1][1] == tick and refusal is None
    assert tick - 20 > 20  # far more than there is time for in one tick
    assert spent.max() < PART * whole


@pytest.mark.parametrize("seed", mostly_long(range(40), 5))
def test_the_answer_in_slices_is_the_answer_at_once(seed):
    """Rooms, loads and goals at random, reachable or not."""
    random = np.random.default_rng(seed)
    boxes = tuple(
        BoxSpec(tuple(random.uniform(-1.6, 1.6, 2)), tuple(random.uniform(0.1, 1.5, 2)))
        for _ in range(3)
    )
    grid = rasterise(EnvironmentSpec((4.0, 4.0), boxes, resolution=0.02))
    method = method_in(grid)
    pose = np.array([*random.uniform(-1.5, 1.5, 2), 0.0])
    robots = {
        n: np.array([*random.uniform(-1.9, 1.9, 2), 0.0]) for n in NAMES[: random.integers(1, 9)]
    }
    seen = Seen(0.0, pose, robots)
    task = Task(tuple(random.uniform(-1.7, 1.7, (random.integers(1, 3), 3))))
    answers = []
    door = door_of(method, lambda: seen)
    door.ask(task, answers.append)
    while door.busy:
        door.go_on()
    found = method.assess(task, BELIEF, seen)
    (refusal,) = answers
    if isinstance(found, Certificate):
        assert refusal is None
    else:
        assert (refusal.code, str(refusal)) == (found.code, found.reason)


def test_answers_of_rooms_at_random_are_of_both_kinds():
    """So that the test above compares refusals too."""
    shut = (BoxSpec((0.8, 0.0), (0.1, 4.0)),)
    grid = rasterise(EnvironmentSpec((4.0, 4.0), shut, resolution=0.02))
    answers, seen = [], Seen(0.0, np.zeros(3), team(np.array([-1.5, -0.8, 0.0])))
    door = door_of(method_in(grid), lambda: seen)
    door.ask(Task((np.array([1.4, 0.0, 0.0]),)), answers.append)
    while door.busy:
        door.go_on()
    assert answers[0].code is JobError.PLANNING_FAILED and "no way" in str(answers[0])
