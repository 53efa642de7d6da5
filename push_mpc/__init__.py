"""LTV-MPC for pushing and for moving alone (sections 2.4.1-2.4.5, 2.4.7)."""

from push_mpc.ltv_mpc import LtvMpc, MpcResult, Reference
from push_mpc.qp import (
    ActiveSetBackend,
    DaqpBackend,
    OsqpBackend,
    Qp,
    QpBackend,
    QpSolution,
    backend,
)
from push_mpc.settings import MpcSettings, TrackerSettings
from push_mpc.tracker import Push, Task, Tick, TrackError, TrajectoryTracker

__all__ = [
    "ActiveSetBackend",
    "DaqpBackend",
    "LtvMpc",
    "MpcResult",
    "MpcSettings",
    "OsqpBackend",
    "Push",
    "Qp",
    "QpBackend",
    "QpSolution",
    "Reference",
    "Task",
    "Tick",
    "TrackError",
    "TrackerSettings",
    "TrajectoryTracker",
    "backend",
]
