"""Delivers boxes to a receptacle: the next box, the way behind it, and the way to push it along.

A robot with a flat front pushes square boxes one by one. While it pushes, it drives arcs no tighter
than those on which a box that lies flat against the middle of the front sticks to it (``_RADIUS``).
The box may lie off the middle, so that a robot beside a wall can push a box along that wall. For
each of three such places (``_ASIDE``), the costs of the cheapest ways to the receptacle are
computed once for all poses of a lattice. On these ways robot and box keep off walls and columns, at
the poses of the lattice; between them, they may come nearer by a few centimetres.

The next box is the one for which the way of the robot behind it, by arcs ahead and back and by
turns on the spot, and the push cost least together. Places near boxes, this one too, cost more on
the way, but are not forbidden. Other boxes do not count during a push: the robot takes them along
or moves them aside, and what has become of them is seen before the next one.
"""

import math
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from push_model.arrays import Array
from push_model.distance_field import DistanceField, lookups
from push_model.occupancy import rasterise
from push_model.outlines import inside
from push_model.shapes import densified, rectangle
from push_model.specs import EnvironmentSpec, PolygonSpec
from push_planner.pose_lattice import Mask, Numbers, PoseLattice, costs_to, joined, least_costs

_RADIUS = 1.0
"""[m] of the tightest arc. Of a box of 0.44 m in front of the robot of Bench-Push, the resultant of
the contact then acts 0.18 m from the middle of the box's side, of which 0.22 m are half; and the
force is turned by 32 degrees, of which a friction of 1 allows 45. A box that lies 0.19 m towards
the inside of the bend may slip on it. The boxes there do not slide on."""
_ASIDE = (-0.12, 0.0, 0.12)  # [m] of the box from the middle of the front
_NEAR_ASIDE = 0.07  # [m] by which it may lie elsewhere
_PUSHED_TIGHT, _DRIVEN_TIGHT = 0.5, 0.05  # see PoseLattice.arcs
_TURN = 0.05  # [m] of way that a turn on the spot to the next heading is worth
_GAP = (0.02, 0.2)  # [m] between front and box where a push begins
_TURNED = 3.0  # [m/rad] of way that an angle between front and side of the box is worth
_STRAIGHT = 0.15  # [rad] by which a straight push may begin off its course
_MARGIN = 0.015  # [m] that the robot keeps from what is fixed
_DEAR = 6.0  # what a metre costs more for each half of the robot that would touch a box
_SPACING = 0.05  # [m] of points on outlines
_CELL = 0.02  # [m] of the map


@dataclass(frozen=True)
class DeliveryRoom:
    """A rectangle about the origin with walls around it.

    limits: ``(2,)`` [m] half its sides. fixed: ``(k, 2)`` [m] convex outlines of what cannot be
    moved. receptacle: ``(4, 2)`` [m] outline. robot: ``(k, 2)`` [m] outline in the robot frame,
    with a flat front across the x axis. box: [m] side of a box; grown: [m] by which boxes are
    larger in contact than their outlines.
    """

    limits: Array
    fixed: tuple[Array, ...]
    receptacle: Array
    robot: Array
    box: float
    grown: float

    @property
    def front(self) -> float:
        """[m] from the robot's origin."""
        return float(self.robot[:, 0].max())


_Options = tuple[Numbers, Array, Callable[[int], Array]]
"""Nodes, costs of the pushes from there [m], and the path ``(m, 3)`` of the push from a node."""


@dataclass(frozen=True)
class Delivery:
    """box: number of it. way: ``(n, 3)`` poses of the robot from where it is to behind the box.
    path: ``(m, 3)`` poses with the box, from there to the receptacle. node: of the lattice, at
    which the push begins."""

    box: int
    way: Array
    path: Array
    node: int


