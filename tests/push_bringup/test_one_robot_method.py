"""One robot as a method, stepped as a notebook does it: no ROS, a planar world."""

import math
from dataclasses import replace

import numpy as np
import pytest

from push_bringup.one_robot_method import ONE_ROBOT, OneRobotMethod
from push_job.method import Arena, Certificate, Refusal, Seen, Task, Unsuited
from push_model.belief import Belief, Interval
from push_model.jobs import JobError, JobPhase
from push_model.settings import SettingsError
from push_mpc.believed_push import Unstable
from push_planner import PushPlanner
from push_scenario.scenario import load_scenario
from push_supervisor import SupervisorSettings
from sim_bridge.planar_world import PlanarWorld

NEVER = 300.0  # [s]


class Notebook:
    """A scenario's arena, world and belief, and a method in them."""

    def __init__(self, name, **settings):
        scenario = load_scenario(name)
        ((self.robot, (robot, _)),) = scenario.robots.items()
        ((self.item, (item, _)),) = scenario.objects.items()
        self.goal, self.grid = np.array(scenario.goal), scenario.grid
        self.arena = Arena(self.grid, {self.robot: robot}, self.item, item, settings)
        self.belief = Belief({self.item: item}, {self.robot: robot})
        self.world = PlanarWorld(scenario.environment, scenario.robots, scenario.objects)
        self.method, self.time, self.planning, self.hidden = ONE_ROBOT.make(self.arena), 0.0, 0.0, 0
        self.commands = (0.0, 0.0)

    def seen(self, **more):
        poses = self.world.poses()
        robots = {} if self.hidden else {self.robot: poses[self.robot]}
        return Seen(self.time, poses[self.item], robots, **more)

    def step(self, period=0.01, **more):
        self.time += period
        told = self.method.step(self.seen(**more), self.belief)
        self.planning += told.planning
        self.commands = told.commands.get(self.robot, (0.0, 0.0))
        self.world.command(self.robot, *self.commands)
        self.world.step(round(period / self.world.time_step))

    def until(self, condition, limit=NEVER):
        end = self.time + limit
        while not condition():
            assert self.time < end, self.method.status
            self.step()

    def begin(self):
        self.method.begin(Task((self.goal,)), self.belief)

    def finish(self):
        self.until(lambda: self.method.status.phase == JobPhase.IDLE)
        return self.method.status

    def pushing(self, seconds=0.5):
        self.begin()
        self.until(lambda: self.method.status.phase == JobPhase.PUSHING)
        self.until(lambda end=self.time + seconds: self.time > end)

    def believe(self, **values):
        told = {(self.item, k): Interval.exact(v) for k, v in values.items()}
        self.belief = self.belief.updated(told)

    @property
    def away(self):
        return float(np.hypot(*(self.world.poses()[self.item] - self.goal)[:2]))


@pytest.mark.parametrize("name", ["env1-target1", "short"])
def test_a_notebook_brings_the_object_there_in_ten_lines(name):
    scenario = load_scenario(name)
    ((robot, (robot_type, _)),) = scenario.robots.items()
    ((item, (item_type, _)),) = scenario.objects.items()
    belief = Belief({item: item_type}, {robot: robot_type})
    method = ONE_ROBOT.make(Arena(scenario.grid, {robot: robot_type}, item, item_type))
    world, tick = PlanarWorld(scenario.environment, scenario.robots, scenario.objects), 0
    method.begin(Task((scenario.goal,)), belief)
    while method.status.phase != JobPhase.IDLE and tick < 100 * NEVER:
        tick, poses = tick + 1, world.poses()
        told = method.step(Seen(tick / 100, poses[item], {robot: poses[robot]}), belief)
        world.command(robot, *told.commands[robot])
        world.step(round(0.01 / world.time_step))
    off = world.poses()[item] - scenario.goal
    assert method.status.code == 0, method.status.reason
    assert np.hypot(*off[:2]) < 2e-3 and abs(math.remainder(off[2], math.tau)) < 0.02


