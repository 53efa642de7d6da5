"""The Gibbs random field of Rezeck et al. in the setting of its authors.

Room, robots, object, places and time are as in their code and in the recordings that they published
(rezeck/grf_transport, July 2021); the world is one of ours.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from push_job.method import Task
from push_model.arrays import Array
from push_model.bumpers import RingBumper
from push_model.drives import SpeedDrive
from push_model.outlines import distance, inside
from push_model.se2 import transform
from push_model.shape_specs import RectangleShape
from push_model.specs import EnvironmentSpec, ObjectSpec, RobotSpec
from push_scenario.bodies import load_robot
from push_study.pool import Row
from push_study.team_run import TRACE, made_scenario, run_team
from push_study.uncertainty import uncertainty


@dataclass(frozen=True)
class Recorded:
    """What the authors recorded, in ten runs that all reach the goal.

    mean, std: [s] of the time. first_motion: [s] mean time after which the object is 1 cm closer to
    the goal. pace: [m/s] at which it approaches the goal from then on, in steps of 2 s: mean over
    the runs of the median. fastest: [m/s] greatest such step of all runs.
    """

    mean: float
    std: float
    first_motion: float
    pace: float
    fastest: float


PUBLISHED = {
    "gibbs-2": Recorded(725, 88, 184, 0.0032, 0.0053),
    "gibbs-4": Recorded(446, 92, 138, 0.0055, 0.0100),
    "gibbs-10": Recorded(297, 20, 57, 0.0075, 0.0119),
    "gibbs-20": Recorded(259, 16, 42, 0.0081, 0.0138),
}
"""Computed from the recordings of the authors (rezeck/grf_transport, folder exp_scalability of July
2021), which contain the object's distance from the goal, but no robots."""
ROOM, START, GOAL = 4.0, (0.0, 0.55, 0.0), (0.0, -1.15)  # [m]; 1.7 m apart, as in the recordings
_APART, _REACHED, LIMIT = 0.2, 0.1, 900.0  # [m], [m], [s]
_MOVED = 0.01  # [m] closer to the goal: the object moves
_PACE = 2.0  # [s] over which its speed is taken
_BODY, _HALF_TRACK, _WHEEL = 0.036, 0.03115, 0.026  # [m]
_HAT = RingBumper(radius=0.04, z=0.064, height=0.02)
_RIM, _ABOVE = 0.034, 1.5e-3  # [m] from the axle to where the body's rim touches the floor; over it
_FASTEST, _TORQUE, _FRICTION = 0.25, 0.3, 0.8  # [m/s], [Nm]: more than is asked for; of wheels
_OBJECT = ObjectSpec(
    RectangleShape(0.5, 0.4), mass=0.2, height=0.3, floor_friction=0.3, contact_friction=0.2
)


def hero() -> RobotSpec:
    """Their robot as of February 2021 (verlab/hero_common): a cylinder with a wider hat, which is
    what touches objects; the wheels' motors have the inertia of an e-puck's."""
    epuck = load_robot("epuck_ring")
    assert isinstance(epuck.drive, SpeedDrive)
    drive = replace(
        epuck.drive,
        wheel_radius=_WHEEL,
        half_track=_HALF_TRACK,
        max_wheel_speed=_FASTEST / _WHEEL,
        wheel_mass=0.01,
        wheel_torque=_TORQUE,
        wheel_friction=_FRICTION,
    )
    return RobotSpec(
        drive,
        _HAT,
        body_radius=_BODY,
        body_height=0.048,
        mass=0.12,
        casters=(_RIM, -_RIM),
        caster_clearance=_ABOVE,
    )


def starts(random: np.random.Generator, count: int) -> Array:
    """``(count, 3)`` poses anywhere in the room, apart from each other and from the object, as the
    authors' script draws them; heading 0."""
    outline = transform(np.array(START), _OBJECT.outline)
    found: list[Array] = []
    while len(found) < count:
        place = 0.9 * ROOM * random.uniform(-0.5, 0.5, 2)
        clear = not inside(outline, place[None])[0]
        clear &= bool(distance(outline, place[None])[0] > 1.1 * _HAT.radius)
        if clear and all(np.hypot(*(place - p)) > _APART for p in found):
            found.append(place)
    return np.column_stack([np.array(found), np.zeros(count)])


def run(count: int, seed: int, world: str, level: str, limit: float = LIMIT) -> Row:
    """So many robots bring the object to the goal, or until the time of the recordings is over.

    ``first_motion_s``: after which the object has moved towards the goal; ``nearest_m``: that it
    came to it; ``pace_m_s``, ``fastest_m_s``: median and greatest speed towards it, see Recorded.
    """
    begin = starts(np.random.default_rng([seed, count]), count)
    room = EnvironmentSpec((ROOM, ROOM), resolution=0.05)
    settings = {
        "position_tolerance": _REACHED,
        "orientation": False,
        "stalled": LIMIT,
        "seed": seed,
    }
    start = np.array(START)
    scenario = made_scenario(
        f"gibbs-{count}", room, hero(), begin, _OBJECT, start, {"gibbs": settings}
    )
    outcome = run_team(
        "gibbs",
        scenario,
        Task((np.array([*GOAL, math.nan]),)),
        uncertainty(level),
        seed,
        limit,
        world=world,
    )
    away = np.hypot(*(np.array(outcome.trace.ways)[:, 0, :2] - GOAL).T)
    moves = away < away[0] - _MOVED
    times = np.array(outcome.trace.times)
    row: Row = {"success": outcome.success, "nearest_m": float(away.min())}
    if moves.any():
        first = int(moves.argmax())
        row["first_motion_s"] = float(times[first] - times[0])
        row |= paces(away[first:])
    return row | outcome.row()


def paces(away: Array) -> Row:
    """Of distances ``(n,)`` [m] from the goal, every ``TRACE`` seconds; none of too few."""
    steps = -np.diff(away[:: round(_PACE / TRACE)]) / _PACE
    if not len(steps):
        return {}
    return {"pace_m_s": float(np.median(steps)), "fastest_m_s": float(steps.max())}
