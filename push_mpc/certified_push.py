"""The stick certificate of a push under way, from the intervals of a belief."""

import math

from push_model.belief import Belief, BeliefError, Interval
from push_model.settings import SettingsError
from push_model.specs import RobotSpec
from push_model.stable_push import CurvatureLimits
from push_model.stick_certificate import ContactBelief, certified_limits, stick_margin
from push_mpc.believed_push import nearest_side
from push_mpc.task import Push

QUANTITIES = ("contact_friction", "com_x", "com_y")
"""Of the object, of which a certificate needs intervals."""


_MOVING = 0.005  # [m/s] below which a push has no curvature


class PushCertificate:
    """Whether a push sticks for every friction and centre of mass that is believed, and for the
    values themselves.

    known: whether there is something to certify: an interval of one of the quantities, and a side
    at which the contact lies.
    """

    def __init__(self, push: Push, robot: RobotSpec, belief: Belief, item: str) -> None:
        """push: as it was planned. item: name of the pushed object."""
        self.limits: CurvatureLimits | None = None
        self.known = False
        self.alarm = ""
        """What to tell a person, once: that the object is expected to slip. Empty otherwise."""
        self._expected: CurvatureLimits | None = None
        self._belief = ""
        try:
            friction, com_x, com_y = (belief.interval(item, q) for q in QUANTITIES)
            contact = ContactBelief(friction, com_x, com_y)
            if contact.exact:
                return
            spec = belief.object(item)
            side = nearest_side(push, robot, spec)
            if side is not None:
                self.limits = certified_limits(spec, robot, contact, side.index)
                values = ContactBelief(*(Interval.exact(i.value) for i in (friction, com_x, com_y)))
                self._expected = certified_limits(spec, robot, values, side.index)
                self.known = True
                self._belief = (
                    f"the friction of '{item}' is believed to be {friction.value:.3g}, between "
                    f"{friction.low:.3g} and {friction.high:.3g}"
                )
        except (BeliefError, SettingsError, ValueError):
            return  # intervals that reach beyond the object: nothing can be certified

    def margin(self, v: float, omega: float, offset: float) -> float:
        """[rad/s] see ``stick_margin``; nan where nothing is known or the robot stands."""
        if not self.known or v < _MOVING:
            return math.nan
        if not self.alarm and stick_margin(self._expected, v, omega, offset) < 0.0:
            self.alarm = f"the object is expected to slip: {self._belief}"
        return stick_margin(self.limits, v, omega, offset)
