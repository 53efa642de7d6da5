"""Estimated costs of plans, computed without push curves: the heuristic of the A* search.

A state is an object pose, with a side at which the robot is ready to push. A push on a side leads
from one pose to another one if the robot has room at both, and if the chord between them is long
enough for the change of heading (shortest_chord.py). The length of the push is estimated from the
chord and from the angles at both ends.

Three cubics between the same ends represent the push. Where the object fits along none of them in
any orientation, a detour is added to the estimate, or the push is ruled out.

Dijkstra's algorithm then runs over all pairs of poses that are not too far apart along Gamma. It
takes less time than a few hundred push curves. In contrast to the distance along Gamma, the
estimate contains which headings the stable curvatures can reach, how many pushes are necessary, the
cost of changing the side, and pushes that walls block.
"""

import heapq
import math
from typing import Any

import numba
import numpy as np

from push_model.distance_field import lookup
from push_planner.shortest_chord import WIDEST, chord

_NEAREST = 0.03  # [m] of a push
_WIDEST_COSINE = math.cos(WIDEST)
_SIGHT_STEP = 0.02  # [m]
_THICK = 0.1  # [m] of a cubic through obstacles that no push avoids
_TANGENTS = (1.0, 0.5, 1.6)  # of the cubics, over the chord; those of pushes are 0.3 to 2.6
_DETOUR = 0.6  # [m] guessed for such a cubic; less for one that only cuts a corner
BLOCKED = 101
"""Value in ``sight`` of a push that is ruled out, by its cubics or because it was tried in vain."""
_SURE = 0.93  # of the shortest chord in the table, which is interpolated


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
    chords: Any,
) -> float:
    """Estimated length [m] of a push between two robot poses a and b.

    It is infinite if the push would have to make a loop. Otherwise it is the length of a cubic with
    small slopes relative to its chord.

    Parameters
    ----------
    ax, ay, ac, sa: [m] position of the robot at the start, cosine and sine of its heading.
    bx, by, bc, sb: the same at the end.
    chords: ``(k, k)`` [m] table of minimum chord lengths, see ``shortest_chords``.
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
    if distance < _SURE * chord(chords, aside / (distance + ahead), beside / (distance + arriving)):
        return math.inf
    a, b = aside / distance, beside / distance
    return distance * (1.0 + (2.0 * a * a + 2.0 * b * b + a * b) / 30.0)


@numba.njit(cache=True)  # infinities: no fast mathematics
def _crossed(
    field: Any,
    a: Any,
    b: Any,
    tangent: float,
    grasp: Any,
    least: float,
    ox: float,
    oy: float,
    scale: float,
) -> float:
    """Length of the object's path that is closer to obstacles than ``least`` [m].

    The path is that of the cubic from robot pose a to robot pose b. The length is given as a
    fraction of ``_THICK``, and is 1 at most.

    tangent: length of the tangents at both ends, relative to the chord. grasp: x, y [m] of the
    object in the robot frame.
    """
    dx, dy = b[0] - a[0], b[1] - a[1]
    chord_length = math.hypot(dx, dy)
    size = tangent * chord_length
    t, crossed = 0.0, 0.0
    while t < 1.0 and crossed < _THICK:
        h, hi, hf = t * t * (3.0 - 2.0 * t), t * (t - 1.0) ** 2, t * t * (t - 1.0)
        d, di, df = 6.0 * t * (1.0 - t), (t - 1.0) * (3.0 * t - 1.0), t * (3.0 * t - 2.0)
        x = a[0] + h * dx + size * (hi * a[3] + hf * b[3])
        y = a[1] + h * dy + size * (hi * a[4] + hf * b[4])
        vx, vy = d * dx + size * (di * a[3] + df * b[3]), d * dy + size * (di * a[4] + df * b[4])
        speed = math.hypot(vx, vy) + 1e-9
        qx = x + (vx * grasp[0] - vy * grasp[1]) / speed
        qy = y + (vy * grasp[0] + vx * grasp[1]) / speed
        room = lookup(field, qx, qy, ox, oy, scale)
        if room < least:
            crossed += _SIGHT_STEP
            if least - room > 0.5 * _THICK:  # the way in and the way out are as long
                return 1.0
        # No obstacle can be nearer than the room that there is.
        t += max(_SIGHT_STEP, 0.7 * (room - least)) / max(speed, 0.5 * chord_length)
    return min(1.0, crossed / _THICK)


@numba.njit(cache=True)  # infinities: no fast mathematics
def _guess(
    i: int,
    j: int,
    side: int,
    robots: Any,
    chords: Any,
    grasps: Any,
    window: Any,
    sight: Any,
    least: Any,
    field: Any,
    ox: float,
    oy: float,
    scale: float,
) -> float:
    """Estimated length [m] of the push from pose i to pose j, with the detour around obstacles.

    ``sight`` stores how much of the path obstacles block, so that it is computed only once.
    """
    a, b = robots[side, i], robots[side, j]
    length = guessed_length(a[0], a[1], a[3], a[4], b[0], b[1], b[3], b[4], chords[side])
    if length < math.inf:
        known = sight[side, i, j - window[i, 0]]
        if known == 0:
            near = least[0] if i == 0 else least[1]
            part = 1.0
            for tangent in _TANGENTS:
                part = min(part, _crossed(field, a, b, tangent, grasps[side], near, ox, oy, scale))
                if part == 0.0:
                    break
            known = 1 + round((BLOCKED - 1) * part)
            sight[side, i, j - window[i, 0]] = known
        if known >= BLOCKED:
            return math.inf
        length += (known - 1) / (BLOCKED - 1) * _DETOUR
    return float(length)


@numba.njit(cache=True)  # infinities: no fast mathematics
def rough_costs(
    poses: Any,
    robots: Any,
    room: Any,
    chords: Any,
    grasps: Any,
    pace: float,
    begin: float,
    changes: Any,
    bound: float,
    window: Any,
    sight: Any,
    least: Any,
    field: Any,
    ox: float,
    oy: float,
    scale: float,
) -> Any:
    """Estimated cost [s] from the first pose to every state, by Dijkstra's algorithm.

    All poses are in the world frame. The first pose is the start, the last one is the goal.

    Parameters
    ----------
    poses: ``(n, 3)`` [m, m, rad] of the object's centre of mass.
    robots: ``(sides, n, 5)`` x, y [m], theta [rad], cosine, sine of the robot in contact.
    room: ``(sides, n)`` whether the robot can reach this contact.
    chords: ``(sides, k, k)`` [m] tables of minimum chord lengths.
    grasps: ``(sides, 3)`` poses of the object in the robot frame.
    pace: [s/m] of a push. begin: [s] that the first push takes longer.
    changes: ``(sides, sides)`` [s] of a change from one side to another, 0 on the diagonal.
    bound: [s] states are left out if their estimate plus their distance to the goal exceeds it.
    window: ``(n, 2)`` for each pose, the range of poses (first, one past the last) to which it may
        be connected by a push.
    sight: ``(sides, n, widest window)`` int8, what is known about the pushes; all zeros at first.
    least: ``(2,)`` [m] distance that the centre of mass keeps from obstacles, on pushes out of the
        first pose and on all other pushes.
    field, ox, oy, scale: distance field of the map, and the transformation into its cells.

    Returns
    -------
    ready: ``(n, sides)`` cost until the robot is ready to push on this side.
    arrived: ``(n, sides)`` cost until a push on this side has ended at the pose.
    Both are infinite where no sequence of pushes leads to the state.
    """
    n, sides = poses.shape[0], robots.shape[0]
    goal = n - 1
    ready = np.full((n, sides), math.inf)
    arrived = np.full((n, sides), math.inf)
    remaining = np.hypot(poses[:, 0] - poses[goal, 0], poses[:, 1] - poses[goal, 1])
    queue = [(0.0, -1)]
    for s in range(sides):
        if room[s, 0]:
            ready[0, s] = begin
            heapq.heappush(queue, (begin, s))
    while len(queue) > 0:
        cost, state = heapq.heappop(queue)
        if state < 0:
            continue
        i, s = state // sides, state % sides
        if i == goal or cost > ready[i, s]:
            continue
        for j in range(max(1, window[i, 0]), window[i, 1]):
            if j == i or not room[s, j]:
                continue
            dx, dy = robots[s, j, 0] - robots[s, i, 0], robots[s, j, 1] - robots[s, i, 1]
            straight = math.sqrt(dx * dx + dy * dy)
            if cost + pace * straight >= min(arrived[j, s], bound - pace * remaining[j]):
                continue
            # Without the obstacles, which take far longer to look for.
            a, b = robots[s, i], robots[s, j]
            length = guessed_length(a[0], a[1], a[3], a[4], b[0], b[1], b[3], b[4], chords[s])
            if cost + pace * length >= arrived[j, s]:
                continue
            length = _guess(
                i, j, s, robots, chords, grasps, window, sight, least, field, ox, oy, scale
            )
            after = cost + pace * length
            if after >= arrived[j, s]:
                continue
            arrived[j, s] = after
            if j == goal:
                continue
            for t in range(sides):
                if room[t, j]:
                    total = after + changes[s, t]
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
    chords: Any,
    grasps: Any,
    pace: float,
    changes: Any,
    bound: float,
    window: Any,
    sight: Any,
    least: Any,
    field: Any,
    ox: float,
    oy: float,
    scale: float,
    ready: Any,
) -> Any:
    """Pushes that end at pose j, in the order of the estimated cost of the whole plan.

    Parameters
    ----------
    j: number of the pose.
    following: side of the push that begins at pose j; -1 if there is none.
    cost: [s] of the plan from pose j to the goal.
    weight: factor of the estimated cost from the start to the beginning of the push.
    least: [m] distances to obstacles, see ``rough_costs``.
    ready: ``(n, sides)`` [s] from ``rough_costs``.
    The other arguments are those of ``rough_costs``.

    Returns
    -------
    estimates: ``(m,)`` [s] of the cost of the whole plan, with the weight.
    states: ``(m,)`` numbers ``i * sides + s`` of the pose i and the side s at which a push begins.
    Pushes whose estimate without the weight exceeds the bound are left out.
    """
    n, sides = poses.shape[0], robots.shape[0]
    estimates = np.empty(n * sides)
    states = np.empty(n * sides, dtype=np.int64)
    found = 0
    for s in range(sides):
        if not room[s, j]:
            continue
        before = cost
        if following >= 0:
            before += changes[s, following]
        for i in range(window[j, 0], min(window[j, 1], n - 1)):
            if i == j or before + ready[i, s] >= bound or not window[i, 0] <= j < window[i, 1]:
                continue
            length = _guess(
                i, j, s, robots, chords, grasps, window, sight, least, field, ox, oy, scale
            )
            if before + pace * length + ready[i, s] < bound:
                estimates[found] = before + pace * length + weight * ready[i, s]
                states[found] = i * sides + s
                found += 1
    order = np.argsort(estimates[:found])
    return estimates[:found][order], states[:found][order]
