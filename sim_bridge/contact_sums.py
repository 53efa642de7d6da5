"""The contacts of many physics steps, as one entry for each pair of bodies."""

from collections.abc import Container, Mapping
from typing import Any

import numpy as np
import pybullet as pb

from sim_bridge.world import Contact

_A, _B, _ON_A, _ON_B, _NORMAL, _LOAD = 1, 2, 5, 6, 7, 9
"""Fields of a PyBullet contact; the normal points from b to a. Friction: 10 to 13."""


class ContactSums:
    """Adds up the contacts of physics steps. One call of PyBullet reads all contacts of a step."""

    def __init__(self, client: int, floor: int, movable: Container[int]) -> None:
        """movable: PyBullet ids of robots and objects; the others are walls."""
        self._client, self._floor, self._movable = client, floor, movable
        self.clear()

    def clear(self) -> None:
        """Forget what was added."""
        self._steps = 0
        self._pairs: dict[tuple[int, int], list[float]] = {}

    def add(self) -> None:
        """Take the contacts of the last step."""
        self._steps += 1
        floor = self._floor
        for point in pb.getContactPoints(physicsClientId=self._client):
            if point[_LOAD] > 0.0 and point[_A] != floor and point[_B] != floor:
                self._add(point)

    def _add(self, point: tuple[Any, ...]) -> None:
        a, b, load = point[_A], point[_B], point[_LOAD]
        # A pair is told in one order: what can move first, then by the order of making.
        turned = (a not in self._movable, a) > (b not in self._movable, b)
        key, sign, where = ((b, a), -1.0, _ON_B) if turned else ((a, b), 1.0, _ON_A)
        sums = self._pairs.get(key)
        if sums is None:
            sums = self._pairs[key] = [0.0] * 12
        normal, position = point[_NORMAL], point[where]
        t1, d1, t2, d2 = point[10], point[11], point[12], point[13]
        for i in range(3):
            sums[i] += sign * (load * normal[i] + t1 * d1[i] + t2 * d2[i])
            sums[3 + i] += load * position[i]
            sums[6 + i] += sign * load * normal[i]
        sums[9] += load
        if sums[10] != self._steps:
            sums[10] = self._steps
            sums[11] += 1.0

    def read(self, names: Mapping[int, str]) -> list[Contact]:
        """The mean of each contact since the previous call."""
        result = []
        for (a, b), sums in self._pairs.items():
            values = np.array(sums)
            push = values[6:9]
            result.append(
                Contact(
                    names[a],
                    names[b],
                    values[3:6] / values[9],
                    push / max(float(np.linalg.norm(push)), 1e-12),
                    values[:3] / self._steps,
                    float(values[11]) / self._steps,
                )
            )
        self.clear()
        return result
