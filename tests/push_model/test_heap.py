"""The heap in arrays gives what heapq gives."""

import heapq

import numpy as np

from push_model import heap


def test_items_come_in_the_order_of_their_keys():
    random = np.random.default_rng(1)
    for _ in range(50):
        keys, items = np.empty(300), np.empty(300, dtype=np.int64)
        size, other = 0, []
        for item in range(300):
            if other and random.random() < 0.4:
                key, taken, size = heap.pop(keys, items, size)
                assert key == other[0][0] and (key, taken) in other
                other.remove((key, taken))
                heapq.heapify(other)
            else:
                key = float(random.integers(0, 60))  # some are equal
                size = heap.push(keys, items, size, key, item)
                heapq.heappush(other, (key, item))
            assert size == len(other)
