"""A lower bound on the cost of every placement for a task, by duality and branch and bound.

For any multipliers nu_k of the motion's equations, weak duality gives for places s_1 ... s_n

    cost(s)  >=  sum_k nu_k' d_k - 1/2 w_k' Q^-1 w_k  -  sum_i H(s_i),   w_k = nu_k - nu_(k+1),
    H(s) = 1/(2 R) sum_k sum_edges max(0, y_k' c(s))^2,                  y_k = T_k' nu_k,

c(s) being the motion that a unit along an edge of the friction cone makes at s. A robot's share H
depends on its own place only, so that its greatest value on a piece of the outline bounds a whole
box of placements. On a straight piece H is convex in s: its ends decide. On a curve c(s) lies in
the hull of the products of the piece's points with its extreme directions, stretched by 1/cos of
half the turn. Boxes are cut in halves, the one with the lowest bound first.

The bound holds whatever the multipliers are; those of the box's middle are good ones. It does not
rely on the search that it judges (``placement.py``), nor on its solver's accuracy.
"""

import heapq
import itertools
import math
from dataclasses import dataclass, field

import numpy as np

from grasp_opt.placement import Placer
from push_model.arrays import Array

_PIECES = {1: 96, 2: 40, 3: 20, 4: 12, 5: 8}  # of the outline at first, by the number of robots


@dataclass(frozen=True)
class Bound:
    """No allowed placement costs less than ``lower``; boxes: that were looked at."""

    lower: float
    boxes: int

    def gap(self, cost: float) -> float:
        """What a placement's cost is above the bound, over the cost."""
        return 1.0 - self.lower / cost


@dataclass(frozen=True)
class _Piece:
    """A part of the outline, from one way [m] to another.

    columns ``(2, m, 3)``: for each edge of the friction cone, motions whose hull, stretched,
    contains those of all contacts. straight: whether the m = 2 ends decide. reach: [m] that a
    robot's centre is from ``middle (2,)`` at most.
    """

    first: float
    last: float
    columns: Array
    stretch: float
    straight: bool
    middle: Array
    reach: float


@dataclass(order=True)
class _Box:
    lower: float
    number: int
    pieces: tuple[_Piece, ...] = field(compare=False)


