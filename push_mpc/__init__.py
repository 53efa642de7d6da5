"""Predictive controllers for pushing and for moving alone, and the tracker around them (2.4)."""

from push_mpc.controller import MpcResult, PredictiveController, Reference
from push_mpc.controllers import CONTROLLERS, ControllerKind, controller_kind
from push_mpc.ltv_mpc import LtvMpc
from push_mpc.settings import MpcSettings, TrackerSettings
from push_mpc.task import Push, Task, Tick, TrackError
from push_mpc.tracker import TrajectoryTracker

__all__ = [
    "CONTROLLERS",
    "ControllerKind",
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
]
