"""What plans would cost if every push that need not loop could be made: the guess that leads A*.

A state is an object pose and a side that is ready to push there. From a pose a push on a side leads
to every other pose at which the robot has room, unless it would have to loop. Its cost is guessed
from the chord and from the angles at both ends; what crosses an obstacle in a straight line is
guessed to take a detour. Dijkstra's algorithm over all pairs of poses then costs less than a few
hundred push curves, and it knows what the distance along Gamma does not: which headings the
stable curvatures can reach, how many pushes that takes, and what the changes of side add.
"""

import heapq
import math
from typing import Any

import numba
import numpy as np

from push_model.distance_field import lookup

_NEAREST = 0.03  # [m] of a push
_WIDEST_COSINE = -0.4161468365471424  # of 2 rad: a push's end seen from its start, and vice versa
_SIGHT_STEP = 0.02  # [m]
_THICK = 0.2  # [m] of a chord through an obstacle that no push bends round
_DETOUR = 0.6  # [m] guessed for such a chord; less for one that only cuts a corner


@numba.njit(cache=True)  # infinities: no fast mathematics
def guessed_length(
    ax: float,
    ay: float,
    ac: float,
    sa: float,
    bx: float,
    by: float,
    bc: float,
    sb: float,
    left: float,
    right: float,
) -> float:
    """[m] of a push from a to b, poses as x, y, cosine, sine; inf where it would have to loop.

    Either pose must lie outside the tightest circle that the other one touches on that side; left
    and right are the diameters [m]. Otherwise the length is that of the cubic whose slopes over
    the chord are small.
    """
    dx, dy = bx - ax, by - ay
    square = dx * dx + dy * dy
    if square < _NEAREST * _NEAREST:
        return math.inf
    ahead, aside = ac * dx + sa * dy, ac * dy - sa * dx
    arriving, beside = bc * dx + sb * dy, sb * dx - bc * dy
    distance = math.sqrt(square)
    if ahead < _WIDEST_COSINE * distance or arriving < _WIDEST_COSINE * distance:
        return math.inf
    for along, off in ((ahead, aside), (arriving, beside)):
        diameter = left if off > 0.0 else right
        lateral = abs(off)
        if along > 0.0:
            if square < diameter * lateral:
                return math.inf
        elif distance < diameter:
            return math.inf
    a, b = -aside / distance, beside / distance
    return distance * (1.0 + (2.0 * a * a + 2.0 * b * b - a * b) / 30.0)


