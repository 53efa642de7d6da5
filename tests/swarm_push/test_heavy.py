"""What the door says of an object's weight against what a swarm then does: objects of random
weight, in the planar world."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from push_model.arrays import Array
from push_model.specs import EnvironmentSpec, ObjectSpec
from push_scenario.bodies import load_object, load_robot
from push_scenario.scatter import around as starts
from push_study.uncertainty import uncertainty
from swarm_push.feasibility import _AMPLE, Feasibility
from swarm_push.swarm_job import SwarmJob, SwarmJobSettings
from tests.driving import GroupWorld
from tests.samples import mostly_long

ROBOT = load_robot("epuck_ring")
OBJECTS = (
    "swarm_square", "swarm_ellipse", "swarm_rectangle", "plate_triangle", "swarm_hexagon",
    "swarm_octagon",
)  # fmt: skip
WAY, HALF, LIMIT = 0.4, 2.0, 90.0
STANDS = 0.02
"""[m] at most that an object moves that is said to be too heavy."""


@dataclass(frozen=True)
class Heavy:
    """An object of a random weight, robots about it and a target with any heading, WAY away.

    ratio: of the force that the robots can make at best to what the motion takes; accepted: what
    the door says."""

    item: ObjectSpec
    robots: Array
    target: Array
    ratio: float
    accepted: bool


def heavy(seed):
    """Weights for which the ratio lies between 0.6 and 2.6, so that the bounds are pressed on."""
    random = np.random.default_rng([seed, 91])
    item = load_object(OBJECTS[seed % len(OBJECTS)])
    count, angle = int(random.integers(3, 9)), random.uniform(-np.pi, np.pi)
    target = np.array([WAY * np.cos(angle), WAY * np.sin(angle), np.nan])
    robots = starts(random, count, item, ROBOT.footprint_radius)
    named = {f"e{k}": pose for k, pose in enumerate(robots)}
    light = Feasibility(item, ROBOT).assess(target, np.zeros(3), named)
    ratio = random.uniform(0.6, 2.6)
    item = replace(item, mass=item.mass * light.available / (ratio * light.force))
    found = Feasibility(item, ROBOT).assess(target, np.zeros(3), named)
    assert found.available == pytest.approx(ratio * found.force, rel=1e-6)
    return Heavy(item, robots, target, ratio, found.accepted)


def push(case, seed):
    """The job without the door. How far the object is at the end from where it was, and whether it
    is within the tolerance."""
    region = (HALF - ROBOT.footprint_radius) * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    job = SwarmJob(region, case.item, ROBOT, SwarmJobSettings())
    job.begin([case.target])
    room = EnvironmentSpec((2 * HALF, 2 * HALF), resolution=0.05)
    with GroupWorld(
        room, ROBOT, case.robots, case.item, np.zeros(3), uncertainty("none"), seed, "planar"
    ) as world:
        while world.time < LIMIT and job.busy:
            pose, robots = world.see()
            here = dict(zip(world.names, robots, strict=True))
            twists = job.step(world.time, case.item.mass_pose(pose), here, np.zeros((0, 3)))
            world.step(np.array([twists[n] for n in world.names]), job.turns)
        pose = case.item.mass_pose(world.truth()[0])
    left = float(np.hypot(*(pose - case.target)[:2]))
    return float(np.hypot(*pose[:2])), left < job.settings.position_tolerance


def outcomes(seeds):
    """Of each seed: whether the door accepts it, whether the force is ample, whether the object
    stands, whether it arrives."""
    found = []
    for seed in seeds:
        case = heavy(seed)
        moved, reached = push(case, seed)
        print(f"{seed}: {case.ratio:.2f}, moved {1e3 * moved:.0f} mm, reached: {reached}")
        found.append((case.accepted, case.ratio >= _AMPLE, moved < STANDS, reached))
    return np.array(found)


@pytest.mark.parametrize("seed", mostly_long([4, 1, 7, 5], 1))
def test_what_is_too_heavy_stands_and_what_is_light_enough_arrives(seed):
    ((accepted, ample, stands, reached),) = outcomes([seed])
    assert accepted == ample  # none of these lies between
    assert reached if accepted else stands


@pytest.mark.study
def test_60_objects_of_random_weight_do_what_is_said_of_them():
    accepted, ample, stands, reached = outcomes(range(60)).T
    assert np.sum(~accepted) > 10 and np.sum(ample) > 20
    assert np.all(stands[~accepted])
    assert np.mean(reached[ample]) >= 0.95
