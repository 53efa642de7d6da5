"""The global input of Shahrokhi et al. in the setting of its authors: a room with two walls, a
hundred discs and a hexagon, in their physics.

Lengths, densities, frictions, restitutions, drag, noise, places and the goal are as in the code
that they published (aabecker/SwarmControlSandbox, January 2017,
``ObjectManipulation_Complete_Polished``). Bodies move without friction on the floor, and against a
drag. Their engine is Box2D; here it is pymunk, which solves contacts in another way, and in which
slow bodies bounce too. The mean velocity that slows the robots is that of all of them; their code
takes as many robots as are in the object's region.
"""

import math
from typing import Any

import numpy as np

from push_job.open_room import OpenRoom
from push_model.arrays import Array, Mask
from push_model.settings import SettingsError
from push_model.shape_specs import PolygonShape
from push_model.specs import ObjectSpec
from push_study.pool import Row
from push_study.rivals.global_input import CELLS, Floor, GlobalInput, Region

PUBLISHED = 90.0, 35.0
"""[s] mean and standard deviation, ten trials with a hundred robots (Shahrokhi et al. 2018)."""
THEIR_CODE = (
    275.2, 96.9, 56.6, 56.4, 55.8, 118.2, 60.2, 44.8, 59.3, 122.9, 65.4, 62.8, 73.9, 49.9,
    107.2, 66.0, 51.4, 76.5, 99.3, 85.2, 45.3, 63.4, 47.7, 352.5, 137.0, 56.1, 66.0, 88.2,
    52.5, 47.6, 152.1, 135.2, 82.7, 56.2, 82.1, 47.4, 81.7, 79.8, 170.1, 94.7, 71.1, 117.8,
    math.inf, 76.8, 59.9, 65.3, 118.0, 78.0, 67.2, 71.9, 57.0, 77.3, math.inf, 62.8, 49.7,
    131.4, 52.5, 46.3, 60.4, 122.8,
)  # fmt: skip
"""[s] times of 60 runs of their code as it is, in Chromium, each frame taken as a sixtieth of a
second of time; inf for none within 1000 s."""
ROBOTS, LIMIT = 100, 900.0  # [s]
_STEP = 1.0 / 60.0  # [s]
_SIZE = 18.0
_MIDDLE = np.array([10.0, 10.0])  # of the room, in their coordinates
_RADIUS, _APART, _ROW = 0.15, 0.3, 16  # of a robot; of their places, so many in a row
_FIRST = np.array([1.5, 18.5])
_OBJECT, _TARGET, _THERE = (7.0, 15.5), (16.0, 3.0), 2.0
_DENSITY, _HEAVY = 10.0, 6.0  # of robots, of the object
_FORCE, _SLOWED, _NOISE = 10.0, 1.0, 5.0  # of the input, less so much times the mean velocity
_DRAG = 1.0  # [1/s]
_RUBS = {"robot": 2.0, "object": 0.8, "wall": 0.5}  # two of them: the root of their product
_BOUNCE, _OBJECT_AT_WALL = 0.5**0.5, 0.25  # two shapes: their product; of these two
_SLOP = 0.005  # bodies overlap so much
_KINDS = {"robot": 1, "object": 2, "wall": 3}
_WALLS = ((5.0, 6.0, 20.0, 7.0), (0.0, 13.0333, 15.0, 14.0333))  # x0, y0, x1, y1
_OUTER = (
    (-9.0, 19.0, 29.0, 23.0),
    (-9.0, -3.0, 29.0, 1.0),
    (-3.0, 0.0, 1.0, 28.0),
    (19.0, 0.0, 23.0, 28.0),
)


def ready() -> None:
    """Raises SettingsError where pymunk is not installed."""
    _engine()


def _engine() -> Any:
    try:
        import pymunk
    except ImportError as error:
        raise SettingsError(
            f"pymunk is needed ({error}); install the extra 'rivals': "
            'pip install -c constraints.txt -e ".[rivals]"'
        ) from None
    return pymunk


