"""Supervision of a manipulation (section 2.5): a pure state machine, and its node."""

from push_model.jobs import JobError
from push_supervisor.machine import (
    Command,
    Event,
    Machine,
    State,
    SupervisorSettings,
)

__all__ = ["Command", "Event", "JobError", "Machine", "State", "SupervisorSettings"]
