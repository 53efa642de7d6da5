"""Whether somebody moved the object while the robot was on its way to it."""

from push_model.arrays import Array
from push_supervisor import motions
from push_supervisor.events import ObjectMoved
from push_supervisor.machine import Machine
from push_supervisor.state import State

PERIOD = 0.1
"""[s] between looks, about."""
_LOOKS = 3  # in a row, in which the object is off


class Displacement:
    """Looks at the object every ``PERIOD``, and tells what lasts."""

    def __init__(self, machine: Machine) -> None:
        self._machine, self._count = machine, 0

    def look(self, item: Array | None) -> ObjectMoved | None:
        """The object at a pose ``(3,)``, or not seen."""
        machine = self._machine
        if machine.state not in (State.POSITIONING, State.APPROACH) or not machine.segments:
            self._count = 0
            return None
        if item is None:
            return None
        way, turn = motions.displacement(machine.segment, item)
        s = machine.settings
        off = way > s.displacement or turn > s.displacement_turn
        self._count = self._count + 1 if off else 0
        if self._count < _LOOKS:
            return None
        self._count = 0
        text = f"the object is {1e3 * way:.0f} mm and {turn:.2f} rad from the planned "
        return ObjectMoved(text + "start of the push")