def test_status_report_and_release_tell_how_it_stands():
    book = Notebook("short")
    assert book.method.release() == {book.robot} and book.method.errors(book.seen())[0] == math.inf
    book.begin()
    assert book.method.status.phase == JobPhase.PLANNING and not book.method.release()
    book.pushing()
    report, status = book.method.report(book.seen()), book.method.status
    assert report.phase == "pushing" and report.figure("speed") == book.commands[0] > 0.0
    assert {s.layer for s in report.shapes} == {"plan"}
    assert report.shapes[-1].points[-1] == pytest.approx(book.goal[:2], abs=0.15)
    assert (status.index, status.count, status.pushes) == (0, 1, 0)
    assert book.planning > 0.0, "a plan costs something"
    done = book.finish()
    assert done.code == 0 and done.pushes == 1 and book.method.release() == {book.robot}
    assert book.method.errors(book.seen())[0] == pytest.approx(book.away) and book.away < 2e-3


def refused(book, goal, **believed):
    book.believe(**believed)
    answer = book.method.assess(Task((np.array(goal),)), book.belief, book.seen())
    assert isinstance(answer, Refusal), answer
    return answer


def test_what_the_nodes_refuse_is_refused_at_the_door():
    book = Notebook("env1-target1")
    x0, x1, y0, _ = book.grid.extent
    assert refused(book, (x1 + 1.0, 0.0, 0.0)).code is JobError.OUTSIDE_MAP
    row, column = np.argwhere(book.grid.occupied)[len(np.argwhere(book.grid.occupied)) // 2]
    wall = book.grid.origin + book.grid.resolution * (np.array([column, row]) + 0.5)
    assert refused(book, (*wall, 0.0)).code is JobError.GOAL_OCCUPIED
    answer = refused(book, (x0 + 0.075, y0 + 0.075, 0.0))
    assert answer.code is JobError.PLANNING_FAILED and "pushed into the goal" in answer.reason
    assert refused(book, (0.0, 0.0, math.nan)).code is JobError.INVALID_GOAL
    two = book.method.assess(Task((book.goal, book.goal)), book.belief, None)
    assert isinstance(two, Refusal) and two.code is JobError.INVALID_GOAL
    assert refused(book, book.goal, mass=50.0).code is JobError.TOO_HEAVY
    assert book.method.status.phase == JobPhase.IDLE


def test_what_can_be_done_is_certified_also_where_the_object_stands():
    book = Notebook("env1-target1")
    found = book.method.assess(Task((book.goal,)), book.belief, None)
    assert isinstance(found, Certificate) and found.robots == 1
    here = Task((book.seen().object,))
    assert isinstance(book.method.assess(here, book.belief, book.seen()), Certificate)
    book.goal = here.goal
    book.begin()
    assert book.finish().code == 0 and book.method.status.pushes == 0


def test_a_friction_told_in_mid_push_narrows_its_limits_and_those_of_the_next_plan():
    book = Notebook("short")
    book.pushing()
    drive, item = book.method._drive, book.arena.item
    before = drive.tracker.push.limits
    book.believe(contact_friction=0.5 * item.contact_friction)
    book.step()
    after = drive.tracker.push.limits
    assert after.maximum == pytest.approx(0.5 * before.maximum, rel=0.05)
    assert drive.tracker.push.line.friction == 0.5 * item.contact_friction
    assert book.finish().code == 0 and book.away < 5e-3
    book.goal = book.goal + np.array([0.2, 0.1, 0.0])
    book.pushing()
    sides = book.method._plans._planner.scene.sides
    assert sides[0].nominal.maximum == pytest.approx(after.maximum, rel=0.05)


def test_a_latency_is_made_good_as_it_is_believed():
    book = Notebook("short")
    book.pushing()
    book.belief = book.belief.updated({("", "latency"): Interval(0.02, 0.01, 0.03)})
    book.step()
    assert book.method._drive.tracker._reckoning.delay == 0.02


def test_a_push_that_is_not_stable_as_is_believed_now_ends_and_a_new_plan_follows(monkeypatch):
    book = Notebook("short")
    book.pushing()

    def unstable(*_):
        raise Unstable("not even a straight push is stable")

    with monkeypatch.context() as patch:
        patch.setattr("push_bringup.one_robot_drive.believed_push", unstable)
        book.believe(contact_friction=0.15)
        book.step()
    status = book.method.status
    assert status.phase == JobPhase.DETACHING and "straight push" in status.reason
    assert book.commands == (0.0, 0.0)
    status = book.finish()
    assert status.code == 0 and status.replans >= 1 and book.away < 2e-3


def test_a_robot_that_is_not_seen_stands_goes_on_when_it_is_and_gives_up_after_a_while():
    book = Notebook("short")
    book.pushing()
    book.hidden = True
    book.step()
    assert book.commands == (0.0, 0.0) and book.method.status.phase == JobPhase.PUSHING
    book.until(lambda end=book.time + 2.0: book.time > end)
    book.hidden = False
    book.until(lambda: book.commands[0] > 0.03, 3.0)
    book.hidden = True
    status = book.finish()
    assert status.code == JobError.POSES_STALE and book.robot in status.reason


def test_an_object_that_somebody_moves_is_followed_by_a_new_plan():
    book = Notebook("short")
    book.begin()
    book.until(lambda: book.method.status.phase == JobPhase.POSITIONING)
    shifted = replace(book.seen(), object=book.seen().object + np.array([0.0, 0.1, 0.0]))
    truth, book.seen = book.seen, lambda **more: replace(shifted, time=book.time)
    book.until(lambda: book.method.status.replans == 1, 2.0)
    book.seen = truth
    status = book.finish()
    assert status.code == 0 and status.replans == 2 and book.away < 2e-3


def test_other_bodies_are_gone_round():
    """A disc stands on the straight way of the object, seen in every frame."""
    book = Notebook("short")
    disc = np.array([[-0.15, 0.02, 0.05]])
    truth = book.seen
    book.seen = lambda **more: replace(truth(), obstacles=disc)
    nearest, hull = math.inf, book.arena.item.outline
    book.begin()
    while book.method.status.phase != JobPhase.IDLE:
        book.step()
        x, y, theta = book.world.poses()[book.item]
        turn = np.array([[math.cos(theta), -math.sin(theta)], [math.sin(theta), math.cos(theta)]])
        corners = np.linspace(hull, np.roll(hull, -1, axis=0), 20).reshape(-1, 2) @ turn.T
        nearest = min(nearest, np.hypot(*(corners + [x, y] - disc[0, :2]).T).min() - 0.05)
    assert book.method.status.code == 0 and book.away < 2e-3
    assert nearest > 0.0


def test_it_is_ended_before_its_first_frame_and_in_its_midst():
    book = Notebook("short")
    book.begin()
    book.method.end(JobError.CANCELED, "canceled")
    status = book.method.status
    assert (status.phase, status.code) == (JobPhase.IDLE, JobError.CANCELED)
    book.pushing()
    book.method.end(JobError.CANCELED, "canceled")
    book.step()
    assert book.commands == (0.0, 0.0) and book.method.status.code == JobError.CANCELED
    book.begin()
    assert book.finish().code == 0 and book.away < 2e-3


def test_teams_and_settings_that_do_not_suit_are_refused_in_words():
    book = Notebook("short")
    robot, item = book.arena.robot, book.arena.item
    with pytest.raises(SettingsError, match="takes one"):
        ONE_ROBOT.check({"a": robot, "b": robot}, item)
    ring = next(iter(load_scenario("group-ellipse").robots.values()))[0]
    with pytest.raises(SettingsError, match="flat"):
        ONE_ROBOT.check({"a": ring}, item)
    with pytest.raises(Unsuited, match="auto_execute"):
        OneRobotMethod(replace(book.arena, settings={"": SupervisorSettings(auto_execute=False)}))
    with pytest.raises(SettingsError, match="push_speed"):
        ONE_ROBOT.settings({"planner": {"push_speed": 99.0}})


def moved_goal(seed, supervisor=None, near=math.inf):
    """A goal that moves at random in mid-push, at most so far [m]: the notebook at the end, and the
    reasons told."""
    random = np.random.default_rng(seed)
    book = Notebook("short", **{"": supervisor or SupervisorSettings()})
    book.goal = np.array([*random.uniform([0.1, -0.4], [0.7, 0.4]), random.uniform(-0.8, 0.8)])
    book.pushing(random.uniform(0.2, 6.0))
    if book.method.status.phase != JobPhase.PUSHING:
        return book, []
    was = book.goal
    while True:
        book.goal = np.array([*random.uniform([-0.5, -0.4], [0.8, 0.4]), random.uniform(-1.2, 1.2)])
        if np.hypot(*(book.goal - was)[:2]) < near and abs(book.goal - was)[2] < 2.0 * near:
            break
    reasons = []
    book.begin()
    book.step()
    while book.method.status.phase != JobPhase.IDLE:
        if not reasons or reasons[-1] != book.method.status.reason:
            reasons.append(book.method.status.reason)
        book.step()
    return book, reasons


def slices_of(monkeypatch):
    """A list to which each slice of a plan adds its stage."""
    stages, whole = [], PushPlanner.plan

    def plan(*args, **kwargs):
        for progress in whole(*args, **kwargs):
            stages.append(progress.stage)
            yield progress

    monkeypatch.setattr(PushPlanner, "plan", plan)
    return stages


@pytest.mark.parametrize(("period", "most"), [(0.01, 2), (0.02, 4), (0.04, 8), (0.2, 10)])
def test_between_frames_that_are_farther_apart_more_slices_of_a_plan_are_done(
    period, most, monkeypatch
):
    book = Notebook("env1-target1")
    book.begin()
    book.step(period)
    book.method.end(JobError.CANCELED, "to begin again")
    book.time += 10.0  # it is not stepped meanwhile
    stages, counts = slices_of(monkeypatch), []
    book.begin()
    while not book.method.machine.segments and len(counts) < 1000:
        before = len(stages)
        book.step(period)
        counts.append(len(stages) - before)
    assert len(stages) > 3 * most
    assert counts[0] == 1, "it is not known yet how far apart frames are"
    assert set(counts[1:-1]) == {most} and counts[-1] <= most


def test_while_the_robot_pushes_a_frame_has_one_slice(monkeypatch):
    book = Notebook("env1-target1")
    book.pushing()
    stages, counts = slices_of(monkeypatch), []
    book.goal = book.goal + [-0.05, 0.03, 0.1]
    book.begin()
    book.step()
    assert book.method.machine.repairing
    while book.method.machine.repairing:
        before = len(stages)
        book.step()
        counts.append(len(stages) - before)
    assert len(counts) > 20 and max(counts) == 1


@pytest.mark.long
def test_a_goal_that_moves_in_mid_push_is_planned_for_while_the_robot_pushes():
    repaired = 0
    for seed in range(4):
        book, reasons = moved_goal(seed)
        if not reasons:  # the push had ended before
            continue
        assert book.method.status.code == 0, book.method.status.reason
        assert book.away < 4.5e-3
        if reasons[0].startswith("pushing on meanwhile"):
            assert reasons[1].startswith("push 1 of") or "not ready in time" in reasons[1]
            repaired += reasons[1].startswith("push 1 of")
    assert repaired >= 2


def test_a_push_whose_job_was_replaced_stops_when_no_goal_follows():
    book = Notebook("short")
    book.pushing()
    assert book.commands[0] > 0.0
    book.method.end(JobError.PREEMPTED, "a new goal replaces this one")
    book.step()
    assert book.commands == (0.0, 0.0) and book.method.status.code == JobError.PREEMPTED


@pytest.mark.parametrize("frames", [72, 81, 90, 120])
def test_a_push_that_ends_while_a_plan_is_made_for_a_new_goal_is_no_push_of_that_plan(frames):
    """The new goal comes about a second before the end of the push."""
    book = Notebook("short")
    book.begin()
    machine = book.method.machine
    book.until(lambda: book.method.status.phase == JobPhase.PUSHING)
    duration = machine.segment.trajectory.duration
    end = book.time + duration - 0.01 * frames
    book.until(lambda: book.time >= end)
    book.goal = book.goal + np.array([0.3, 0.05, 0.0])
    book.begin()
    assert book.finish().code == 0 and book.away < 4.5e-3
