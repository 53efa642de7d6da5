"""When the contacts of a push may no longer hold the object, after the belief has changed.

Robots are placed so that their contacts can apply the wrenches of the trajectory: for everything
that is believed, or, where no placement does that, for the believed values with a margin
(``robust_placement``). If another friction or centre of mass is believed in mid-push, the rest of
the trajectory is tested again. A wrench is no longer held if neither is true for the new belief.
"""

import numpy as np

from grasp_opt.contact_outline import Contacts
from grasp_opt.grasp_certificate import GraspCertificate
from grasp_opt.object_trajectory import ObjectTrajectory
from push_model.arrays import Array
from push_model.belief import Interval
from push_model.specs import ObjectSpec
from push_model.stick_certificate import ContactBelief

RESERVE = 0.05
"""Margin for the believed values that is enough where nothing is certified, or that of the plan if
it has less. Placements ask for twice as much, as far as they can have it."""
SAMPLES = 60
"""Moments of a trajectory at which it is tested, at most. A test takes about 15 ms, in the tick in
which a plan or a new belief comes."""
_ROUNDING = 1e-9


def spread(count: int) -> Array:
    """Indices of at most ``SAMPLES`` of so many moments, the first and the last among them."""
    some: Array = np.unique(np.linspace(0, count - 1, min(count, SAMPLES)).round().astype(int))
    return some


class SlipWatch:
    """Tests the contacts of a push for what is believed now.

    certified: the certified margin of the whole push (sine of an angle, as of ``margin``); None if
    no interval is believed. nominal: its margin for the believed values.
    """

    def __init__(
        self,
        contacts: Contacts,
        trajectory: ObjectTrajectory,
        item: ObjectSpec,
        believed: ContactBelief | None,
    ) -> None:
        """contacts: about the centre of mass of ``item``, the object as believed when the push was
        planned; trajectory: of that point. believed: intervals at that time."""
        self._contacts, self._item = contacts, item
        twists = trajectory.body_twists
        moving = np.flatnonzero(np.any(twists != 0.0, axis=1))
        some = moving[spread(len(moving))]
        self._times, self._twists = trajectory.time[some], twists[some]
        self.certified: float | None = None
        self._enough = RESERVE
        self.believe(item, believed)
        self._enough = min(RESERVE, max(0.0, self.nominal))
        self._unsure = np.empty(
            0
        )  # [s] along the trajectory; what was good enough to be planned is good enough

    def believe(self, item: ObjectSpec, believed: ContactBelief | None) -> None:
        """Test the push for another belief. An outline that changes is not tested."""
        values = ContactBelief(
            *(Interval.exact(v) for v in (item.contact_friction, *item.com)),
        )
        margins = self._margins(values)
        self.nominal = float(margins.min(initial=1.0))
        unsure = margins < self._enough - _ROUNDING
        self.certified = None
        if believed is not None:
            certified = self._margins(believed)
            self.certified = float(certified.min(initial=1.0))
            unsure &= certified < -_ROUNDING
        self._unsure = self._times[unsure]

    def _margins(self, believed: ContactBelief) -> Array:
        return GraspCertificate(self._item, believed, self._twists).margins(self._contacts)

    def ahead(self, time: float) -> float:
        """Time [s] from a moment [s] of the trajectory until a wrench is no longer held; inf if
        all the rest is."""
        later = self._unsure[self._unsure >= time]
        return float(later[0] - time) if len(later) else np.inf
