"""The solvers by name."""

from push_qp.active_set import ActiveSetBackend
from push_qp.daqp_backend import DaqpBackend
from push_qp.osqp_backend import OsqpBackend
from push_qp.programme import QpBackend


def backend(name: str) -> QpBackend:
    """The backend called ``active_set``, ``daqp`` or ``osqp``."""
    if name == "active_set":
        return ActiveSetBackend()
    if name == "daqp":
        return DaqpBackend()
    if name == "osqp":
        return OsqpBackend()
    raise ValueError(f"unknown QP backend '{name}', expected 'active_set', 'daqp' or 'osqp'")
