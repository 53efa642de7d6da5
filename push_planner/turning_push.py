"""Pushes on a corner of the object, which turn it until a side lies flush against the bumper.

Where the object stands so close to walls that no stable push leads away, such a push turns it more
tightly than any stable push: the robot comes from the side, parallel to the wall or away from it.
How far the object turns depends on the friction, so that a new plan follows from where it ends.

Poses are of the object's centre of mass here, as in ``PushScene``.
"""

import math
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_model.corner_push import CornerPush, corner_push, touching
from push_model.push_segment import PushSegment
from push_model.trajectory import line
from push_planner.push_plan import Progress
from push_planner.robot_path import has_way
from push_planner.scene import PushScene, PushSide

_HEADINGS = 48  # of the robot that are tried
_PLACES = (-0.8, -0.4, 0.0, 0.4, 0.8)  # of the corner on the bumper, in half widths
_FRICTION = (0.5, 2.0)  # of the believed friction, with which the object must turn, too
_ASIDE = 0.003  # [m] by which the corner may be beside its place
_MOST = 0.12  # [m] of a push
_APART = 0.002  # [m] of travel between poses whose clearance is looked at
_LOSS = 0.001  # [m] of clearance between them
_SPEED = 0.05  # [m/s]
_ALIKE = 0.3  # [rad] between headings of the object that count as different
_LEAST = 0.1  # [rad] that the object turns


@dataclass(frozen=True)
class _Offer:
    """A push that can be made. begin: pose ``(3,)`` of the robot in contact; standoff: where its
    approach begins; sides: with room behind them afterwards."""

    begin: Array
    standoff: Array
    push: CornerPush
    after: Array
    side: PushSide
    clearance: float
    sides: int

    @property
    def turned(self) -> float:
        """[rad] that the object turns."""
        return abs(float(self.push.poses[-1, 2] - self.push.poses[0, 2]))


def turning_search(
    scene: PushScene, start: Array, robot: Array | None, most: int
) -> Generator[Progress, None, list[PushSegment]]:
    """Pushes on a corner of an object at ``start`` ``(3,)``, the most promising ones first; in
    slices.

    Parameters
    ----------
    robot: ``(3,)`` its pose, from which it must have a way there; None if unknown.
    most: number of pushes at most.

    Returns
    -------
    Pushes after which more sides have room come first, then those that turn the object more. Empty
    for an object that is not convex.
    """
    if not scene.shape.convex or most == 0:
        return []
    found: list[_Offer] = []
    for heading in np.arange(_HEADINGS) * (2.0 * np.pi / _HEADINGS):
        found += _offers(scene, start, float(heading))
        yield Progress("pushes on a corner", None)
    found.sort(key=lambda o: (-o.sides, -o.turned))
    outline = se2.transform(start, scene.shape.outline)
    ways = scene.field, scene.robot, scene.settings
    chosen: list[_Offer] = []
    for offer in found:
        if len(chosen) == most:
            break
        turned = [abs(float(se2.wrap(offer.after[2] - other.after[2]))) for other in chosen]
        if min(turned, default=math.inf) < _ALIKE:
            continue
        if robot is None or has_way(*ways, robot, offer.standoff, outline):
            chosen.append(offer)
    return [_segment(scene, start, offer) for offer in chosen]


def _offers(scene: PushScene, start: Array, heading: float) -> Iterator[_Offer]:
    """The pushes that can be made with a heading [rad] of the robot."""
    bumper, item = scene.robot.flat_bumper, scene.item
    half, face = 0.5 * bumper.width, scene.robot.push_distance
    radius = item.limit_surface().radius
    frictions = [item.contact_friction * factor for factor in (1.0, *_FRICTION)]
    leaving = scene.leaving(start)
    keeps = scene.robot_keeps(leaving)
    outline = scene.shape.outline
    for place in _PLACES:
        relative = float(start[2]) - heading
        at = touching(outline, relative, face, place * half)
        begin = se2.compose(start, se2.inverse(at))
        back = scene.room_to_back_off(begin, leaving)
        if back is None:
            continue
        first = corner_push(outline, at, face, half, item.contact_friction, radius, _MOST)
        if first is None or abs(float(first.poses[-1, 2] - relative)) < _LEAST:
            continue
        side = _flush(scene.sides, first)
        others = [
            corner_push(outline, at + [0.0, aside, 0.0], face, half, friction, radius, _MOST)
            for friction in frictions
            for aside in (0.0, -_ASIDE, _ASIDE)
        ]
        known = [push for push in others if push is not None]
        if side is None or len(known) < len(others):
            continue
        length = float(first.travel[-1])
        room = _clearance(scene, begin, known, length, min(leaving, keeps), keeps)
        if room is None:
            continue
        end = se2.compose(begin, np.array([length, 0.0, 0.0]))
        after = se2.compose(end, first.poses[-1])
        there = scene.leaving(after)
        sides = sum(scene.has_room(s.robot_pose(after), s, there) for s in scene.sides)
        standoff = se2.compose(begin, np.array([-back, 0.0, 0.0]))
        yield _Offer(begin, standoff, first, after, side, room, sides)


def _flush(sides: Sequence[PushSide], push: CornerPush) -> PushSide | None:
    """The side that lies against the bumper at the end."""
    for side in sides:
        if abs(float(se2.wrap(side.grasp[2] - push.poses[-1, 2]))) < 1e-3:
            return side
    return None


def _clearance(
    scene: PushScene,
    begin: Array,
    pushes: Sequence[CornerPush],
    length: float,
    item_keeps: float,
    robot_keeps: float,
) -> float | None:
    """[m] of robot and object over so much travel [m], however the object moves; None if it is too
    little. An object that is flush before moves straight on."""
    least = math.inf
    for travel in np.linspace(0.0, length, max(2, int(length / _APART) + 1)):
        pose = se2.compose(begin, np.array([travel, 0.0, 0.0]))
        room = scene.robot_clearance(pose)
        if room < robot_keeps:
            return None
        least = min(least, room)
        for push in pushes:
            number = min(int(np.searchsorted(push.travel, travel)), len(push.travel) - 1)
            room = scene.object_clearance(se2.compose(pose, push.poses[number]))
            if room < item_keeps:
                return None
            least = min(least, room)
    return least - _LOSS


def _segment(scene: PushScene, start: Array, offer: _Offer) -> PushSegment:
    length = float(offer.push.travel[-1])
    item, speed = scene.item, min(_SPEED, scene.settings.push_speed)
    return PushSegment(
        offer.side.index,
        item.geometric_pose(start),
        item.geometric_pose(offer.after),
        offer.begin,
        se2.compose(offer.begin, np.array([length, 0.0, 0.0])),
        offer.standoff,
        length,
        length,
        length,
        offer.side.nominal,
        offer.clearance,
        line(offer.begin, length, speed, scene.settings.push_acceleration),
        turns=True,
    )
