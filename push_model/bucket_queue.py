"""A queue of buckets for compiled searches whose keys are small whole numbers.

Each bucket is a stack: a chain of rows of ``pool (n, 2)``, item and next row. ``heads`` has the
first row of each bucket, 0 for none; row 0 of the pool heads the chain of unused rows.
"""

from typing import Any

import numba
import numpy as np


@numba.njit(cache=True)
def new_pool() -> Any:
    """A pool of unused rows."""
    pool = np.zeros((1024, 2), dtype=np.int32)
    pool[:1023, 1] = np.arange(1, 1024)
    return pool


@numba.njit(cache=True)
def push(heads: Any, pool: Any, bucket: int, item: int) -> Any:
    """Put an item on top of a bucket; returns the pool, which is a larger one if it was full."""
    free = pool[0, 1]
    if free == 0:
        old = pool.shape[0]
        larger = np.empty((2 * old, 2), dtype=np.int32)
        larger[:old] = pool
        for k in range(old, 2 * old):
            larger[k, 1] = k + 1
        larger[2 * old - 1, 1] = 0
        pool = larger
        free = old
    pool[0, 1] = pool[free, 1]
    pool[free, 0] = item
    pool[free, 1] = heads[bucket]
    heads[bucket] = free
    return pool


@numba.njit(cache=True)
def pop(heads: Any, pool: Any, bucket: int) -> int:
    """Take the item on top of a bucket that has one."""
    taken = heads[bucket]
    heads[bucket] = pool[taken, 1]
    pool[taken, 1] = pool[0, 1]
    pool[0, 1] = taken
    return int(pool[taken, 0])
