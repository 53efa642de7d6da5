"""Turns on the spot: any convex plate, two to five robots, in the planar world with noise."""

import math

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from grasp_opt.group_job import GroupJob
from grasp_opt.step_planner import StepPlanner
from push_model import se2
from push_model.free_space import FreeSpace
from push_model.jobs import JobError
from push_model.occupancy import rasterise
from push_model.settings import from_mapping
from push_model.specs import EnvironmentSpec, ObjectSpec
from push_scenario.bodies import load_object, load_robot
from push_scenario.scatter import scattered
from push_study.experiments.group_goals import plate
from push_study.uncertainty import uncertainty
from tests.driving import GroupWorld, answer

ROBOT = load_robot("epuck_ring")
SIZE = (3.0, 3.0)
ROOM = EnvironmentSpec(SIZE, resolution=0.02)


def convex_plate(random):
    """A plate of 3 to 8 sides within 0.2 m, of the ellipse's mass and frictions."""
    while True:
        angles = np.sort(random.uniform(0.0, 2.0 * math.pi, int(random.integers(3, 9))))
        radii = 0.2 * random.uniform(0.7, 1.0, len(angles))
        flat = random.uniform(0.6, 1.0)
        points = np.column_stack([radii * np.cos(angles), flat * radii * np.sin(angles)])
        hull = ConvexHull(points)
        vertices = points[hull.vertices]
        sides = np.hypot(*(np.roll(vertices, -1, axis=0) - vertices).T)
        if hull.volume > 0.03 and sides.min() > 0.05:
            break
    ellipse = load_object("plate_ellipse")
    values = {
        "shape": {"polygon": {"vertices": vertices.tolist()}},
        "mass": ellipse.mass,
        "height": ellipse.height,
        "floor_friction": ellipse.floor_friction,
        "contact_friction": ellipse.contact_friction,
    }
    return from_mapping(ObjectSpec, values, "plate")


def turned(item, count, turn, seed):
    """The job of a turn [rad] on the spot, and where the object is in the end, from its goal."""
    random = np.random.default_rng([seed, 55])
    start, grid = np.array([0.0, 0.0, random.uniform(-3.0, 3.0)]), rasterise(ROOM)
    outline = se2.transform(start, item.geometry.outline)
    radius = ROBOT.footprint_radius
    robots = scattered(random, count, FreeSpace(grid), outline, radius, gap=0.03)
    goal = np.array([0.0, 0.0, se2.wrap(float(start[2]) + turn)])
    planner, job = StepPlanner(grid, item, ROBOT), GroupJob(item, ROBOT, count)
    job.begin(goal)
    begin, doubt = item.geometric_pose(start), uncertainty("mild")
    with GroupWorld(ROOM, ROBOT, robots, item, begin, doubt, seed, "planar") as world:
        while world.time < 600.0 and job.busy:
            seen, poses = world.see()
            twists = job.step(world.time, item.mass_pose(seen), poses)
            answer(job, planner)
            world.step(twists)
        off = se2.between(goal, world.item.mass_pose(world.truth()[0]))
    return job, float(np.hypot(off[0], off[1])), abs(float(off[2]))


def test_three_robots_turn_a_pentagon_by_half_a_turn():
    """In one push: the wrench stays the same in the object's frame, and so do the robots."""
    job, away, askew = turned(plate(5), 3, 3.1, 0)
    assert job.error is JobError.NONE and not job.busy, job.reason
    assert job.pushes == 1 and away < 5e-3 and askew < 0.03


@pytest.mark.study
def test_random_pure_turns_are_reached():
    """Fifty of 0.5 rad to half a turn either way; nothing is left out, refusals count as missed."""
    reached, missed = 0, []
    for seed in range(50):
        random = np.random.default_rng([seed, 56])
        item, count = convex_plate(random), 2 + seed % 4
        turn = float(random.uniform(0.5, math.pi) * random.choice([-1.0, 1.0]))
        job, away, askew = turned(item, count, turn, seed)
        if job.error is JobError.NONE and away < 0.01 and askew < 0.05:
            reached += 1
        else:
            missed.append((seed, count, turn, job.reason))
    assert reached >= 48, missed
