"""Random grasps of a task, the requirements of 3.1.6, and the choice among them."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from grasp_opt.contact_outline import ContactOutline, Contacts
from grasp_opt.effort import least_effort
from grasp_opt.indices import modified_hausdorff
from grasp_opt.object_trajectory import ObjectTrajectory
from grasp_opt.wrench_cone import HELD, margin, task_wrenches, wrench_rays
from push_model.arrays import Array
from push_model.specs import ObjectSpec

_TRIES = 100_000
_EVERY = 5  # samples of a trajectory of which the least forces are asked
_FINEST = 1e-3  # [m] of the refinement
_SIDEWAYS = 1e-4  # cosine of a normal to the velocity that is none; differences err by 1e-5
_CORNER = 0.01  # [m] from a corner that a contact keeps at least


class NoGraspFound(Exception):
    """Raised when random grasps do not meet the requirements."""


def apart(contacts: Contacts, radius: float, gap: float = 2e-3) -> bool:
    """Whether round robots of a radius [m] at the contacts keep a gap [m] from each other."""
    centres = contacts.centres(radius)
    n = len(centres)
    away = np.hypot(*(centres[:, None] - centres[None]).transpose(2, 0, 1))
    return bool((away[np.triu_indices(n, 1)] >= 2.0 * radius + gap).all())


def behind(contacts: Contacts, velocity: Array) -> bool:
    """Whether every contact can push towards a velocity ``(2,)``, in the object's frame."""
    return bool((contacts.normals @ velocity > _SIDEWAYS * np.hypot(*velocity)).all())


def random_grasp(
    outline: ContactOutline,
    count: int,
    radius: float,
    velocity: Array,
    random: np.random.Generator,
) -> Contacts:
    """A grasp of ``count`` round robots that meets the first two requirements of 3.1.6.

    Parameters
    ----------
    radius: [m] of the robots. velocity: ``(2,)`` of the task's beginning, in the object's frame.

    Raises
    ------
    NoGraspFound: after very many tries.
    """
    return outline.at(random_ways(outline, count, radius, velocity, random))


def random_ways(
    outline: ContactOutline,
    count: int,
    radius: float,
    velocity: Array,
    random: np.random.Generator,
) -> Array:
    """``random_grasp`` as places ``(n,)`` [m] along the outline."""
    for _ in range(_TRIES):
        way = random.uniform(0.0, outline.length, count)
        if outline.from_corner(way).min() < _CORNER:
            continue
        contacts = outline.at(way)
        if behind(contacts, velocity) and apart(contacts, radius):
            return way
    heading = math.atan2(velocity[1], velocity[0])
    raise NoGraspFound(
        f"{count} robots of {1e3 * radius:.0f} mm find no place on the object from which all push "
        f"towards {heading:.2f} rad and keep apart"
    )


@dataclass(frozen=True)
class Selection:
    """The grasp of 3.1.6 and what it was chosen by.

    way ``(n,)`` [m] along the outline; value: of the criterion, before and after the refinement;
    margin: of the compatibility test; tried, passed: random grasps, and those that passed the test.
    """

    way: Array
    contacts: Contacts
    first: float
    value: float
    margin: float
    tried: int
    passed: int


class GraspSelector:
    """Chooses a grasp for a task: random ones, the requirements, the best, refined (3.9)-(3.10).

    criterion: ``mhd`` as in the thesis, greatest; or ``energy`` of the least forces, least. That
    foretells (3.3) best of given grasps, but the least of all is found where discs squeeze the
    object between them, and they do not exert the least forces there (docs/results.md).
    """

    def __init__(
        self,
        item: ObjectSpec,
        trajectory: ObjectTrajectory,
        count: int,
        radius: float,
        criterion: Literal["mhd", "energy"] = "mhd",
        least_margin: float = 0.0,
        gap: float = 0.0,
    ) -> None:
        """least_margin: what the compatibility test must have to spare. gap: [m] between robots."""
        self.item, self.trajectory, self.count, self.radius = item, trajectory, count, radius
        self.criterion, self.least_margin, self._gap = criterion, least_margin, gap
        self.outline = ContactOutline(item.geometry)
        self._surface = item.limit_surface()
        self._twists = trajectory.body_twists
        self._wrenches = task_wrenches(self._twists, self._surface, self._surface.radius)
        moving = np.hypot(*trajectory.twist[:, :2].T) > 0.0
        self._first = self._twists[int(np.argmax(moving)), :2]

    def margin(self, contacts: Contacts) -> float:
        """The margin of the compatibility test."""
        mu, c = self.item.contact_friction, self._surface.radius
        return margin(wrench_rays(contacts.points, contacts.normals, mu, c), self._wrenches)

    def meets(self, way: Array) -> bool:
        """g(x) <= 0 of (3.10): the requirements of 3.1.6, at places ``(n,)`` [m]."""
        if self.outline.from_corner(way).min() < _CORNER:
            return False
        contacts = self.outline.at(way)
        if not (apart(contacts, self.radius, self._gap) and behind(contacts, self._first)):
            return False
        return self.margin(contacts) >= self.least_margin - HELD

    def value(self, way: Array) -> float:
        """The criterion, the larger the better."""
        contacts = self.outline.at(way)
        mu, c = self.item.contact_friction, self._surface.radius
        if self.criterion == "mhd":
            rays = wrench_rays(contacts.points, contacts.normals, mu, c, bisectors=True)
            return float(modified_hausdorff(rays[None], self._wrenches)[0])
        return -least_effort(contacts, mu, self._twists[::_EVERY], self._surface).energy

    def select(self, tries: int, seed: int) -> Selection:
        """The best of so many random grasps that meet the requirements, refined.

        Raises
        ------
        NoGraspFound: none of them passes the compatibility test.
        """
        random = np.random.default_rng(seed)
        good: list[tuple[float, Array]] = []
        for _ in range(tries):
            way = random_ways(self.outline, self.count, self.radius, self._first, random)
            if self.meets(way):
                good.append((self.value(way), way))
        if not good:
            raise NoGraspFound(
                f"none of {tries} random grasps of {self.count} robots passes the test"
            )
        first, way = max(good, key=lambda pair: pair[0])
        value, way = self._refined(way, first)
        contacts = self.outline.at(way)
        return Selection(way, contacts, first, value, self.margin(contacts), tries, len(good))

    def first(self, tries: int, seed: int) -> Selection:
        """The first of so many random grasps that meets the requirements, as it is.

        Raises
        ------
        NoGraspFound: none of them does.
        """
        random = np.random.default_rng(seed)
        for k in range(tries):
            way = random_ways(self.outline, self.count, self.radius, self._first, random)
            if self.meets(way):
                value, contacts = self.value(way), self.outline.at(way)
                return Selection(way, contacts, value, value, self.margin(contacts), k + 1, 1)
        raise NoGraspFound(f"none of {tries} random grasps of {self.count} robots passes the test")

    def _refined(self, way: Array, value: float) -> tuple[float, Array]:
        """(3.9)-(3.10) from there, by a compass search."""
        step = 0.05 * self.outline.length
        while step > _FINEST:
            better = False
            for i in range(self.count):
                for sign in (1.0, -1.0):
                    trial = way.copy()
                    trial[i] += sign * step
                    if self.meets(trial) and (other := self.value(trial)) > value + 1e-9:
                        value, way, better = other, trial, True
            if not better:
                step *= 0.5
        return value, np.mod(way, self.outline.length)
