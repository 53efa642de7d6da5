"""A binary heap in arrays, for compiled searches that are interrupted and go on later."""

from typing import Any

import numba


@numba.njit(cache=True)
def push(keys: Any, items: Any, size: int, key: float, item: int) -> int:
    """Add an item to a heap of ``size`` items in ``keys`` and ``items``; returns the new size.

    keys: ``(n,)`` float, least first. items: ``(n,)`` int. Both are longer than ``size``.
    """
    k = size
    while k > 0:
        above = (k - 1) >> 1
        if keys[above] <= key:
            break
        keys[k], items[k] = keys[above], items[above]
        k = above
    keys[k], items[k] = key, item
    return size + 1


@numba.njit(cache=True)
def pop(keys: Any, items: Any, size: int) -> tuple[float, int, int]:
    """Take the item with the least key from a heap that is not empty: key, item, new size."""
    first_key, first_item = keys[0], items[0]
    size -= 1
    key, item = keys[size], items[size]
    k = 0
    while True:
        below = 2 * k + 1
        if below >= size:
            break
        if below + 1 < size and keys[below + 1] < keys[below]:
            below += 1
        if keys[below] >= key:
            break
        keys[k], items[k] = keys[below], items[below]
        k = below
    keys[k], items[k] = key, item
    return first_key, first_item, size
