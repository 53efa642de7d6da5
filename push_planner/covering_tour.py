"""Which pushes to make, and in which order, so that together they take every object: exactly."""

import numpy as np
from numpy.typing import NDArray

from push_model.arrays import Array

_MOST = 16  # objects: the table has a row for each set of them


def covering_tour(
    first: Array, between: Array, takes: NDArray[np.int64], home: Array | None = None
) -> list[int]:
    """The cheapest sequence of pushes, each of which takes a further object, that together take all
    objects that any push takes.

    Dynamic programme over the set of objects that are taken and the last push: of n objects and p
    pushes, at most ``2**n * p**2`` sums. With pushes that take one object each this is the
    generalised travelling salesman's problem.

    Parameters
    ----------
    first: ``(p,)`` cost of a push, with the way to it from here.
    between: ``(p, p)`` cost of push j, with the way to it from the end of push i, at ``[i, j]``.
    takes: ``(p,)`` the objects that a push takes, a bit each; not 0.
    home: ``(p,)`` cost of the way from the end of a push to where the tour ends; 0 if not given.

    Returns
    -------
    Numbers of the pushes in their order; an empty list where there is no push.

    Raises
    ------
    ValueError: more than 16 objects.
    """
    if not len(first):
        return []
    every = int(np.bitwise_or.reduce(takes))
    if every >= 1 << _MOST:
        raise ValueError(f"a tour takes at most {_MOST} objects, got {every.bit_length()}")
    best = np.full((every + 1, len(first)), np.inf)
    before = np.full((every + 1, len(first), 2), -1, dtype=np.int64)
    best[takes, np.arange(len(first))] = first
    for taken in range(every):
        known = np.flatnonzero(np.isfinite(best[taken]))
        further = np.flatnonzero(takes & ~taken)
        if not len(known) or not len(further):
            continue
        sums = best[taken, known, None] + between[np.ix_(known, further)]
        last = sums.argmin(axis=0)
        cost, then = sums[last, np.arange(len(further))], taken | takes[further]
        better = cost < best[then, further]
        then, chosen = then[better], further[better]
        best[then, chosen] = cost[better]
        before[then, chosen] = np.column_stack([np.full(len(then), taken), known[last[better]]])
    push = int((best[every] + (0.0 if home is None else home)).argmin())
    taken, order = every, []
    while push >= 0:
        order.append(push)
        taken, push = (int(v) for v in before[taken, push])
    return order[::-1]
