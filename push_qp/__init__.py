"""Quadratic programmes of predictive controllers, and one interface for all their solvers."""

from push_model import kernel_cache as kernel_cache  # before any file with kernels
from push_qp.active_set import ActiveSetBackend
from push_qp.backends import BACKENDS, backend
from push_qp.daqp_backend import DaqpBackend
from push_qp.osqp_backend import OsqpBackend
from push_qp.programme import Index, Qp, QpBackend, QpSolution

__all__ = [
    "BACKENDS",
    "ActiveSetBackend",
    "DaqpBackend",
    "Index",
    "OsqpBackend",
    "Qp",
    "QpBackend",
    "QpSolution",
    "backend",
]
