"""Events to a state machine, one after the other, and its commands to who carries them out."""

from collections.abc import Callable

from push_supervisor import commands
from push_supervisor.commands import Command
from push_supervisor.events import Event
from push_supervisor.machine import Machine


class EventQueue:
    """What carries a command out may fire further events: they wait until it is done."""

    def __init__(
        self,
        machine: Machine,
        carry_out: Callable[[Command], None],
        changed: Callable[[], None] = lambda: None,
    ) -> None:
        """changed: called when the state or its reason is another one, or a job has ended."""
        self._machine, self._carry_out, self._changed = machine, carry_out, changed
        self._waiting: list[Event] = []
        self._handling = False

    def fire(self, event: Event | None) -> None:
        """Give an event to the machine; None is none."""
        if event is None:
            return
        self._waiting.append(event)
        if self._handling:
            return
        machine, self._handling = self._machine, True
        try:
            while self._waiting:
                before = (machine.state, machine.reason)
                told = machine.handle(self._waiting.pop(0))
                for command in told:
                    self._carry_out(command)
                ended = any(isinstance(command, commands.Finish) for command in told)
                if ended or (machine.state, machine.reason) != before:
                    self._changed()
        finally:
            self._handling = False
