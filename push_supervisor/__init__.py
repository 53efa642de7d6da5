"""Supervision of a manipulation (section 2.5): a pure state machine, and its node."""

from push_model.jobs import JobError
from push_supervisor.commands import Command
from push_supervisor.displacement import Displacement
from push_supervisor.event_queue import EventQueue
from push_supervisor.events import Event
from push_supervisor.machine import Machine
from push_supervisor.requests import Moment, Peer, Request, Requests, Step
from push_supervisor.settings import SupervisorSettings
from push_supervisor.state import State
from push_supervisor.surroundings import Surroundings

__all__ = [
    "Command",
    "Displacement",
    "Event",
    "EventQueue",
    "JobError",
    "Machine",
    "Moment",
    "Peer",
    "Request",
    "Requests",
    "State",
    "Step",
    "SupervisorSettings",
    "Surroundings",
]
