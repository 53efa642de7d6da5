"""Predictive controllers for pushing and for free motion, and the tracker around them; 2.4."""

from push_model import kernel_cache as kernel_cache  # before any file with kernels
from push_mpc.contact_force_mpc import ContactForceMpc
from push_mpc.controller import Contact, MpcResult, PredictiveController, Reference
from push_mpc.controllers import CONTROLLERS, ControllerKind, controller_kind
from push_mpc.line_contact import LineContact, line_contact
from push_mpc.ltv_mpc import LtvMpc
from push_mpc.settings import ContactForceSettings, MpcSettings, TrackerSettings
from push_mpc.task import Push, Task, Tick, TrackError
from push_mpc.tracker import TrajectoryTracker

__all__ = [
    "CONTROLLERS",
    "Contact",
    "ContactForceMpc",
    "ContactForceSettings",
    "ControllerKind",
    "LineContact",
    "LtvMpc",
    "MpcResult",
    "MpcSettings",
    "PredictiveController",
    "Push",
    "Reference",
    "Task",
    "Tick",
    "TrackError",
    "TrackerSettings",
    "TrajectoryTracker",
    "controller_kind",
    "line_contact",
]
