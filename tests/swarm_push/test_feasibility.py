"""What is refused at the door, and what forces robots at a rim can make: against hand calculations,
placements drawn at random, and the simulated world."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog

from push_model.coulomb import cone_edges
from push_model.grasp import grasp_matrix
from push_model.jobs import JobError
from push_model.limit_surface import GRAVITY
from push_model.occupancy import rasterise
from push_model.shape_specs import EllipseShape
from push_model.specs import BoxSpec, EnvironmentSpec
from push_scenario.bodies import load_object, load_robot
from swarm_push.feasibility import Feasibility
from swarm_push.region import covered_region
from swarm_push.rim import Rim
from swarm_push.rim_capacity import RimCapacity
from swarm_push.swarm_job import SwarmJob, SwarmJobSettings

ROBOT = load_robot("epuck_ring")
SQUARE = load_object("swarm_square")
RADIUS = ROBOT.footprint_radius
AHEAD, TURN = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
OPEN = np.array([0.9, 0.0, math.nan])


def smooth(item):
    return replace(item, contact_friction=0.0)


def team(count, x=-1.0):
    return {f"e{k}": np.array([x, 0.25 * (k - 0.5 * (count - 1)), 0.0]) for k in range(count)}


def room(*boxes):
    return rasterise(EnvironmentSpec((4.0, 4.0), boxes=boxes, resolution=0.02))


def job_in(grid, item=SQUARE, **changes):
    return SwarmJob(
        covered_region(grid, RADIUS), item, ROBOT, SwarmJobSettings(**changes), grid=grid
    )


def test_a_motion_takes_the_floor_friction_and_each_robot_adds_its_traction():
    """Without friction at the contacts robots side by side push straight ahead with F each."""
    capacity = RimCapacity(smooth(SQUARE), ROBOT)
    assert capacity.needed_force(AHEAD) == pytest.approx(0.3 * 0.327 * GRAVITY, rel=1e-3)
    assert capacity.traction == pytest.approx(0.2 * GRAVITY)  # its weight; wheel friction is 1
    made = [capacity.available_force(AHEAD, n) / capacity.traction for n in (0, 1, 2, 4, 50)]
    assert made[:4] == pytest.approx([0.0, 1.0, 2.0, 4.0], rel=0.01)
    assert made[4] == pytest.approx(4.0, rel=0.02)  # a side of 0.368 m has no room for a fifth


def test_friction_turns_a_disc_and_nothing_does_without_it():
    disc = replace(SQUARE, shape=EllipseShape(0.2, 0.2))
    capacity = RimCapacity(disc, ROBOT)
    outline = disc.geometry.outline
    half = 0.5 * float(np.hypot(*(outline[1] - outline[0])))  # of an edge of its polygon
    rho = disc.limit_surface().radius
    for n in (2, 4):
        part = capacity.available_force(TURN, n) / (n * capacity.traction)
        assert 0.2 * 0.199 / rho < part < (0.2 * 0.2 + half) / rho * 1.01
    least = capacity.least_robots(TURN)
    assert capacity.available_force(TURN, least) >= capacity.needed_force(TURN)
    assert capacity.available_force(TURN, least - 1) < capacity.needed_force(TURN)


def test_a_square_is_turned_at_its_corners():
    """A robot at the end of a side: arm s along the side and friction mu s across it."""
    capacity = RimCapacity(SQUARE, ROBOT)
    s, rho = 0.184, SQUARE.limit_surface().radius
    best = (1.0 + SQUARE.contact_friction) * s / rho
    for n in (1, 2, 4):
        part = capacity.available_force(TURN, n) / (n * capacity.traction)
        assert 0.9 * best < part <= 1.001 * best


def made_by(item, places, twist, traction):
    """[N] that robots at given places of a rim can make along the wrench of a twist."""
    rim, at = places
    surface = item.limit_surface()
    scale = np.array([1.0, 1.0, surface.radius])
    wrench = surface.wrench(twist) / scale
    edges = np.array([cone_edges(n, item.contact_friction) for n in rim.normals[at]])
    edges *= math.hypot(1.0, item.contact_friction)
    G = grasp_matrix(rim.points[at] + RADIUS * rim.normals[at]).reshape(3, -1, 2)
    columns = np.einsum("ikj,klj->ikl", G, edges).reshape(3, -1) / scale[:, None]
    unit = wrench / np.linalg.norm(wrench)
    limits = np.hstack([np.kron(np.eye(len(at)), [[1.0, 1.0]]), np.zeros((len(at), 1))])
    cost = np.zeros(2 * len(at) + 1)
    cost[-1] = -1.0
    found = linprog(
        cost, limits, np.full(len(at), traction), np.column_stack([columns, -unit]), np.zeros(3)
    )
    return float(found.x[-1])


@pytest.mark.parametrize("name", ["swarm_square", "plate_triangle", "swarm_ellipse"])
def test_no_placement_makes_more_than_what_is_said_to_be_available(name):
    """Robots at random on a rim of points 2 mm apart, never closer than a diameter."""
    item, random = load_object(name), np.random.default_rng(4)
    capacity, rim = RimCapacity(item, ROBOT), Rim(item.geometry.outline, RADIUS, 2e-3)
    tried = 0
    for _ in range(25):
        twist = np.array([*random.normal(size=2), random.normal() / item.limit_surface().radius])
        pushed = np.flatnonzero(rim.approach(twist) > 0.0)
        count, at = int(random.integers(1, 7)), []
        for k in random.permutation(pushed):
            if all(np.hypot(*(rim.points[k] - rim.points[j])) >= 2.0 * RADIUS for j in at):
                at.append(int(k))
            if len(at) == count:
                break
        made = made_by(item, (rim, np.array(at)), twist, capacity.traction)
        tried += made > 0.5
        assert made <= 1.03 * capacity.available_force(twist, len(at))
    assert tried > 5


def test_an_object_is_too_heavy_for_some_and_not_for_more():
    job = job_in(room(), replace(SQUARE, mass=2.2))  # 6.5 N
    few, many = (job.assess(OPEN, np.zeros(3), team(n)) for n in (3, 5))
    assert few.code is JobError.TOO_HEAVY and few.needed == 4
    assert few.force == pytest.approx(2.2 * 0.3 * GRAVITY, rel=0.02)
    assert few.margin == pytest.approx(few.available - few.force) and few.margin < 0.0
    assert f"needs {few.force:.2f} N" in few.reason and "at least 4 robots" in few.reason
    assert many.accepted and many.margin > 0.0 and many.reason == ""
    never = job_in(room(), replace(SQUARE, mass=40.0)).assess(OPEN, np.zeros(3), team(12))
    assert never.code is JobError.TOO_HEAVY and never.needed is None
    assert "no more robots find room" in never.reason


def test_a_heading_takes_two_robots_and_a_position_one():
    job = job_in(room())
    turned = np.array([0.9, 0.0, 1.0])
    alone = job.assess(turned, np.zeros(3), team(1))
    assert alone.code is JobError.POSITIONING_FAILED and "at least 2 robots" in alone.reason
    assert job.assess(turned, np.zeros(3), team(2)).accepted
    assert job.assess(OPEN, np.zeros(3), team(1)).accepted
    none = job.assess(OPEN, np.zeros(3), {})
    assert none.code is JobError.POSITIONING_FAILED and none.reason == "no robot is seen"


def test_targets_that_walls_keep_the_object_or_its_robots_from_are_refused():
    wall = BoxSpec((0.8, 0.0), (0.05, 3.99))
    gap = (BoxSpec((0.8, -1.15), (0.05, 1.7)), BoxSpec((0.8, 1.15), (0.05, 1.7)))  # 0.6 m
    beyond = np.array([1.4, 0.0, math.nan])
    walled = job_in(room(wall)).assess(beyond, np.zeros(3), team(5))
    assert walled.code is JobError.PLANNING_FAILED and "no way for the object" in walled.reason
    open_way = job_in(room(*gap)).assess(beyond, np.zeros(3), team(5))
    assert open_way.accepted and open_way.way > 1.39
    here = np.array([0.0, -1.0, math.nan])
    apart = job_in(room(wall)).assess(here, np.zeros(3), team(5, x=1.4))
    assert apart.code is JobError.POSITIONING_FAILED and "none of 5 robots" in apart.reason
    some = job_in(room(wall)).assess(here, np.zeros(3), {**team(2), "far": np.array([1.4, 0, 0])})
    assert some.accepted and some.robots == 2
    job = job_in(room())
    for target, code in (((1.95, 0, 0), JobError.GOAL_OCCUPIED), ((3, 0, 0), JobError.OUTSIDE_MAP)):
        assert job.assess(np.array(target, dtype=float), np.zeros(3), team(5)).code is code


def test_a_job_that_is_under_way_is_not_touched_by_a_question():
    grid = room(BoxSpec((0.6, 0.0), (0.3, 0.3)))
    asked, unasked = job_in(grid), job_in(grid)
    for job in (asked, unasked):
        job.begin([np.array([1.3, 0.0, math.nan])])
    for k in range(25):
        if k == 10:
            assert asked.assess(np.array([-1.2, 1.2, 0.3]), np.zeros(3), team(5)).accepted
        told = [j.step(0.02 * k, np.zeros(3), team(5), np.zeros((0, 3))) for j in (asked, unasked)]
        assert told[0] == told[1]


def test_a_job_is_given_up_soon_when_too_few_robots_are_left():
    """Two of five stay in sight, who have 3.9 N for 4.4 N; they may be hidden for a second."""
    job = job_in(room(), replace(SQUARE, mass=1.5))
    job.begin([OPEN])
    time = 0.0
    while job.busy and time < 40.0:
        hidden = 2.0 < time < 3.0 or time > 6.0
        job.revive()  # nobody is dead, they are only out of sight
        job.step(time, np.zeros(3), team(2 if hidden else 5), np.zeros((0, 3)))
        time += 0.05
    assert job.error is JobError.TOO_HEAVY and "at least 3 robots" in job.reason
    assert time - 6.0 == pytest.approx(SwarmJobSettings().alone, abs=0.2)


def test_a_heavier_object_is_believed_at_once():
    job = job_in(room())
    assert job.assess(OPEN, np.zeros(3), team(3)).accepted
    job.believe(replace(SQUARE, mass=2.2))
    assert job.assess(OPEN, np.zeros(3), team(3)).code is JobError.TOO_HEAVY


def test_times_are_rough_and_longer_for_more_way():
    feasibility = Feasibility(SQUARE, ROBOT)
    near, far = (
        feasibility.assess(np.array([x, 0.0, math.nan]), np.zeros(3), team(5)) for x in (0.5, 1.5)
    )
    speed = ROBOT.max_speed
    assert near.way == pytest.approx(0.5) and far.way == pytest.approx(1.5)
    assert 1.0 / speed < far.seconds - near.seconds < 2.0 / speed
    there = feasibility.assess(np.zeros(3), np.zeros(3), team(5))
    assert there.accepted and there.way == 0.0 and there.needed == 0