@numba.njit(cache=True)  # infinities: no fast mathematics
def _crossed(field: Any, a: Any, b: Any, least: float, ox: float, oy: float, scale: float) -> float:
    """How much of the straight line from a to b is nearer to obstacles than ``least``: a fraction
    of ``_THICK``, 1 at most."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    length = math.hypot(dx, dy)
    way, crossed = 0.0, 0.0
    while way < length and crossed < _THICK:
        room = lookup(field, a[0] + dx * way / length, a[1] + dy * way / length, ox, oy, scale)
        if room < least:
            crossed += _SIGHT_STEP
        way += max(_SIGHT_STEP, room - least)  # no obstacle can be nearer than that
    return min(1.0, crossed / _THICK)


@numba.njit(cache=True)  # infinities: no fast mathematics
def _guess(
    i: int,
    j: int,
    side: int,
    poses: Any,
    robots: Any,
    diameters: Any,
    window: Any,
    sight: Any,
    least: float,
    field: Any,
    ox: float,
    oy: float,
    scale: float,
) -> float:
    """Guessed length [m] of the push from pose i to pose j; sight remembers what is crossed."""
    a, b = robots[side, i], robots[side, j]
    length = guessed_length(
        a[0], a[1], a[3], a[4], b[0], b[1], b[3], b[4], diameters[side, 0], diameters[side, 1]
    )
    if length < math.inf:
        known = sight[i, j - window[i, 0]]
        if known == 0:
            known = 1 + round(100.0 * _crossed(field, poses[i], poses[j], least, ox, oy, scale))
            sight[i, j - window[i, 0]] = known
        length += 0.01 * (known - 1) * _DETOUR
    return float(length)


@numba.njit(cache=True)  # infinities: no fast mathematics
def rough_costs(
    poses: Any,
    robots: Any,
    room: Any,
    diameters: Any,
    push_cost: float,
    change_cost: float,
    bound: float,
    shut: Any,
    window: Any,
    sight: Any,
    least: float,
    field: Any,
    ox: float,
    oy: float,
    scale: float,
) -> Any:
    """Guessed cost [m] to come from the first pose to every state; the last pose is the goal.

    Parameters
    ----------
    poses: ``(n, 3)`` of the object.
    robots: ``(sides, n, 5)`` x, y, theta, cosine, sine of the robot in contact.
    room: ``(sides, n)`` whether the robot can come to that contact.
    diameters: ``(sides, 2)`` [m] of the tightest circles to the left and to the right.
    bound: [m] states whose guess and distance to the goal exceed it are left out.
    shut: ``(sides, n)`` whether the push from the first pose is known not to be there.
    window: ``(n, 2)`` of each pose, the first and one past the last one that it has pushes with.
    sight: ``(n, widest window)`` int8, zeros at first: what is known of the chords.
    least: [m] distance that a chord keeps from obstacles unless it crosses them.

    Returns
    -------
    ready ``(n, sides)``: cost until the robot is ready to push on that side; arrived
    ``(n, sides)``: until a push on that side has ended there; inf where there is no way.
    """
    n, sides = poses.shape[0], robots.shape[0]
    goal = n - 1
    ready = np.full((n, sides), math.inf)
    arrived = np.full((n, sides), math.inf)
    remaining = np.hypot(poses[:, 0] - poses[goal, 0], poses[:, 1] - poses[goal, 1])
    queue = [(0.0, -1)]
    for s in range(sides):
        if room[s, 0]:
            ready[0, s] = 0.0
            heapq.heappush(queue, (0.0, s))
    while len(queue) > 0:
        cost, state = heapq.heappop(queue)
        if state < 0:
            continue
        i, s = state // sides, state % sides
        if i == goal or cost > ready[i, s]:
            continue
        for j in range(max(1, window[i, 0]), window[i, 1]):
            if j == i or not room[s, j] or (i == 0 and shut[s, j]):
                continue
            dx, dy = robots[s, j, 0] - robots[s, i, 0], robots[s, j, 1] - robots[s, i, 1]
            chord = math.sqrt(dx * dx + dy * dy)
            before = cost + push_cost
            if before + chord >= arrived[j, s] or before + chord + remaining[j] >= bound:
                continue
            length = _guess(
                i, j, s, poses, robots, diameters, window, sight, least, field, ox, oy, scale
            )
            after = before + length
            if after >= arrived[j, s]:
                continue
            arrived[j, s] = after
            if j == goal:
                continue
            for t in range(sides):
                if room[t, j]:
                    total = after
                    if t != s:
                        total += change_cost + math.hypot(
                            robots[t, j, 0] - robots[s, j, 0], robots[t, j, 1] - robots[s, j, 1]
                        )
                    if total < ready[j, t]:
                        ready[j, t] = total
                        heapq.heappush(queue, (total, j * sides + t))
    return ready, arrived


@numba.njit(cache=True)  # infinities: no fast mathematics
def pushes_into(
    j: int,
    following: int,
    cost: float,
    weight: float,
    poses: Any,
    robots: Any,
    room: Any,
    diameters: Any,
    push_cost: float,
    change_cost: float,
    bound: float,
    shut: Any,
    window: Any,
    sight: Any,
    least: float,
    field: Any,
    ox: float,
    oy: float,
    scale: float,
    ready: Any,
) -> Any:
    """Pushes that end at pose j, followed by a push on a side (-1: none), best first.

    cost: [m] from pose j on. Returns estimates of the whole plan's cost [m], with what lies before
    the push weighted, and states i * sides + s; those whose plain guess exceeds the bound are left
    out.
    """
    n, sides = poses.shape[0], robots.shape[0]
    estimates = np.empty(n * sides)
    states = np.empty(n * sides, dtype=np.int64)
    found = 0
    for s in range(sides):
        if not room[s, j]:
            continue
        before = cost + push_cost
        if following >= 0 and following != s:
            before += change_cost + math.hypot(
                robots[following, j, 0] - robots[s, j, 0],
                robots[following, j, 1] - robots[s, j, 1],
            )
        for i in range(window[j, 0], min(window[j, 1], n - 1)):
            if i == j or before + ready[i, s] >= bound or (i == 0 and shut[s, j]):
                continue
            length = _guess(
                i, j, s, poses, robots, diameters, window, sight, least, field, ox, oy, scale
            )
            if before + length + ready[i, s] < bound:
                estimates[found] = before + length + weight * ready[i, s]
                states[found] = i * sides + s
                found += 1
    order = np.argsort(estimates[:found])
    return estimates[:found][order], states[:found][order]
