"""LTV-MPC for pushing and for moving alone (sections 2.4.1-2.4.5, 2.4.7)."""

from push_mpc.ltv_mpc import LtvMpc, MpcResult, Reference
from push_mpc.settings import MpcSettings, TrackerSettings
from push_mpc.tracker import Push, Task, Tick, TrackError, TrajectoryTracker

__all__ = [
    "LtvMpc",
    "MpcResult",
    "MpcSettings",
    "Push",
    "Reference",
    "Task",
    "Tick",
    "TrackError",
    "TrackerSettings",
    "TrajectoryTracker",
]