def floor() -> Floor:
    """Their room: three main regions, one above the other, and the two ends of the walls."""

    def cells(x0: int, x1: int, y0: int, y1: int) -> Mask:
        found = np.zeros((CELLS, CELLS), dtype=bool)
        found[x0:x1, y0:y1] = True
        return found

    blocked = ~cells(1, CELLS - 1, 1, CELLS - 1) | cells(0, 15, 13, 14) | cells(5, 20, 6, 7)
    corners = np.array([[1, 19], [19, 19], [19, 7], [1, 13], [1, 1], [100, 100]]) - _MIDDLE
    c = [(float(x), float(y)) for x, y in corners]
    main = (
        Region(cells(1, 20, 13, 20), (c[0], c[1])),
        Region(cells(1, 20, 7, 13), (c[2], c[3])),
        Region(cells(1, 20, 1, 7), (c[4], c[5])),
    )
    transfer = (
        Region(cells(15, 20, 7, 20), (c[1], c[2])),
        Region(cells(1, 5, 1, 13), (c[3], c[4])),
    )
    pairs = [frozenset(p) for p in ((0, 1), (0, 2), (1, 2))]
    gather = {(0, p): c[1] for p in pairs} | {(2, p): c[4] for p in pairs}
    gather |= {(1, pairs[0]): c[2], (1, pairs[2]): c[3]}
    return Floor(blocked, main, transfer, gather)


class Room:
    """Their simulation. robots ``(100, 3)`` and item ``(3,)``: poses from the room's middle."""

    def __init__(self, seed: int) -> None:
        pymunk = _engine()
        self._random = np.random.default_rng(seed)
        self._space = space = pymunk.Space()
        space.damping, space.iterations = math.exp(-_DRAG), 10
        space.collision_slop = _SLOP
        hits = space.add_collision_handler(_KINDS["object"], _KINDS["wall"])
        hits.pre_solve = _bounces_less
        for x0, y0, x1, y1 in (*_WALLS, *_OUTER):
            corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
            space.add(self._rubs(pymunk.Poly(space.static_body, corners), "wall"))
        outline = hexagon().geometry.outline
        self._item = pymunk.Body()
        self._item.position = _OBJECT
        shape = self._rubs(
            pymunk.Poly(self._item, [tuple(map(float, p)) for p in outline]), "object"
        )
        shape.density = _HEAVY
        space.add(self._item, shape)
        self._robots = [pymunk.Body() for _ in range(ROBOTS)]
        for k, robot in enumerate(self._robots):
            place = _FIRST + _APART * np.array([k % _ROW, -(k // _ROW)])
            robot.position = tuple(map(float, place))
            disc = self._rubs(pymunk.Circle(robot, _RADIUS), "robot")
            disc.density = _DENSITY
            space.add(robot, disc)

    @staticmethod
    def _rubs(shape: Any, kind: str) -> Any:
        shape.friction, shape.elasticity = _RUBS[kind] ** 0.5, _BOUNCE
        shape.collision_type = _KINDS[kind]
        return shape

    @property
    def robots(self) -> Array:
        """See the class."""
        return np.array([[*(np.array(r.position) - _MIDDLE), r.angle] for r in self._robots])

    @property
    def item(self) -> Array:
        """See the class."""
        return np.array([*(np.array(self._item.position) - _MIDDLE), self._item.angle])

    def step(self, direction: Array) -> None:
        """A sixtieth of a second with the same force on all robots, and noise on each."""
        mean = np.mean([r.velocity for r in self._robots], axis=0)
        force = _FORCE * direction - _SLOWED * mean
        size = _NOISE * self._random.random(ROBOTS)
        angle = 2.0 * math.pi * self._random.random(ROBOTS)
        noise = size[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        for robot, (x, y) in zip(self._robots, force + noise, strict=True):
            robot.apply_force_at_world_point((float(x), float(y)), robot.position)
        self._space.step(_STEP)


def _bounces_less(arbiter: Any, space: Any, data: Any) -> bool:
    arbiter.restitution = _OBJECT_AT_WALL
    return True


def hexagon() -> ObjectSpec:
    """Their object; of what it weighs the law knows nothing."""
    angles = math.pi / 3.0 * np.arange(6)
    corners = tuple((1.5 * math.cos(a), 1.5 * math.sin(a)) for a in angles)
    return ObjectSpec(
        PolygonShape(corners), mass=1.0, height=0.1, floor_friction=0.3, contact_friction=0.3
    )


def run(seed: int, limit: float = LIMIT) -> Row:
    """One trial: until the object is within 2 of the goal in both directions, as with them."""
    room, target = Room(seed), np.array(_TARGET) - _MIDDLE
    arena = OpenRoom((_SIZE, _SIZE), hexagon(), _RADIUS, 1.0, target, seed)
    law, time = GlobalInput(arena, floor()), 0.0
    while time < limit:
        room.step(law.direction(time, room.item, room.robots))
        time += _STEP
        if np.abs(room.item[:2] - target).max() < _THERE:
            return {"success": True, "reason": "", "duration_s": time}
    return {"success": False, "reason": f"no end within {limit:g} s", "duration_s": time}
