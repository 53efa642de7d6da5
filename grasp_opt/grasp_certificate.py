"""Whether robots hold a task for everything that is believed: all frictions, all centres of mass.

The margin of the grasp-task compatibility test (3.1.2) depends on the friction at the contacts and
on the object's centre of mass, of which only intervals are known. The certified margin is the least
one over them. If it is positive, the contacts can apply the wrenches of the task whatever is true.

Less friction makes every friction cone narrower, so the least friction decides. The margin of a
centre of mass in a box is at least that at its corners, less ``BEND`` (found by sampling, see the
tests).
"""

from dataclasses import replace

import numpy as np

from grasp_opt.contact_outline import Contacts
from grasp_opt.wrench_cone import task_wrenches, wrench_margins, wrench_rays
from push_model.arrays import Array
from push_model.settings import SettingsError
from push_model.specs import ObjectSpec
from push_model.stick_certificate import ContactBelief

BEND = 0.01
"""By which the margin between the corners may be less than at them."""


class GraspCertificate:
    """The certified margin of grasps for one task.

    possible: whether there is one; not if the intervals reach beyond the object.
    """

    def __init__(self, item: ObjectSpec, believed: ContactBelief, twists: Array) -> None:
        """twists: ``(m, 3)`` [m/s, m/s, rad/s] of the centre of mass of ``item``, object frame."""
        self._friction = believed.friction.low
        self._count = int(np.any(twists != 0.0, axis=1).sum())
        self._cases: list[tuple[Array, float, Array]] = []
        self._loss = 0.0 if believed.com_x.width == believed.com_y.width == 0.0 else BEND
        self.possible = True
        for com in believed.centres():
            try:
                surface = replace(item, com=com).limit_surface()
            except SettingsError:  # outside the object
                self.possible = False
                return
            dx, dy = np.subtract(com, item.com)
            moved = twists + np.outer(twists[:, 2], [-dy, dx, 0.0])
            wrenches = task_wrenches(moved, surface, surface.radius)
            self._cases.append((np.array([dx, dy]), surface.radius, wrenches))

    def margin(self, contacts: Contacts) -> float:
        """The certified margin; -1 if there is none."""
        return float(self.margins(contacts).min(initial=1.0)) if self.possible else -1.0

    def margins(self, contacts: Contacts) -> Array:
        """The certified margin at each of the twists that are not zero ``(q,)``."""
        if not self.possible:
            return np.full(self._count, -1.0)
        found = [
            wrench_margins(
                wrench_rays(contacts.points - shift, contacts.normals, self._friction, radius),
                wrenches,
            )
            for shift, radius, wrenches in self._cases
        ]
        least: Array = np.min(found, axis=0) - self._loss
        return least
