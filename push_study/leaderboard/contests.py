"""The tasks of the leaderboard: rooms, objects, starts and goals by seed, the same for all methods.

Nothing that is drawn depends on the method. A contest of positions takes place in a room of 5 m, in
which methods that need room have it.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.distance_field import DistanceField
from push_model.settings import SettingsError
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from push_scenario.bodies import load_object, load_robot
from push_scenario.scatter import around
from push_scenario.scenario import load_scenario
from push_study.experiments.group_goals import GoalTask
from push_study.experiments.group_goals import problem as group_problem
from push_study.leaderboard.entries import PLATES, POSES, POSITIONS


@dataclass(frozen=True)
class Problem:
    """environment; item at start ``(3,)``, pose of its frame; goal ``(3,)``, with a heading of nan
    where any will do; robots ``(n, 3)``, of the type robot."""

    environment: EnvironmentSpec
    item: ObjectSpec
    start: Array
    goal: Array
    robots: Array
    robot: RobotSpec


@dataclass(frozen=True)
class Contest:
    """A task. kind: see Entry. tolerance: [m], [rad]. limit: [s] of simulation. what: in words.
    draw: of a seed."""

    name: str
    kind: str
    what: str
    tolerance: tuple[float, float]
    limit: float
    draw: Callable[[int], Problem]


SWARM = 20
SIZE, START, TARGET = 5.0, (-0.7, -0.7), (0.7, 0.7)  # [m]
_REACHED, _LIMIT = 0.1, 300.0  # [m]; [s]: 19 times what a robot at full speed would take
STALLED = 180.0
"""[s] after which the job of a contest of positions fails if the object has come no closer."""
_EXACT = 0.02, 0.1  # [m], [rad]
_MOVED = np.array([0.1, 0.1, 0.3])  # [m, m, rad] by which starts and goals of scenarios are moved
_FREE = 0.02  # [m] that object and robot keep from obstacles there


def _swarm(item_name: str) -> Callable[[int], Problem]:
    def draw(seed: int) -> Problem:
        item, robot = load_object(item_name), load_robot("epuck_ring")
        random = np.random.default_rng([seed, SWARM])
        start = np.array([*START, random.uniform(-math.pi, math.pi)])
        robots = around(random, SWARM, item, robot.footprint_radius)
        robots = np.array([se2.compose(start, r) for r in robots])
        room = EnvironmentSpec((SIZE, SIZE), resolution=0.05)
        return Problem(room, item, start, np.array([*TARGET, math.nan]), robots, robot)

    return draw


def _single(environment: int) -> Callable[[int], Problem]:
    def draw(seed: int) -> Problem:
        scenario = load_scenario(f"env{environment}-target{1 + seed % 3}")
        ((robot, place),) = scenario.robots.values()
        ((item, start),) = scenario.objects.values()
        assert scenario.goal is not None
        space = scenario.environment
        assert isinstance(space, EnvironmentSpec)
        field, random = DistanceField(scenario.grid), np.random.default_rng([seed, environment])
        behind, radius = se2.between(start, place), robot.footprint_radius
        while True:
            begin = start + random.uniform(-_MOVED, _MOVED)
            goal = np.array(scenario.goal) + random.uniform(-_MOVED, _MOVED)
            there = se2.compose(begin, behind)
            room = field.clearances(item.outline, np.array([begin, goal])).min()
            if min(room, field.at(there[0], there[1]) - radius) >= _FREE:
                return Problem(space, item, begin, goal, there[None], robot)

    return draw


def _group(world: str) -> Callable[[int], Problem]:
    def draw(seed: int) -> Problem:
        shapes = (0, *range(3, 9))
        robots, sides = 2 + seed % 4, shapes[seed % len(shapes)]
        made = group_problem(GoalTask(world, seed, "", robots, sides, "planar", "mild"))
        start, goal = (made.item.geometric_pose(p) for p in (made.start, made.goal))
        return Problem(
            made.environment, made.item, start, goal, made.robots, load_robot("epuck_ring")
        )

    return draw


def _positions(item: str, words: str) -> Contest:
    what = (
        f"20 robots bring {words} 2 m across an empty room of {SIZE:.0f} m; any heading; robots "
        "start in a square of 2.2 m about it"
    )
    name = f"open-{item.split('_')[1]}"
    return Contest(name, POSITIONS, what, (_REACHED, math.inf), _LIMIT, _swarm(item))


def _poses(environment: int) -> Contest:
    what = (
        f"one robot brings the 9 cm box to a random pose near one of the three targets of "
        f"environment {environment}, from a random pose near the start"
    )
    name = f"env{environment}"
    return Contest(name, POSES, what, _EXACT, 300.0, _single(environment))


def _plates(world: str, words: str) -> Contest:
    what = f"two to five robots bring a plate to a random pose, {words}"
    return Contest(f"plates-{world}", PLATES, what, _EXACT, 600.0, _group(world))


CONTESTS = {
    c.name: c
    for c in (
        _positions("transport_square", "a square of 40 cm"),
        _positions("transport_triangle", "a triangle"),
        _poses(1),
        _poses(2),
        _poses(3),
        _plates("open", "nothing in the way"),
        _plates("obstacles", "among obstacles"),
    )
}
"""By name."""


def contest(name: str) -> Contest:
    """A contest by name; raises SettingsError when there is none."""
    if name not in CONTESTS:
        raise SettingsError(f"no contest called '{name}'; known: {', '.join(CONTESTS)}")
    return CONTESTS[name]


def straight(problem: Problem) -> float:
    """[m] from start to goal."""
    return float(np.hypot(*(problem.goal - problem.start)[:2]))
