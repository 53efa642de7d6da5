"""When compiled kernels are compiled anew.

numba keeps the machine code of a kernel in a file, until the source file of this kernel changes.
It does not see changes in other files on which the code depends as well: the kernels that it calls,
and the constants that it uses. After an update, the old code would go on running, without a word.
Here what is kept of a kernel is stamped with all of these too. Whoever imports ``push_model`` gets
it: import it before a file with kernels.
"""

import hashlib
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numba
import numpy as np
from numba.core import caching
from numba.core.dispatcher import Dispatcher

PACKAGES = (
    "benchmarks",
    "grasp_opt",
    "push_gym",
    "push_model",
    "push_mpc",
    "push_planner",
    "push_qp",
    "sim_bridge",
    "swarm_push",
)
"""Kernels of these, and those that call them, are stamped like this."""


def dependencies(function: FunctionType) -> dict[str, Any]:
    """Kernels and constants that a function names, as far as they exist by now; in order."""
    found: dict[str, Any] = {}
    names = _names(function.__code__)
    for name in sorted(names & function.__globals__.keys()):
        value = function.__globals__[name]
        if isinstance(value, ModuleType):
            inside = {f"{name}.{n}": getattr(value, n) for n in sorted(names) if hasattr(value, n)}
            found |= {n: v for n, v in inside.items() if isinstance(v, Dispatcher)}
        elif isinstance(value, Dispatcher | bool | int | float | str | tuple | np.ndarray):
            found[name] = value
    return found


def _names(code: CodeType) -> set[str]:
    inner = (_names(c) for c in code.co_consts if isinstance(c, CodeType))
    return set(code.co_names).union(*inner)


def _with_callees(function: FunctionType) -> list[FunctionType]:
    """A function and all kernels that it calls, those that they call included."""
    found: dict[int, FunctionType] = {}
    left = [function]
    while left:
        f = left.pop()
        if id(f) not in found:
            found[id(f)] = f
            left += [d.py_func for d in dependencies(f).values() if isinstance(d, Dispatcher)]
    return list(found.values())


def _text(value: Any) -> str:
    """What machine code depends on of a constant, of code or of a kernel."""
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape} {value.tobytes().hex()}"
    if isinstance(value, tuple):
        return f"({', '.join(map(_text, value))})"
    if isinstance(value, CodeType):
        names = value.co_names, value.co_varnames
        return f"{value.co_code.hex()} {names} {_text(value.co_consts)}"
    if isinstance(value, Dispatcher):
        function = value.py_func
        return (
            f"{function.__module__}.{function.__qualname__} {sorted(value.targetoptions.items())}"
        )
    return repr(value)


class _Stamped:
    """Adds to a locator of numba what a kernel depends on."""

    def __init__(self, function: FunctionType, file: str) -> None:
        super().__init__(function, file)  # type: ignore[call-arg]
        self._function = function

    @classmethod
    def from_function(cls, function: FunctionType, file: str) -> Any:
        """See numba. None if neither the kernel nor what it calls is of this project."""
        if all(f.__module__.split(".")[0] not in PACKAGES for f in _with_callees(function)):
            return None
        return super().from_function(function, file)  # type: ignore[misc]

    def get_source_stamp(self) -> tuple[bytes, bytes]:
        """See numba."""
        digest = hashlib.sha256()
        for function in _with_callees(self._function):
            digest.update(_text(function.__code__).encode())
            for name, value in dependencies(function).items():
                digest.update(f"{name} = {_text(value)}".encode())
        return super().get_source_stamp(), digest.digest()  # type: ignore[misc]


class UserProvided(_Stamped, caching.UserProvidedCacheLocator):
    """In the folder of ``NUMBA_CACHE_DIR``, if that is set."""


class InTree(_Stamped, caching.InTreeCacheLocator):
    """In ``__pycache__`` beside the source."""


class UserWide(_Stamped, caching.UserWideCacheLocator):
    """In the cache of the user, if the source is in a folder that nobody may write to."""


def _install() -> None:
    """Make numba ask these first, in this process."""
    ours = [f"{__name__}.{c.__qualname__}" for c in (UserProvided, InTree, UserWide)]
    others = numba.config.CACHE_LOCATOR_CLASSES or ",".join(
        c.__name__ for c in caching.CacheImpl._locator_classes
    )
    numba.config.CACHE_LOCATOR_CLASSES = ",".join([*ours, others])


_install()
