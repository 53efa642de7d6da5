"""The solvers by name: one file each, and a line here."""

from collections.abc import Callable

from push_qp.active_set import ActiveSetBackend
from push_qp.daqp_backend import DaqpBackend
from push_qp.osqp_backend import OsqpBackend
from push_qp.programme import QpBackend

BACKENDS: dict[str, Callable[[], QpBackend]] = {
    "active_set": ActiveSetBackend,
    "daqp": DaqpBackend,
    "osqp": OsqpBackend,
}


def backend(name: str) -> QpBackend:
    """A new solver of this name.

    Raises
    ------
    ValueError: no such solver.
    """
    if name not in BACKENDS:
        known = ", ".join(f"'{other}'" for other in BACKENDS)
        raise ValueError(f"unknown QP backend '{name}', expected one of {known}")
    return BACKENDS[name]()
