"""First motions for a piece of the object's way that robots cannot hold: detours.

Twists in all directions are tried. Good are those that the robots can hold, and after which they
can hold what is left of the piece.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from grasp_opt.object_trajectory import screw
from grasp_opt.placement import PlacementSettings, Placer
from grasp_opt.slices import Work
from push_model.arrays import Array
from push_model.free_space import Obstacles
from push_model.object_way import WayFinder
from push_model.screws import screw_between, screw_poses
from push_model.specs import ObjectSpec

_TWISTS = 60  # that are tried
_LENGTHS = (0.15, 0.3, 0.6, 1.0)  # [m] of first motions
_DETOURS = 5  # of which the shortest is taken
_ESCAPES = 12  # motions that are tried when there is none
_SURE = 0.05  # of margin with which a detour must be held
_SEED = 1


def size(motion: Array, reach: float) -> float:
    """[m] that the point of an object at its reach [m] goes at most in a motion ``(3,)``."""
    return float(np.hypot(*motion[:2]) + reach * abs(motion[2]))


@dataclass(frozen=True)
class Holding:
    """What robots of one type can hold of an object's motions, were there nothing else.

    radius, reach: [m] of a robot; from the centre of mass to the outline's farthest point. speed
    [m/s], acceleration [m/s^2]: of that point. force: [N] of a robot.
    """

    item: ObjectSpec
    radius: float
    reach: float
    speed: float
    acceleration: float
    force: float
    placement: PlacementSettings
    _candidates: dict[int, Array] = field(default_factory=dict)  # by the number of robots

    def holds(self, motion: Array, count: int) -> Work[bool]:
        """Whether so many robots hold a motion ``(3,)`` from somewhere."""
        task = screw(np.zeros(3), motion, self.speed, self.acceleration, self.reach)
        asked = replace(
            self.placement, least_margin=_SURE, only_pushing=True, most_force=self.force
        )
        placer = Placer(
            self.item, task, count, self.radius, asked, candidates=self._candidates.get(count)
        )
        self._candidates[count] = yield from placer.candidates()
        return (yield from placer.existing())


class Detours:
    """Finds detours of one object; what is known of twists is kept by the number of robots."""

    def __init__(self, holding: Holding) -> None:
        self._holding = holding
        self._known: dict[int, list[Array]] = {}

    def around(
        self, pose: Array, motion: Array, finder: WayFinder, among: Obstacles, count: int
    ) -> Work[list[Array]]:
        """First motions ``(3,)`` instead of one from a pose ``(3,)``: those that so many robots can
        hold, after which they can hold what is left, the shortest first; then whatever leads nearer
        to its end."""
        holding = self._holding
        end = screw_poses(pose, motion, np.ones(1))[0]
        found: list[tuple[float, Array]] = []
        escapes: list[tuple[float, Array]] = []
        random = np.random.default_rng(_SEED)
        twists = yield from self._holdable(count)
        ways = [length * twist for twist in twists for length in _LENGTHS]
        for k in random.permutation(len(ways)):
            yield
            first = ways[k]
            if not finder.keeps(pose, first, among):
                continue
            there = screw_poses(pose, first, np.ones(1))[0]
            rest = screw_between(there, end)
            left = size(rest, holding.reach)
            escapes.append((left, first))
            if finder.keeps(there, rest, among) and (yield from holding.holds(rest, count)):
                found.append((size(first, holding.reach) + left, first))
                if len(found) == _DETOURS:
                    break
        tried = [
            [first for _, first in sorted(some, key=lambda pair: pair[0])[:most]]
            for some, most in ((found, _DETOURS), (escapes, _ESCAPES))
        ]
        return [*tried[0], *tried[1]]

    def _holdable(self, count: int) -> Work[list[Array]]:
        """Twists of unit size that so many robots can hold, of many in all directions."""
        if count not in self._known:
            holding, random = self._holding, np.random.default_rng(_SEED)
            drawn = random.normal(size=(_TWISTS, 3)) / [1.0, 1.0, holding.reach]
            kept = []
            for twist in drawn:
                unit = twist / size(twist, holding.reach)
                if (yield from holding.holds(unit, count)):
                    kept.append(unit)
            self._known[count] = kept
        return self._known[count]