class PlacementBound:
    """Bounds the cost of all placements of one ``Placer``'s task from below."""

    def __init__(self, placer: Placer) -> None:
        """Raises ValueError for a weight of zero, without which there is no dual."""
        if placer.force_weight <= 0.0 or placer.weights.min() <= 0.0:
            raise ValueError("all weights must be positive")
        self._placer, self._outline = placer, placer.outline
        _, _, self._ways, self._first, self._last = placer.outline.arrays
        self._apart = 2.0 * placer.radius + placer.settings.gap

    def lower(self, gap: float, known: float, most: int = 5000) -> Bound:
        """A bound within ``gap`` of a known cost, or the best one after so many boxes."""
        numbers = itertools.count()
        heap: list[_Box] = []
        whole = self._pieces(_PIECES[self._placer.count])
        for chosen in itertools.combinations_with_replacement(whole, self._placer.count):
            self._add(heap, chosen, next(numbers), -math.inf)
        looked = len(heap)
        while heap and heap[0].lower < known * (1.0 - gap) and looked < most:
            box = heapq.heappop(heap)
            k = max(range(len(box.pieces)), key=lambda i: box.pieces[i].last - box.pieces[i].first)
            for half in self._halves(box.pieces[k]):
                pieces = (*box.pieces[:k], half, *box.pieces[k + 1 :])
                self._add(heap, pieces, next(numbers), box.lower)
                looked += 1
        return Bound(min(known, heap[0].lower) if heap else known, looked)

    def _add(self, heap: list[_Box], pieces: tuple[_Piece, ...], number: int, least: float) -> None:
        """Add a box, unless its robots have no room beside each other anywhere in it."""
        for a, b in itertools.combinations(pieces, 2):
            away = float(np.hypot(*(a.middle - b.middle))) + a.reach + b.reach
            if away < self._apart:
                return
        middle = np.array([0.5 * (p.first + p.last) for p in pieces])
        lower = self._value(self._multipliers(middle), pieces)
        heapq.heappush(heap, _Box(max(least, lower), number, pieces))

    def _multipliers(self, way: Array) -> Array:
        """``(N, 3)`` nu of a placement: the sums of -Q e from each step on."""
        errors = self._placer.placement(way).errors
        nu: Array = -np.cumsum((self._placer.weights * errors)[::-1], axis=0)[::-1]
        return nu

    def _value(self, nu: Array, pieces: tuple[_Piece, ...]) -> float:
        """The bound of a box with the best multiple of multipliers ``(N, 3)``."""
        p = self._placer
        c, s, pace = p.turn.T
        y = np.column_stack(
            [c * nu[:, 0] + s * nu[:, 1], -s * nu[:, 0] + c * nu[:, 1], pace * nu[:, 2]]
        )
        w = nu - np.vstack([nu[1:], np.zeros(3)])
        linear, square = float((nu * p.steps).sum()), 0.5 * float((w**2 / p.weights).sum())
        for piece in pieces:
            pushed = np.maximum(0.0, y @ piece.columns.transpose(0, 2, 1)) ** 2  # (2, N, m)
            if piece.straight:
                share = float(pushed.sum(axis=(0, 1)).max())
            else:
                share = piece.stretch**2 * float(pushed.max(axis=2).sum())
            square += 0.5 * share / p.force_weight
        return max(0.0, linear) ** 2 / (4.0 * square) if square > 0.0 else 0.0

    def _pieces(self, count: int) -> list[_Piece]:
        """The outline where contacts may be, in about so many pieces that end at its corners."""
        total, corner = self._outline.length, self._placer.settings.corner
        corners = np.sort(self._outline.corners)
        if len(corners):
            ends = np.append(corners, corners[0] + total)
            arcs = [(a + corner, b - corner) for a, b in itertools.pairwise(ends)]
        else:
            arcs = [(0.0, total)]
        found = []
        for a, b in arcs:
            if b < a:
                continue
            parts = max(1, round(count * (b - a) / total))
            cuts = np.linspace(a, b, parts + 1)
            found += [self._piece(*pair) for pair in itertools.pairwise(cuts.tolist())]
        return found

    def _halves(self, piece: _Piece) -> tuple[_Piece, _Piece]:
        middle = 0.5 * (piece.first + piece.last)
        return self._piece(piece.first, middle), self._piece(middle, piece.last)

    def _piece(self, first: float, last: float) -> _Piece:
        total, inner = self._outline.length, self._ways[:-1]
        turns = np.concatenate([inner, inner + total])
        turns = turns[(turns > first + 1e-12) & (turns < last - 1e-12)]
        at = np.concatenate([[first], turns, [last - 1e-12]])
        contacts = self._outline.at(at)
        angles = np.unwrap(np.arctan2(contacts.normals[:, 1], contacts.normals[:, 0]))
        low, high = float(angles.min()), float(angles.max())
        straight = high - low < 1e-9
        sine, cosine = self._placer.cone
        points, columns = contacts.points, []
        for side in (-sine, sine):
            angle = np.array([low] if straight else [low, high]) + math.atan2(side, cosine)
            force = np.column_stack([np.cos(angle), np.sin(angle)])
            x, y = np.repeat(points, len(force), axis=0).T
            fx, fy = np.tile(force, (len(points), 1)).T
            columns.append(self._placer.scale * np.column_stack([fx, fy, x * fy - y * fx]))
        middle = self._outline.at(np.array([0.5 * (first + last)]))
        reach = 0.5 * (last - first) + self._placer.radius * (high - low)
        stretch = 1.0 / math.cos(0.5 * (high - low))
        centre = middle.centres(self._placer.radius)[0]
        return _Piece(first, last, np.array(columns), stretch, straight, centre, reach)
