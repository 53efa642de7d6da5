"""Occlusion in the setting of Queiroz and MacRae 2024, who compare theirs with that of Chen et al.

Room, goal, places, robots' size and speed, when the goal counts as reached and the limit are those
of the experiments in their code (brenocq/object-transportation, controller ``PusherPaperScript``,
map ``reference``, object ``square``). The world is one of ours: object and floor obey Coulomb's
law, and one robot can push the object. Of theirs, masses are known (5 kg and 0.3 kg), but not what
resists the object. Their results are in a diagram, without numbers.
"""

import math
from dataclasses import replace

import numpy as np

from push_job.method import Task
from push_model.arrays import Array
from push_model.bumpers import RingBumper
from push_model.drives import SpeedDrive
from push_model.specs import EnvironmentSpec, RobotSpec
from push_scenario.bodies import load_object, load_robot
from push_study.pool import Row
from push_study.team_run import made_scenario, run_team
from push_study.uncertainty import uncertainty

ROBOTS = (5, 10, 20)
LIMIT = 1200.0  # [s]
_ROOM, _START, _GOAL = 2.9, (-1.0, -1.0), (1.0, 1.0)  # [m]
_RADIUS, _HALF_TRACK, _SPEED = 0.04, 0.03, 0.354  # [m], [m], [m/s]
_ITEM, _SIDE, _GOAL_SIZE, _GAP = "transport_square", 0.4, 0.4, 0.05  # [m]
REACHED = 0.5 * (_GOAL_SIZE + math.sqrt(2.0) * _SIDE) + _GAP
"""[m] from the goal; the goal counts as reached."""


def robot() -> RobotSpec:
    """An e-puck with the size and the speed of theirs."""
    epuck = load_robot("epuck_ring")
    assert isinstance(epuck.drive, SpeedDrive) and isinstance(epuck.bumper, RingBumper)
    wheels = _SPEED / epuck.drive.wheel_radius
    drive = replace(epuck.drive, half_track=_HALF_TRACK, max_wheel_speed=wheels)
    return replace(epuck, drive=drive, bumper=replace(epuck.bumper, radius=_RADIUS))


def starts(random: np.random.Generator, count: int) -> Array:
    """``(count, 3)`` poses anywhere in the room, apart from each other, from object and goal."""
    found: list[Array] = []
    while len(found) < count:
        place = _ROOM * random.uniform(-0.5, 0.5, 2)
        clear = bool(np.abs(place).max() < 0.5 * _ROOM - _RADIUS)
        clear &= bool(np.hypot(*(place - _GOAL)) >= 0.5 * _GOAL_SIZE + 2.0 * _RADIUS)
        clear &= bool(np.hypot(*(place - _START)) >= math.sqrt(0.5) * _SIDE + 2.0 * _RADIUS)
        if clear and all(np.hypot(*(place - p)) >= 3.0 * _RADIUS for p in found):
            found.append(place)
    return np.column_stack([np.array(found), random.uniform(-math.pi, math.pi, count)])


def run(count: int, seed: int, world: str, level: str, limit: float = LIMIT) -> Row:
    """So many robots bring the square to the goal, or until the limit is over. ``nearest_m``: that
    it came to it."""
    random = np.random.default_rng([seed, count])
    begin, start = starts(random, count), np.array([*_START, random.uniform(-math.pi, math.pi)])
    settings = {
        "position_tolerance": REACHED,
        "orientation": False,
        "stalled": LIMIT,
        "seed": seed,
    }
    room = EnvironmentSpec((_ROOM, _ROOM), resolution=0.05)
    item = load_object(_ITEM)
    scenario = made_scenario(
        f"occlusion-{count}", room, robot(), begin, item, start, {"occlusion": settings}
    )
    goal = Task((np.array([*_GOAL, math.nan]),))
    outcome = run_team("occlusion", scenario, goal, uncertainty(level), seed, limit, world=world)
    away = np.hypot(*(np.array(outcome.trace.ways)[:, 0, :2] - _GOAL).T)
    return {"success": outcome.success, "nearest_m": float(away.min())} | outcome.row()
