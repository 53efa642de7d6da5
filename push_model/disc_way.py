"""The path of a round robot from point to point: the search that all systems use.

A* on a coarse lattice, or on the full one if the coarse one has no path; then corners are left out
where the straight line is free. Units and arguments as in ``room.py``.
"""

import numpy as np

from push_model.arrays import Array
from push_model.grid_search import shortest_way
from push_model.room import room_at, segment_keeps, straightened
from push_model.widest_way import escape_radius


def relief(
    field: Array,
    capsules: Array,
    body: float,
    tip: Array,
    room: float,
    need: float,
    least: float,
) -> tuple[float, float]:
    """Radius about an end with too little ``room``, and how much less than ``need`` is required
    within this radius.

    A robot that stands too close to an obstacle must be able to leave it; it may not come closer on
    its way out. ``least`` is the least room that it may have at any time.
    """
    if room >= need:
        return 0.0, 0.0
    # A point that lies between those of the lattice may have more room than any of them.
    for floor in (room - 1e-9, max(least, room - 0.75)):
        radius = escape_radius(field, capsules, body, tip, need, floor)
        if np.isfinite(radius):
            return radius, need - floor
    return 0.0, 0.0


def reliefs(
    field: Array,
    capsules: Array,
    body: float,
    need: float,
    least: float,
    tips: tuple[Array, Array],
) -> Array:
    """``(2, 4)``: the ``ends`` of a way between two points, see ``room.py``."""
    ends = np.zeros((2, 4))
    for k, tip in enumerate(tips):
        room = room_at(field, capsules, body, tip[0], tip[1])
        ends[k] = (*tip, *relief(field, capsules, body, tip, room, need, least))
    return ends


def disc_way(
    field: Array,
    capsules: Array,
    body: float,
    start: Array,
    goal: Array,
    ends: Array,
    need: float,
) -> Array:
    """Corners ``(n, 2)`` of a short path, start and goal included; ``n`` is 0 if there is none.

    The path keeps ``need`` everywhere, also between its corners, except near its ends.
    """
    way = shortest_way(field, capsules, body, start, goal, ends, need)
    if not len(way):
        return way
    found: Array = straightened(field, capsules, body, ends, need, way)
    return found


def straight_keeps(
    field: Array, capsules: Array, start: Array, goal: Array, need: float, spare: float
) -> bool:
    """Whether a straight line keeps ``need`` from everything.

    If an end is closer to an obstacle than that, the distance at this end is required instead.
    ``spare`` is subtracted from what is required.
    """
    rooms = [room_at(field, capsules, 0.0, p[0], p[1]) for p in (start, goal)]
    least = min(need, *rooms) - spare
    nothing = np.zeros((0, 4))
    return least > 0.0 and bool(
        segment_keeps(field, capsules, 0.0, nothing, least, start[0], start[1], goal[0], goal[1])
    )
