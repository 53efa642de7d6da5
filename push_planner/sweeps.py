"""Straight pushes with a wide flat front that take several objects out of an area at once.

A sweep begins behind the last object that it takes and ends where the front is beyond an edge of
the area. It takes an object whose centre lies well within the width of the front; an object that
the front would catch by a corner excludes a sweep, for it would turn away at the front's end.
Points are in the frame of the room, whose origin is at its centre.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from push_model.arrays import Array
from push_model.outlines import distance, overlap

_BESIDE = (-0.7, -0.375, 0.0, 0.375, 0.7)
"""Where the centre of an object lies in a sweep that is laid out for it, as a share of half the
front's width."""
_BESIDE_SHIFTED = tuple(0.1 * k for n in range(9) for k in sorted({-n, n}))
"""Likewise, of a shift: near to each other, for a front that only just fits between columns."""
_SHIFTS = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0)  # [m]
_RUN_UPS = 4  # lengths that are tried
_BEYOND = 0.08  # [m] beyond the edge that the front comes
_TAKEN = 0.79  # of half the width, within which the centre of an object that is taken lies


@dataclass(frozen=True)
class Front:
    """Of a robot. ahead: [m] from the robot's origin to the front. behind: [m] that the robot
    reaches behind its origin. half_width: [m] of the front."""

    ahead: float
    behind: float
    half_width: float

    @property
    def corner(self) -> float:
        """[m] from the robot's origin to its front corners: the radius of a turn on the spot."""
        return math.hypot(self.ahead, self.half_width)


@dataclass(frozen=True)
class Area:
    """To be cleared. edges: ``(2, 2)`` [m] each, over which objects may leave. limits: ``(2,)``
    [m], beyond which there are walls, in both directions. fixed: ``(k, 2)`` [m] outlines of what
    cannot be moved. outline: ``(k, 2)`` [m]. spare: [m] that an object needs beyond an edge."""

    outline: Array
    edges: tuple[Array, ...]
    limits: Array
    fixed: tuple[Array, ...]
    spare: float


@dataclass(frozen=True)
class Sweep:
    """start, end: ``(2,)`` [m] of the robot's origin. heading: [rad]. takes: a bit for each object
    that leaves the area; 0 of a shift."""

    start: Array
    end: Array
    heading: float
    takes: int


def sweeps(area: Area, front: Front, boxes: Sequence[Array], margin: float) -> list[Sweep]:
    """All sweeps over each edge that are laid out for an object and keep off what is fixed.

    Parameters
    ----------
    boxes: outlines ``(k, 2)`` [m] of the objects in the area.
    margin: [m] between front and objects at the start, and to what is not to be touched. A robot
        that turns on the spot at the start may touch objects all the same.
    """
    found: list[Sweep] = []
    for edge in area.edges:
        along = (edge[1] - edge[0]) / np.linalg.norm(edge[1] - edge[0])
        out = np.array([-along[1], along[0]])
        if out @ (edge.mean(axis=0) - area.outline.mean(axis=0)) < 0.0:
            out = -out
        found += _over(area, front, boxes, margin, edge, (along, out))
    return found


def shifts(area: Area, front: Front, boxes: Sequence[Array], margin: float) -> list[Sweep]:
    """Straight pushes within the area that bring an object to where a sweep takes it.

    For objects that no sweep takes, e.g. between columns. Arguments as of ``sweeps``. Pushes that
    would move a second object too are returned only if every possible push would.
    """
    sides = np.roll(area.outline, -1, axis=0) - area.outline
    found: list[Sweep] = []
    crowded: list[Sweep] = []
    for number, box in enumerate(boxes):
        others = [other for k, other in enumerate(boxes) if k != number]
        for side in sides / np.linalg.norm(sides, axis=1)[:, None]:
            out = np.array([-side[1], side[0]])
            middle = float((box @ side).mean())
            start = float((box @ out).min()) - margin - front.ahead
            for part, length in itertools.product(_BESIDE_SHIFTED, _SHIFTS):
                lane = middle + part * front.half_width
                ways = start * out + lane * side, (start + length) * out + lane * side
                shift = Sweep(*ways, math.atan2(out[1], out[0]), 0)
                far = float((box @ out).max()) + length + margin
                if not _has_room(area, front, shift, (side, out), margin, far):
                    continue
                begins = _swath(front, shift, (side, out), margin, start + front.ahead)
                if any(overlap(begins, other) for other in others):
                    continue
                way = _swath(front, shift, (side, out), margin, far)
                alone = not any(overlap(way, other) for other in others)
                if found and not alone:
                    continue
                moved = [box + (length - margin) * out, *others]
                if any(s.takes & 1 for s in sweeps(area, front, moved, margin)):
                    (found if alone else crowded).append(shift)
                    if alone:
                        break
    return found or crowded


