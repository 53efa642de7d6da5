"""Stable pushing by one NMPC: its constraint, its programme, and what it refuses."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from push_job.method import Arena, Refusal, Seen, Task, Unsuited
from push_model import se2
from push_model.belief import Belief, Interval
from push_model.distance_field import DistanceField
from push_model.jobs import JobError, JobPhase
from push_model.occupancy import rasterise
from push_model.settings import SettingsError
from push_model.specs import BoxSpec, EnvironmentSpec
from push_model.stable_push import PusherContact, contact_margins
from push_mpc import TrackerSettings
from push_scenario.bodies import load_object, load_robot
from push_study.rivals.stable_nmpc import (
    METHOD,
    StableNmpcMethod,
    StableNmpcSettings,
    grips,
)
from push_study.rivals.stable_programme import ACCELERATION, MARGIN, StableProgramme, cubic
from push_study.team_run import OBJECT, made_scenario, run_team
from push_study.uncertainty import uncertainty
from sim_bridge.planar_world import PlanarWorld

ROBOT, BOX = load_robot("epuck"), load_object("box9")
ROOM = EnvironmentSpec((1.6, 1.2))
BELIEF = Belief({OBJECT: BOX}, {"e0": ROBOT})
FREE = Task((np.array([0.3, 0.0, 0.0]),))
HERE = Seen(0.0, np.array([-0.4, 0.0, 0.0]), {"e0": np.array([-0.65, 0.2, 0.0])})


@pytest.fixture(scope="module")
def programme():
    return StableProgramme(rasterise(ROOM), ROBOT, BOX)


@pytest.fixture(scope="module")
def arena():
    return Arena(rasterise(ROOM), {"e0": ROBOT}, OBJECT, BOX)


TRUST = StableNmpcSettings().friction_trust


def margins(grip, curvature, friction):
    """Of the mechanics, see ``contact_margins``."""
    d, half = ROBOT.push_distance, 0.5 * ROBOT.flat_bumper.width
    centre = grip.grasp[:2] - [d, 0.0]
    contact = PusherContact(centre, -half, half, grip.grasp[2])
    return min(contact_margins(curvature, contact, d, friction, BOX.limit_surface()))


@pytest.mark.parametrize("trust", [0.5, 0.85, 1.0])
def test_the_constraint_is_that_of_the_mechanics(trust):
    """On the limits the object just sticks with so much of the believed friction."""
    found = grips(trust, BELIEF, ROBOT, OBJECT)
    assert len(found) == 4
    for grip in found:
        friction = trust * BOX.contact_friction
        for limit in (grip.limits.minimum, grip.limits.maximum):
            assert margins(grip, 0.999 * limit, friction) >= 0.0
            assert margins(grip, 1.001 * limit, friction) < 0.0
    # mu / (a + D) for a centred object
    exact = trust * BOX.contact_friction / (0.045 + ROBOT.push_distance)
    assert found[0].limits.maximum == pytest.approx(exact, rel=1e-6)


def test_less_friction_that_is_believed_is_what_counts():
    less = BELIEF.updated({(OBJECT, "contact_friction"): Interval(0.2, 0.1, 0.4)})
    (known, *_), (doubted, *_) = (grips(TRUST, b, ROBOT, OBJECT) for b in (BELIEF, less))
    assert doubted.limits.maximum == pytest.approx(known.limits.maximum * 0.1 / 0.17)


def test_a_plan_keeps_its_constraints_and_ends_at_the_goal(programme):
    grip = grips(TRUST, BELIEF, ROBOT, OBJECT)[0]
    item, goal = np.array([-0.45, -0.2, 0.0]), np.array([0.5, 0.15, 0.3])
    robot, last = (se2.compose(p, se2.inverse(grip.grasp)) for p in (item, goal))
    z, _ = programme.along(cubic(item, goal, 0.0), robot, grip.grasp)
    plan = programme.solve(robot, last, grip.grasp, grip.limits, (0.0, 0.0), z)
    v, omega = plan.twists.T
    assert plan.solved and plan.slack < 1e-4
    assert np.abs(plan.poses[-1] - last) == pytest.approx(0.0, abs=0.02)
    assert (v >= -1e-6).all() and v.max() > 0.1
    bends = omega[v > 0.01] / v[v > 0.01]
    assert all(margins(grip, k, BOX.contact_friction) > 0.0 for k in bends)
    wheels = v + ROBOT.differential.half_track * np.abs(omega)
    assert wheels.max() <= ROBOT.max_speed
    steps = np.abs(np.diff([*v, 0.0]))  # the first change is made by the command, gradually
    assert steps.max() <= ACCELERATION * plan.step + 1e-6
    again = programme.solve(
        robot, last, grip.grasp, grip.limits, (0.0, 0.0), plan.later(0.0), plan.multipliers
    )
    assert again.solved and again.duration == pytest.approx(plan.duration, rel=0.02)


def test_a_plan_keeps_off_what_is_on_the_map():
    """A wall in the straight way: the object goes round its end, at least by the margin."""
    room = EnvironmentSpec((2.4, 1.6), boxes=(BoxSpec((0.0, -0.4), (0.1, 0.8)),))
    grid = rasterise(room)
    grip = grips(TRUST, BELIEF, ROBOT, OBJECT)[0]
    item, goal = np.array([-0.9, -0.1, 0.0]), np.array([0.9, -0.1, 0.0])
    robot, last = (se2.compose(p, se2.inverse(grip.grasp)) for p in (item, goal))
    made = StableProgramme(grid, ROBOT, BOX)
    way = np.array([item[:2], [0.0, 0.2], goal[:2]])
    z, _ = made.along(way, robot, grip.grasp)
    plan = made.solve(robot, last, grip.grasp, grip.limits, (0.0, 0.0), z)
    assert plan.solved and plan.slack < 1e-4
    field = DistanceField(grid)
    items = np.array([se2.compose(p, grip.grasp) for p in plan.poses])
    assert field.clearances(BOX.geometry.outline, items).min() > 0.5 * MARGIN
    assert field.clearances(ROBOT.outline, plan.poses).min() > 0.5 * MARGIN


@pytest.mark.parametrize(
    ("task", "words"),
    [
        (Task((np.array([0.3, 0.0, np.nan]),)), "needs a heading"),
        (Task(FREE.targets, (10.0,)), "a single goal, without times"),
        (Task(FREE.targets * 2), "a single goal, without times"),
    ],
)
def test_what_it_cannot_do_is_refused_with_the_reason(arena, task, words):
    refused = METHOD.make(arena).assess(task, BELIEF, HERE)
    assert isinstance(refused, Refusal) and refused.code is JobError.INVALID_GOAL
    assert words in refused.reason
    occupied = METHOD.make(arena).assess(Task((np.array([0.79, 0.0, 0.0]),)), BELIEF, HERE)
    assert isinstance(occupied, Refusal) and occupied.code is JobError.GOAL_OCCUPIED


def test_teams_it_cannot_drive_are_refused():
    with pytest.raises(SettingsError, match="takes one"):
        METHOD.check({"e0": ROBOT, "e1": ROBOT}, BOX)
    with pytest.raises(SettingsError, match="flat bumper"):
        METHOD.check({"e0": load_robot("epuck_ring")}, BOX)
    METHOD.check({"e0": ROBOT}, BOX)


def test_a_goal_that_no_stable_push_reaches_ends_the_task_with_that_reason(arena):
    """A turn by 45° in place: bends without slipping have a radius of half a metre."""
    method = StableNmpcMethod(arena)
    method.begin(Task((HERE.object + [0.0, 0.0, 0.8],)), BELIEF)
    for _ in range(20):
        told = method.step(HERE, BELIEF)
        assert told.commands in ({}, {"e0": (0.0, 0.0)})
        if method.status.phase == JobPhase.IDLE:
            break
    assert method.status.code == JobError.PLANNING_FAILED
    assert "no side of the object" in method.status.reason
    assert method.release() == {"e0"} and method.report(HERE) is None


def test_an_object_at_its_goal_stays_there(arena):
    method = StableNmpcMethod(arena)
    method.begin(Task((HERE.object,)), BELIEF)
    method.step(HERE, BELIEF)
    assert method.status.phase == JobPhase.IDLE and method.status.code == JobError.NONE
    assert method.errors(HERE) == (0.0, 0.0)


@pytest.mark.long
def test_a_short_match_in_lockstep_reaches_a_goal_ahead():
    system = "push_study.rivals.stable_nmpc:METHOD"
    starts = np.array([HERE.robots["e0"]])
    believed = made_scenario("ahead", ROOM, ROBOT, starts, BOX, HERE.object)
    goal = np.array([0.2, 0.05, 0.1])
    outcome = run_team(system, believed, Task((goal,)), uncertainty("mild"), 3, 40.0)
    assert outcome.success, outcome.reason
    assert outcome.error[0] < 0.01 and outcome.error[1] < 0.05
    assert set(outcome.trace.phases) >= {"positioning", "approach", "pushing"}
    ways = np.array(outcome.trace.ways)
    off = np.array([se2.between(robot, item) for item, robot in ways])
    ahead = off[-1] - [ROBOT.push_distance + 0.045, 0.0, 0.0]
    assert np.abs(ahead) == pytest.approx(0.0, abs=5e-3), "the object has not slipped"
    assert max(outcome.trace.figures["solves"]) > 5


@pytest.mark.parametrize("name", ["friction_trust", "slip_warning", "contact_gap"])
def test_a_setting_of_the_tracker_that_does_nothing_is_refused(arena, name):
    tracker = replace(TrackerSettings(), **{name: 0.5})
    with pytest.raises(Unsuited, match=f"tracker.{name} has no effect"):
        StableNmpcMethod(replace(arena, settings={**arena.settings, "tracker": tracker}))


class Pushed:
    """A task in the planar world, frame by frame; the robot begins behind the object."""

    def __init__(self, arena, goal):
        self.method, self.time, self.belief = StableNmpcMethod(arena), 0.0, BELIEF
        self.method.begin(Task((np.array(goal),)), BELIEF)
        starts = {"e0": (ROBOT, np.array([-0.6, 0.0, 0.0]))}
        self.world = PlanarWorld(ROOM, starts, {OBJECT: (BOX, HERE.object)})

    def frame(self, robot=True, ages=()):
        """v, omega of the answer; nothing is told where the frame shows no robot."""
        poses = self.world.poses()
        robots = {"e0": poses["e0"]} if robot else {}
        seen = Seen(self.time, poses[OBJECT], robots, ages=dict(ages))
        told = self.method.step(seen, self.belief).commands
        command = told.get("e0", (0.0, 0.0))
        self.world.command("e0", *command)
        self.world.step(round(0.01 / self.world.time_step))
        self.time += 0.01
        return command

    def until(self, holds):
        for _ in range(6000):
            command = self.frame()
            if holds(command):
                return
        raise AssertionError(self.method.status)

    def fast(self, command):
        return self.method.status.phase == JobPhase.PUSHING and command[0] > 0.1


@pytest.mark.parametrize("pushing", [False, True])
def test_a_robot_that_is_not_seen_any_more_ends_the_task(arena, pushing):
    run = Pushed(arena, [0.2, 0.05, 0.1])
    if pushing:
        run.until(run.fast)
    phase = run.method.status.phase
    for _ in range(490):
        assert run.frame(robot=False) == (0.0, 0.0)
    assert run.method.status.phase == phase
    for _ in range(20):
        run.frame(robot=False)
    assert run.method.status.code == JobError.POSES_STALE
    assert run.frame() == (0.0, 0.0) and run.method.release() == {"e0"}


def test_a_robot_that_stood_unseen_speeds_up_again_and_reaches_the_goal(arena):
    run = Pushed(arena, [0.2, 0.05, 0.1])
    run.until(run.fast)
    for _ in range(200):
        assert run.frame(robot=False) == (0.0, 0.0)
    speeds = [run.frame()[0] for _ in range(20)]
    assert np.diff([0.0, *speeds]).max() <= 0.01 * ACCELERATION + 1e-9
    run.until(lambda _: run.method.status.phase == JobPhase.IDLE)
    assert run.method.status.code == JobError.NONE, run.method.status.reason


def test_a_pose_of_the_object_from_an_earlier_frame_does_not_move_it_on_the_bumper(arena):
    run = Pushed(arena, [0.2, 0.05, 0.1])
    run.until(run.fast)
    before = run.method._measured.copy()
    run.world.poses = lambda poses=run.world.poses: {**poses(), OBJECT: HERE.object}
    run.frame(ages={OBJECT: 0.1})
    assert run.method._measured == pytest.approx(before, abs=1e-12)
    run.frame()
    assert run.method._measured[0] < before[0] - 5e-4


def test_a_belief_that_changes_before_the_push_does_not_move_the_object(arena, monkeypatch):
    """Its centre of mass is where it was when the task began, as in the plan."""
    run = Pushed(arena, [0.2, 0.05, 0.1])
    with monkeypatch.context() as patch:
        patch.setattr(run.method, "_misses", lambda plan, goal: "it looks for another one")
        run.frame()
    run.belief = BELIEF.updated({(OBJECT, "com_x"): Interval.exact(0.03)})
    run.until(lambda _: run.method.status.phase == JobPhase.IDLE)
    assert run.method.status.code == JobError.NONE, run.method.status.reason


def test_casadi_is_not_loaded_before_it_is_needed():
    code = "import push_study.rivals.stable_nmpc, sys; sys.exit('casadi' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
