"""The reactive pusher: where it gets to, and that it ends where it does not get on."""

import numpy as np
import pytest

from push_job.method import Arena, Refusal, Seen, Task
from push_model import se2
from push_model.belief import Belief
from push_model.jobs import JobError, JobPhase
from push_model.occupancy import rasterise
from push_model.settings import SettingsError
from push_model.specs import EnvironmentSpec
from push_scenario.bodies import load_object, load_robot
from push_study.rivals.reactive import METHOD, ReactivePusher, ReactiveSettings
from push_study.team_run import OBJECT, made_scenario, run_team
from push_study.uncertainty import uncertainty
from sim_bridge.planar_world import PlanarWorld
from tests.samples import mostly_long

ROBOT, BOX = load_robot("epuck"), load_object("box9")
ROOM = EnvironmentSpec((3.0, 2.4))
BELIEF = Belief({OBJECT: BOX}, {"e0": ROBOT})
START = np.array([-0.8, 0.0, 0.0])
AHEAD = Task((np.array([0.5, 0.1, 0.2]),))


def seen_at(time, item, robot):
    return Seen(time, item, {"e0": robot})


HERE = seen_at(0.0, START, np.array([-1.1, 0.0, 0.0]))


def arena(**settings):
    own = {"": ReactiveSettings(**settings)}
    return Arena(rasterise(ROOM), {"e0": ROBOT}, OBJECT, BOX, own)


class Pushed:
    """A task in the planar world, frame by frame, with exact poses."""

    def __init__(self, goal, start=START, **settings):
        self.method = ReactivePusher(arena(**settings))
        self.method.begin(Task((np.array(goal),)), BELIEF)
        behind = se2.compose(start, np.array([-0.25, 0.0, 0.0]))
        self.world = PlanarWorld(ROOM, {"e0": (ROBOT, behind)}, {OBJECT: (BOX, start)})
        self.time = 0.0

    @property
    def poses(self):
        found = self.world.poses()
        return found[OBJECT], found["e0"]

    def until_it_ends(self, limit=150.0):
        while self.method.status.phase != JobPhase.IDLE and self.time < limit:
            self.time += 0.01
            told = self.method.step(seen_at(self.time, *self.poses), BELIEF)
            self.world.command("e0", *told.commands.get("e0", (0.0, 0.0)))
            self.world.step(round(0.01 / self.world.time_step))
        return self.method.status


@pytest.mark.parametrize("seed", mostly_long(range(40), 4))
def test_goals_ahead_are_reached_and_the_end_is_always_told(seed):
    """Random goals within 40 degrees of straight ahead, with headings that a bend can reach."""
    random = np.random.default_rng(seed)
    away, aside = random.uniform(0.9, 1.6), random.uniform(-0.7, 0.7)
    heading = aside + random.uniform(-0.5, 0.5)
    goal = se2.compose(START, np.array([away * np.cos(aside), away * np.sin(aside), heading]))
    run = Pushed(goal)
    status = run.until_it_ends()
    off = se2.between(goal, run.poses[0])
    assert status.phase == JobPhase.IDLE and status.pushes >= 1
    assert status.code == JobError.NONE, status.reason
    assert np.hypot(*off[:2]) <= 0.02 and abs(off[2]) <= 0.1


def test_an_object_that_is_held_fast_ends_its_attempts():
    """Its goal is behind it, and walls are where it would have to turn."""
    run = Pushed([-1.1, 0.9, 2.0], start=np.array([1.2, -1.0, -0.3]), attempts=2)
    status = run.until_it_ends()
    assert status.phase == JobPhase.IDLE and status.code != JobError.NONE
    assert status.reason


def test_a_robot_without_room_to_back_off_goes_on_from_where_it_is():
    """It stands between the object and a wall."""
    robot = np.array([-1.454, 0.0, 0.0])
    item = se2.compose(robot, np.array([ROBOT.push_distance + 0.045, 0.0, 0.0]))
    run = Pushed([0.5, 0.9, 1.0], start=item)
    run.world = PlanarWorld(ROOM, {"e0": (ROBOT, robot)}, {OBJECT: (BOX, item)})
    status = run.until_it_ends(60.0)
    assert status.phase == JobPhase.IDLE and status.code == JobError.NONE, status
    assert status.pushes >= 1


@pytest.mark.parametrize(
    ("task", "words"),
    [
        (Task((np.array([0.3, 0.0, np.nan]),)), "needs a heading"),
        (Task(AHEAD.targets, (10.0,)), "a single goal, without times"),
        (Task(AHEAD.targets * 2), "a single goal, without times"),
    ],
)
def test_what_it_cannot_do_is_refused_with_the_reason(task, words):
    refused = METHOD.make(arena()).assess(task, BELIEF, HERE)
    assert isinstance(refused, Refusal) and refused.code is JobError.INVALID_GOAL
    assert words in refused.reason


def test_teams_it_cannot_drive_are_refused():
    with pytest.raises(SettingsError, match="method 'reactive' takes one"):
        METHOD.check({"e0": ROBOT, "e1": ROBOT}, BOX)
    with pytest.raises(SettingsError, match="flat bumper"):
        METHOD.check({"e0": load_robot("epuck_ring")}, BOX)


def test_an_object_at_its_goal_stays_there():
    method = ReactivePusher(arena())
    method.begin(Task((START,)), BELIEF)
    method.step(HERE, BELIEF)
    assert method.status.phase == JobPhase.IDLE and method.status.code == JobError.NONE
    assert method.errors(HERE) == (0.0, 0.0) and method.release() == {"e0"}


def test_a_robot_that_is_not_seen_stands_and_then_ends_the_task():
    method = ReactivePusher(arena())
    method.begin(AHEAD, BELIEF)
    method.step(HERE, BELIEF)
    told = [method.step(Seen(0.01 * k, START, {}), BELIEF) for k in range(1, 600)]
    assert not any(t.commands for t in told)
    assert method.status.code == JobError.POSES_STALE


@pytest.mark.long
def test_a_match_in_lockstep_is_equal_to_the_bit_with_equal_seeds():
    system = "push_study.rivals.reactive:METHOD"
    starts = np.array([HERE.robots["e0"]])
    believed = made_scenario("ahead", ROOM, ROBOT, starts, BOX, START)
    found = [run_team(system, believed, AHEAD, uncertainty("mild"), 3, 60.0) for _ in range(2)]
    assert all(o.success and o.error[0] < 0.02 and o.error[1] < 0.1 for o in found)
    assert set(found[0].trace.phases) >= {"positioning", "approach", "pushing"}
    first, second = (np.array(o.trace.ways) for o in found)
    assert np.array_equal(first, second)
