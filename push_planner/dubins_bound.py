"""Lower bounds on the length of a push of bounded curvature, also where its end is not exact.

The shortest path of bounded curvature between two poses is an arc, a straight line and an arc, or
three arcs (Dubins 1957; for unequal limits to the left and to the right: Bakolas and Tsiotras,
"The asymmetric sinistral/dextral Markov-Dubins problem", 2009). If the last pose is only known to
lie in a ball of positions and in an interval of headings, every quantity of these paths lies in an
interval, too: the distance between the centres of the two circles, the direction of the line, and
both arcs. The lower end of each is used.

Of three arcs, the one in the middle is longer than half a turn.
"""

import math

import numba

_TURN = 2.0 * math.pi
_ROUNDING = 1e-9  # [m or rad] an arc that is shorter than nothing is none, not a whole turn


@numba.njit(cache=True)  # infinities: no fast mathematics
def _least_turn(angle: float, slack: float) -> float:
    """Smallest value [rad] in [0, 2 pi) of an angle that is known up to the slack."""
    slack += _ROUNDING
    least = (angle - slack) % _TURN
    return 0.0 if least + 2.0 * slack >= _TURN else least


@numba.njit(cache=True)
def _arcs_and_line(
    vx: float,
    vy: float,
    off: float,
    turn: float,
    slack: float,
    first: float,
    last: float,
    most: float,
) -> float:
    """Least length [m] of arc, line, arc; infinite if the circles are too close for it.

    vx, vy: [m] from the centre of the first circle to that of the last one, known up to ``off``.
    turn: [rad] change of heading, known up to ``slack``. first, last: [m] signed radii of the
    circles, positive to the left.
    """
    distance = math.hypot(vx, vy)
    across = last - first  # what the tangent has to bridge sideways
    if distance + off < abs(across):
        return math.inf
    near, far = max(distance - off, abs(across)), distance + off
    line = math.sqrt(max(0.0, near * near - across * across))
    if line >= most:
        return math.inf
    if off >= distance:
        return line
    # The line leaves the first circle in the direction of v, turned by asin(across / |v|).
    low, high = math.asin(across / far), math.asin(across / near)
    aside = math.asin(off / distance) + 0.5 * abs(high - low)
    heading = math.atan2(vy, vx) - 0.5 * (low + high)
    begins = heading if first > 0.0 else -heading
    ends = turn - heading if last > 0.0 else heading - turn
    there, on = _least_turn(begins, aside), _least_turn(ends, aside + slack)
    length: float = line + abs(first) * there + abs(last) * on
    return length


@numba.njit(cache=True)
def _three_arcs(
    vx: float, vy: float, off: float, turn: float, slack: float, outer: float, inner: float
) -> float:
    """Least length [m] of three arcs; infinite if the outer circles are too far apart.

    Arguments as in ``_arcs_and_line``; outer, inner: [m] signed radii of the first and last circle,
    and of the one in the middle.
    """
    distance, legs = math.hypot(vx, vy), abs(outer) + abs(inner)
    if distance - off > 2.0 * legs:
        return math.inf
    # The three centres are the corners of a triangle with two equal sides.
    low = math.acos(min(1.0, (distance + off) / (2.0 * legs)))
    high = math.acos(min(1.0, max(0.0, distance - off) / (2.0 * legs)))
    length = abs(inner) * (math.pi + 2.0 * low)
    if off >= distance:
        return length
    aside = math.asin(off / distance) + 0.5 * (high - low)
    corner, sign = 0.5 * (low + high), 1.0 if outer > 0.0 else -1.0
    toward = sign * math.atan2(vy, vx)  # mirrored where the first arc is to the right
    begins = toward + corner + 0.5 * math.pi
    ends = sign * turn - (toward - corner + 1.5 * math.pi)
    turned: float = _least_turn(begins, aside) + _least_turn(ends, aside + slack)
    return length + abs(outer) * turned


@numba.njit(cache=True)
def least_length(
    x: float, y: float, turn: float, left: float, right: float, off: float, slack: float
) -> float:
    """Lower bound [m] of the length of any path of bounded curvature from the origin.

    Parameters
    ----------
    x, y, turn: [m, m, rad] last pose in the frame of the first one.
    left, right: [m] smallest turning radii, both positive.
    off: [m] distance of the last position from (x, y), at most.
    slack: [rad] deviation of the last heading from ``turn``, at most; less than pi.
    """
    straight = max(0.0, math.hypot(x, y) - off)
    off += _ROUNDING
    best = math.inf
    c, s = math.cos(turn), math.sin(turn)
    for i in range(2):
        first = left if i == 0 else -right
        for j in range(2):
            last = left if j == 0 else -right
            around = off + 2.0 * abs(last) * math.sin(0.5 * slack)
            vx, vy = x - last * s, y + last * c - first
            best = min(best, _arcs_and_line(vx, vy, around, turn, slack, first, last, best))
            if i == j:
                inner = -right if i == 0 else left
                best = min(best, _three_arcs(vx, vy, around, turn, slack, first, inner))
    return max(best, straight)
