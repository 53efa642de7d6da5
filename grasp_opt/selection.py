"""Random grasps of a task, the requirements of 3.1.6, and the choice among them."""

import math

import numpy as np

from grasp_opt.contact_outline import ContactOutline, Contacts
from push_model.arrays import Array

_TRIES = 100_000
_SIDEWAYS = 1e-6  # cosine of a normal to the velocity that is none
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
    for _ in range(_TRIES):
        way = random.uniform(0.0, outline.length, count)
        if outline.from_corner(way).min() < _CORNER:
            continue
        contacts = outline.at(way)
        if behind(contacts, velocity) and apart(contacts, radius):
            return contacts
    heading = math.atan2(velocity[1], velocity[0])
    raise NoGraspFound(
        f"{count} robots of {1e3 * radius:.0f} mm find no place on the object from which all push "
        f"towards {heading:.2f} rad and keep apart"
    )
