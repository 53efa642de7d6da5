"""Object poses that are lined up with the narrow parts of a guide path.

Where the free space is little wider than the object, a push passes only if its start pose is right
to about a millimetre and a degree. Random poses and poses along the guide path are not. For each
narrow stretch and each side, a straight line is shifted and turned until a straight push along it
has the greatest clearance. Candidate poses are placed on this line, before and behind the stretch,
and where the lines of two stretches meet.
"""

import math
from dataclasses import dataclass

import numpy as np

from push_model import se2
from push_model.arrays import Array
from push_planner.candidate_poses import Candidates
from push_planner.guide_path import GuidePath
from push_planner.push_curve import PushCurve
from push_planner.scene import PushScene, PushSide

_NARROW = 2.0  # circumradii of the object that the way has to either side, at most
_SPACING = 0.02  # [m] between points of the path that are looked at
_STRAIGHT = 0.35  # [rad] that the path turns at most within one stretch
_SHORTEST = 0.06  # [m] of a stretch
_BEYOND = (0.0, 0.1, 0.2, 0.35, 0.55, 0.8)  # [m] before and behind a stretch, where poses are set
_RING = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1))
_SHIFT, _TURN = 0.016, 0.064  # [m], [rad] of the first steps by which a line is moved
_FINEST = 0.05  # of the first steps
_MOVES = 30  # steps and halvings of one line at most
_GAIN = 1e-4  # [m] of clearance that a step must bring
_ASIDE = 0.08  # [m] that a line is moved at most
_MOST = 24  # stretches of one path that get a line
_SAME = 0.02  # [rad] between directions of lines that do not meet


@dataclass(frozen=True)
class _Line:
    """A straight way through a stretch: from and to ``(2,)`` [m], direction [rad], and where the
    stretch lies on the guide path [m]."""

    start: Array
    end: Array
    heading: float
    way: tuple[float, float]

    def at(self, along: float) -> Array:
        """Point so far [m] from the start."""
        point: Array = self.start + along * np.array(
            [math.cos(self.heading), math.sin(self.heading)]
        )
        return point

    @property
    def length(self) -> float:
        """[m]."""
        return float(np.hypot(*(self.end - self.start)))


def narrow_stretches(scene: PushScene, guide: GuidePath) -> list[tuple[Array, Array]]:
    """Stretches of a path with little clearance on which it goes about straight.

    Returns
    -------
    For each, its points ``(n, 2)`` [m] and where they lie on the path ``(n,)`` [m].
    """
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(guide.points, axis=0).T))])
    inner = np.linspace(0.0, way[-1], max(2, math.ceil(way[-1] / _SPACING) + 1))
    at = np.union1d(inner, way)
    points = np.column_stack([np.interp(at, way, guide.points[:, k]) for k in (0, 1)])
    step = np.diff(points, axis=0)
    headings = np.arctan2(step[:, 1], step[:, 0])
    limit = _NARROW * scene.shape.circumradius
    narrow = np.array([scene.field.at(x, y) < limit for x, y in points])
    found: list[tuple[Array, Array]] = []
    first = -1
    for k in range(len(points)):
        turned = 0 <= first < k < len(headings) and (
            abs(se2.wrap(headings[k] - headings[first])) > _STRAIGHT
        )
        if first >= 0 and (not narrow[k] or turned or k == len(points) - 1):
            if at[k] - at[first] > _SHORTEST:
                found.append((points[first : k + 1], at[first : k + 1]))
            first = k if narrow[k] else -1
        elif first < 0 and narrow[k]:
            first = max(0, k - 1)
    return found[:_MOST]


def _fitted(scene: PushScene, points: Array, way: Array) -> list[tuple[_Line, PushSide]]:
    """For each side the line near a stretch on which a straight push keeps most clearance."""
    middle, chord = 0.5 * (points[0] + points[-1]), points[-1] - points[0]
    half, heading = 0.5 * float(np.hypot(*chord)), math.atan2(chord[1], chord[0])

    def line(aside: float, turn: float) -> _Line:
        ahead = half * np.array([math.cos(heading + turn), math.sin(heading + turn)])
        centre = middle + aside * np.array([-math.sin(heading), math.cos(heading)])
        return _Line(centre - ahead, centre + ahead, heading + turn, (way[0], way[-1]))

    def clearance(side: PushSide, shift: float, turn: float, needed: float) -> float:
        offer, size = line(shift, turn), 2.0 * half
        angle = offer.heading + side.contact.heading
        ends = [side.robot_pose(np.array([*p, angle])) for p in (offer.start, offer.end)]
        return scene.curve_clearance(PushCurve(ends[0], ends[1], size, size, size), side, needed)

    found, shift, turn = [], 0.0, 0.0
    for side in scene.sides:
        # Where the last side's line does as well for this one, the first steps find nothing better.
        best = clearance(side, shift, turn, 0.0)
        step = 1.0
        for _ in range(_MOVES):
            offers = [
                (min(max(shift + i * step * _SHIFT, -_ASIDE), _ASIDE), turn + j * step * _TURN)
                for i, j in _RING
            ]
            values = [clearance(side, *offer, best + _GAIN) for offer in offers]
            k = int(np.argmax(values))
            if values[k] > best + _GAIN and abs(offers[k][1]) <= _STRAIGHT:
                best, (shift, turn) = values[k], offers[k]
                continue
            step *= 0.5
            if step < _FINEST or best <= 0.0:
                break
        if best >= scene.settings.safety_distance:
            found.append((line(shift, turn), side))
    return found


def lined_up(scene: PushScene, guide: GuidePath) -> Candidates:
    """Poses on the lines through the narrow stretches of a path."""
    result = Candidates(np.zeros((0, 3)), np.zeros(0))
    before: list[tuple[_Line, float]] = []
    for points, way in narrow_stretches(scene, guide):
        lines = [(line, s.contact.heading) for line, s in _fitted(scene, points, way)]
        for line, turn in lines:
            poses, at = [], []
            for beyond in _BEYOND:
                for along, here in ((-beyond, line.way[0]), (line.length + beyond, line.way[1])):
                    poses.append((*line.at(along), se2.wrap(line.heading + turn)))
                    at.append(here + math.copysign(beyond, along))
            result += Candidates(np.array(poses), np.array(at))
            for earlier, other in before:
                result += _met(earlier, other, line, turn)
        before = lines or before
    return result


def _met(a: _Line, a_turn: float, b: _Line, b_turn: float) -> Candidates:
    """Where two lines meet: poses turned as for the one and for the other."""
    cross = math.sin(b.heading - a.heading)
    if abs(cross) < _SAME:
        return Candidates(np.zeros((0, 3)), np.zeros(0))
    gap = b.start - a.start
    along = (gap[0] * math.sin(b.heading) - gap[1] * math.cos(b.heading)) / cross
    angles = [se2.wrap(line.heading + turn) for line, turn in ((a, a_turn), (b, b_turn))]
    poses = np.array([(*a.at(along), angle) for angle in angles])
    return Candidates(poses, np.full(2, 0.5 * (a.way[1] + b.way[0])))