def run_up(area: Area, front: Front, sweep: Sweep, boxes: Sequence[Array], margin: float) -> Sweep:
    """The sweep from farther back, so that a robot that turns on the spot at the start does not
    touch the objects before it; from less far back if there is no room, also for the turn. If there
    is none at all, the sweep itself. Arguments as of ``sweeps``."""
    out = np.array([math.cos(sweep.heading), math.sin(sweep.heading)])
    axes = np.array([-out[1], out[0]]), out
    for back in (front.corner - front.ahead) * np.linspace(1.0, 0.0, _RUN_UPS, endpoint=False):
        longer = replace(sweep, start=sweep.start - back * out)
        swath = _swath(front, longer, axes, margin, float(sweep.start @ out) + front.ahead)
        inside = (np.abs(swath) <= area.limits).all()
        turns = (np.abs(longer.start) + front.corner <= area.limits).all() and all(
            distance(other, longer.start[None])[0] >= front.corner for other in area.fixed
        )
        if inside and turns and not any(overlap(swath, b) for b in (*area.fixed, *boxes)):
            return longer
    return sweep


def _over(
    area: Area,
    front: Front,
    boxes: Sequence[Array],
    margin: float,
    edge: Array,
    axes: tuple[Array, Array],
) -> list[Sweep]:
    """Over one edge; ``axes`` are its direction and the one out of the area."""
    along, out = axes
    across = [box @ along for box in boxes]
    depth = [box @ out for box in boxes]
    low, high = sorted(edge @ along)
    level, half = float(edge[0] @ out), front.half_width
    middles = np.array([a.mean() for a in across])
    farthest = sorted(range(len(boxes)), key=lambda k: -float(depth[k].mean()))
    found, seen = [], set()
    for middle in middles:
        for part in _BESIDE:
            lane = float(middle) + part * half
            if lane - half / 2 < low or lane + half / 2 > high:
                continue
            lane_takes = [k for k in farthest if abs(middles[k] - lane) <= _TAKEN * half]
            for count in range(1, len(lane_takes) + 1):
                takes = sum(1 << k for k in lane_takes[:count])
                if (takes, round(lane, 2)) in seen:
                    continue
                seen.add((takes, round(lane, 2)))
                last = min(float(depth[k].min()) for k in lane_takes[:count])
                start = last - margin - front.ahead
                if any(
                    not takes >> k & 1
                    and abs(float(across[k].mean()) - lane) < half + margin + np.ptp(across[k]) / 2
                    and float(depth[k].max()) > start - front.behind
                    for k in range(len(boxes))
                ):
                    continue
                heading = math.atan2(out[1], out[0])
                end = max(start, level + _BEYOND - front.ahead)
                sweep = Sweep(start * out + lane * along, end * out + lane * along, heading, takes)
                if _has_room(area, front, sweep, (along, out), margin, level + area.spare):
                    found.append(sweep)
    return found


def _has_room(
    area: Area,
    front: Front,
    sweep: Sweep,
    axes: tuple[Array, Array],
    margin: float,
    far: float,
) -> bool:
    """Whether robot and objects of a sweep keep off walls and what is fixed, up to where the
    objects come at the farthest, ``far`` [m] along the second axis."""
    swath = _swath(front, sweep, axes, margin, far)
    if (np.abs(swath) > area.limits).any():
        return False
    return not any(overlap(swath, fixed) for fixed in area.fixed)


def _swath(
    front: Front, sweep: Sweep, axes: tuple[Array, Array], margin: float, far: float
) -> Array:
    """``(4, 2)`` [m] from the robot's rear at the start to ``far`` [m] along the second axis."""
    along, out = axes
    lane, rear = float(sweep.start @ along), float(sweep.start @ out) - front.behind
    wide = front.half_width + margin / 2
    corners = ((rear, -wide), (rear, wide), (far, wide), (far, -wide))
    return np.array([d * out + (lane + a) * along for d, a in corners])