class BoxDelivery:
    """Of one room; ``next_push`` gives one push after another."""

    def __init__(self, room: DeliveryRoom) -> None:
        self._room = room
        polygons = tuple(PolygonSpec(tuple((x, y) for x, y in o.tolist())) for o in room.fixed)
        width, height = (2.0 * room.limits).tolist()
        field = self._field = DistanceField(
            rasterise(EnvironmentSpec((width, height), polygons=polygons, resolution=_CELL))
        )
        lattice = self._lattice = PoseLattice(room.limits, _RADIUS)
        outline = densified(room.robot, _SPACING)
        self._free: Mask = field.clearances(outline, lattice.poses) >= _MARGIN
        reach = float(np.hypot(*room.robot.T).max())
        places = np.ascontiguousarray(lattice.poses[:, :2])
        away = lookups(field.values, places, *field.args)
        drives = [lattice.arcs(self._free, sign, _DRIVEN_TIGHT) for sign in (1.0, -1.0)]
        self._edges = joined([*drives, lattice.turns(away >= reach + _MARGIN, _TURN)])

    @cached_property
    def _pushes(self) -> list[tuple[Array, Numbers]]:
        return [self._to_receptacle(aside) for aside in _ASIDE]

    def _to_receptacle(self, aside: float) -> tuple[Array, Numbers]:
        """Costs [m] to push a box there from each pose, and the next pose; see ``costs_to``."""
        room, lattice = self._room, self._lattice
        side = room.box + 2.0 * room.grown
        middle = np.array([room.front + room.grown + 0.5 * room.box, aside])
        body = densified(rectangle(side, side).outline + middle, _SPACING)
        free = self._free & (self._field.clearances(body, lattice.poses) > 0.0)
        goals = free.copy()
        for corner in rectangle(room.box, room.box).outline + middle:
            c, s = lattice.axes.T
            x = lattice.poses[:, 0] + c * corner[0] - s * corner[1]
            y = lattice.poses[:, 1] + s * corner[0] + c * corner[1]
            goals &= inside(room.receptacle, np.column_stack([x, y]))
        edges = lattice.arcs(free, 1.0, _PUSHED_TIGHT)
        return costs_to(edges, len(lattice.poses), goals)

    def next_push(
        self, pose: Array, boxes: Sequence[Array], tried: Collection[tuple[int, int]] = ()
    ) -> Delivery | None:
        """
        Parameters
        ----------
        pose: ``(3,)`` [m, m, rad] of the robot.
        boxes: outlines ``(4, 2)`` [m] of those that are not yet delivered.
        tried: boxes and nodes of pushes that have failed, which are not tried again.

        Returns
        -------
        The cheapest push; None where no box can be pushed to the receptacle.
        """
        lattice, here = self._lattice, self._start(pose)
        begins, to, costs = self._edges
        dear = self._dear([box.mean(axis=0) for box in boxes])
        weighted = costs * (1.0 + 0.5 * (dear[begins] + dear[to]))
        drive, before = least_costs((begins, to, weighted), len(lattice.poses), here)
        best, least = None, math.inf
        for number, box in enumerate(boxes):
            failed = np.array([n for k, n in tried if k == number], dtype=np.int64)
            for nodes, push, path in self._options(box):
                total = drive[nodes] + push
                total[np.isin(nodes, failed)] = math.inf
                if len(nodes) and total.min() < least:
                    least, best = float(total.min()), (number, int(nodes[total.argmin()]), path)
        if best is None:
            return None
        number, node, path = best
        way = [node]
        while way[-1] != here:
            way.append(int(before[way[-1]]))
        return Delivery(number, lattice.poses[way[::-1]], path(node), node)

    def _options(self, box: Array) -> Iterator[_Options]:
        """Nodes at which a push of a box may begin, one group after another."""
        for aside, (push, following) in zip(_ASIDE, self._pushes, strict=True):
            nodes, turned = self._behind(box, aside)
            yield nodes, push[nodes] + _TURNED * turned, partial(self._along, following)

    def _along(self, following: Numbers, node: int) -> Array:
        path = [node]
        while following[path[-1]] >= 0:
            path.append(int(following[path[-1]]))
        return self._lattice.poses[path]

    def _behind(self, box: Array, aside: float) -> tuple[Numbers, Array]:
        """Numbers of the poses just behind a box that lies so far [m] from the middle of the front,
        and angles [rad] between the front and the side of the box that is the most parallel."""
        lattice, room = self._lattice, self._room
        ahead, left = lattice.relative(box.mean(axis=0))
        far = room.front + room.box + _GAP[1]
        nodes = np.flatnonzero((ahead > 0.0) & (ahead < far) & (np.abs(left - aside) < _NEAR_ASIDE))
        off = box[None] - lattice.poses[nodes, None, :2]
        gap = np.einsum("nkd,nd->nk", off, lattice.axes[nodes]).min(axis=1)
        gap -= room.front + room.grown
        nodes = nodes[(gap >= _GAP[0]) & (gap <= _GAP[1])]
        side = box[1] - box[0]
        angle = lattice.poses[nodes, 2] - math.atan2(side[1], side[0])
        quarter = 0.5 * math.pi
        return nodes, np.abs((angle + 0.5 * quarter) % quarter - 0.5 * quarter)

    def _dear(self, middles: Sequence[Array]) -> Array:
        """What a metre costs beyond one at each pose: where a disc about either half of the robot
        would touch the circle about a box."""
        back = float(self._room.robot[:, 0].min())
        radius = 0.5 * float(np.ptp(self._room.robot[:, 1])) + math.sqrt(0.5) * self._room.box
        dear = np.zeros(len(self._lattice.poses))
        for middle in middles:
            ahead, left = self._lattice.relative(middle)
            for centre in (0.5 * self._room.front, 0.5 * back):
                dear += _DEAR * (np.hypot(ahead - centre, left) < radius)
        return dear

    def _start(self, pose: Array) -> int:
        """The free node nearest to a pose; half a metre counts as much as a radian."""
        node = int(self._lattice.nearest(pose[None])[0])
        if node >= 0 and self._free[node]:
            return node
        poses = self._lattice.poses
        turn = np.abs(np.angle(np.exp(1j * (poses[:, 2] - pose[2]))))
        off = np.hypot(*(poses[:, :2] - pose[:2]).T) + 0.5 * turn
        off[~self._free] = math.inf
        return int(off.argmin())


class StraightDelivery(BoxDelivery):
    """For comparison: straight pushes towards the middle of the receptacle, whatever is in their
    way, from where the middle of the front is behind the box. The ways there are as above."""

    def _options(self, box: Array) -> Iterator[_Options]:
        way = self._room.receptacle.mean(axis=0) - box.mean(axis=0)
        nodes, _ = self._behind(box, 0.0)
        course = math.atan2(way[1], way[0])
        off = np.abs(np.angle(np.exp(1j * (self._lattice.poses[nodes, 2] - course))))
        nodes = nodes[off <= _STRAIGHT]
        yield nodes, np.full(len(nodes), np.hypot(*way)), self._to_the_middle

    def _to_the_middle(self, node: int) -> Array:
        pose = self._lattice.poses[node]
        end = self._room.receptacle.mean(axis=0)
        ahead = self._room.front + 0.5 * self._room.box
        length = max(float(np.hypot(*(end - pose[:2]))) - ahead, _SPACING)
        parts = np.linspace(0.0, length, max(2, int(length / 0.4) + 1))
        course = math.atan2(*(end - pose[:2])[::-1])
        out = np.array([math.cos(course), math.sin(course)])
        return np.column_stack([pose[:2] + parts[:, None] * out, np.full(len(parts), course)])
