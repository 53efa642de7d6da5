"""Where robots were seen about an object, in its frame, and where the object stopped them.

Both are kept as means over small cells, so that the noise of single frames averages out.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from push_model.arrays import Array

_CELL = 5e-3  # [m] of the places where robots have been
_CONTACT_CELL = 0.012  # [m] of the places where robots were stopped
_COUNTED = 40  # sightings in a cell after which new ones count as much as the old ones together
_DEEPER = 4e-3  # [m] by which a robot was deeper than where one was stopped: that is refuted
_SURE = 0.8  # length of the mean of unit vectors that agree
_NEAR = 0.012  # [m] within which it is looked for such robots
BLOCKED = 0.012
"""[m] ahead of a stopped robot, where no robot can be."""


@dataclass
class _Contact:
    """way: mean of the ways on which robots were stopped; zero where none was on its way."""

    mean: Array
    way: Array
    count: int = 0
    fresh: bool = True


class Sightings:
    """Within a rectangle."""

    def __init__(self, low: Array, high: Array) -> None:
        """low, high: ``(2,)`` [m] corners of the rectangle."""
        self._low, self._high = low, high
        shape = np.ceil((high - low) / _CELL).astype(np.intp) + 1
        self._count = np.zeros(shape)
        self._mean = np.zeros((*shape, 2))
        self._contacts: dict[tuple[int, int], _Contact] = {}

    @property
    def places(self) -> Array:
        """``(n, 2)`` [m] where robots have been."""
        found: Array = self._mean[self._count > 0.0]
        return found

    @property
    def contacts(self) -> Array:
        """``(m, 2)`` [m] where the object stopped robots."""
        return np.array([c.mean for c in self._contacts.values()]).reshape(-1, 2)

    def been(self, points: Array) -> None:
        """Robots were at ``(n, 2)`` [m], one a cell; outside of the rectangle they do not count."""
        inside = points[((points > self._low) & (points < self._high)).all(axis=1)]
        at = tuple(((inside - self._low) / _CELL).astype(np.intp).T)
        self._count[at] = np.minimum(self._count[at] + 1.0, _COUNTED)
        self._mean[at] += (inside - self._mean[at]) / self._count[at][:, None]

    @property
    def blocked(self) -> Array:
        """``(k, 2)`` [m] places a little ahead of stopped robots, where none can be: in a contact
        with friction, a robot that does not even slide is on its way into the object."""
        ways = [c for c in self._contacts.values() if np.hypot(*c.way) > _SURE]
        return np.array([c.mean + BLOCKED * c.way for c in ways]).reshape(-1, 2)

    def stopped(self, point: Array, way: Array | None = None) -> None:
        """The object stopped a robot at ``(2,)`` [m]. way: unit vector ``(2,)`` on which it was,
        if it did not move at all."""
        x, y = np.floor(point / _CONTACT_CELL)
        fresh = _Contact(np.array(point), np.zeros(2))
        contact = self._contacts.setdefault((int(x), int(y)), fresh)
        contact.count = min(contact.count + 1, _COUNTED)
        contact.mean = contact.mean + (point - contact.mean) / contact.count
        contact.way = contact.way + ((0.0 if way is None else way) - contact.way) / contact.count
        contact.fresh = True

    def settle(self, outward: Callable[[Array], Array]) -> tuple[int, int]:
        """Drop contacts at which, and deeper, robots have been. outward: unit normal of the line of
        contact at a point ``(2,)``.

        Returns how many contacts that came since the last call agree with where robots have been,
        and how many do not.
        """
        been, agree, refuted = self.places, 0, 0
        tree = cKDTree(been) if len(been) else None
        for key, contact in list(self._contacts.items()):
            wrong = tree is not None and _passed_through(contact.mean, been, tree, outward)
            agree += contact.fresh and not wrong
            refuted += wrong
            contact.fresh = False
            if wrong:
                del self._contacts[key]
        return agree, refuted


def _passed_through(
    contact: Array, been: Array, tree: cKDTree, outward: Callable[[Array], Array]
) -> bool:
    """Whether robots have been inward of a contact, as seen from it."""
    to = been[tree.query_ball_point(contact, _NEAR)] - contact
    inward = -outward(contact)
    deep = to @ inward
    aside = np.abs(to @ np.array([-inward[1], inward[0]]))
    return bool(((deep > _DEEPER) & (aside < 0.5 * deep)).any())
