"""When compiled kernels are compiled anew, and what they share.

numba keeps the machine code of a kernel in a file, until the source file of this kernel changes.
It does not see changes in other files on which the code depends as well: the kernels that it calls,
and the constants that it uses. After an update, the old code would go on running, without a word.
Here what is kept of a kernel is stamped with all of these too.

A kernel contains a copy of each kernel that it calls, optimised for this caller. numba gives all
copies the same name, and the one that is loaded first serves all callers. With ``fastmath``, copies
differ in the last bits, because sums are added up in another order. Results would then depend on
which kernels have been called before, and on whether they were compiled in this process. Here each
kernel uses only its own copies.

Whoever imports ``push_model`` gets both: import it before a file with kernels.
"""

import hashlib
import sys
from collections.abc import Iterator
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numba
import numpy as np
from numba.core import caching
from numba.core.codegen import CPUCodeLibrary
from numba.core.dispatcher import Dispatcher

if not hasattr(caching, "InTreeCacheLocator"):
    raise ImportError(f"numba 0.62 or later is needed, this is {numba.__version__}; update it")

PACKAGES = (
    "benchmarks",
    "grasp_opt",
    "push_gym",
    "push_model",
    "push_mpc",
    "push_planner",
    "push_qp",
    "push_study",
    "sim_bridge",
    "swarm_push",
)
"""Kernels of these, and those that call them, are stamped like this."""
_BUILD = b"own copies, 2"  # changes when the way of compiling does
_KERNEL = "_ZN"  # begins the names of kernels; those of numba's helpers begin with NRT_
_CONSTANT = (bool, int, float, complex, str, bytes, tuple, np.ndarray)


def modules_used(namespace: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Names and namespaces of the modules whose kernels the kernels of a namespace may call.

    They are found by what is imported: a kernel may also call one that is defined only after it.
    """
    found: dict[str, dict[str, Any]] = {}
    left = [namespace]
    while left:
        for value in list(left.pop().values()):
            name = ""
            if isinstance(value, Dispatcher):
                name = value.py_func.__module__
            elif isinstance(value, ModuleType) and _is_ours(value.__name__):
                name = value.__name__
            if name in sys.modules and name not in found and name != namespace["__name__"]:
                found[name] = vars(sys.modules[name])
                left.append(found[name])
    return found


def _is_ours(module: str) -> bool:
    return module.split(".")[0] in PACKAGES


def _facts(namespace: dict[str, Any], kernels: bool) -> Iterator[str]:
    """Constants and, if they are asked for, kernels of a namespace, on which code may depend."""
    for name in sorted(n for n in namespace if not n.startswith("__")):
        value = namespace[name]
        if isinstance(value, type) and issubclass(value, tuple):  # kernels know fields by number
            yield f"{name} has {getattr(value, '_fields', ())}"
        elif isinstance(value, _CONSTANT) or (kernels and isinstance(value, Dispatcher)):
            yield f"{name} = {_text(value)}"


def _text(value: Any) -> str:
    """The same for equal values in every process."""
    if isinstance(value, set | frozenset):
        return f"{{{', '.join(sorted(map(_text, value)))}}}"
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape} {value.tobytes().hex()}"
    if isinstance(value, tuple):
        return f"({', '.join(map(_text, value))})"
    if isinstance(value, CodeType):
        names = value.co_names, value.co_varnames
        return f"{value.co_code.hex()} {names} {_text(value.co_consts)}"
    if isinstance(value, Dispatcher):
        options = tuple(sorted(value.targetoptions.items()))
        return f"{_text(value.py_func.__code__)} {_text(options)}"
    return repr(value) if isinstance(value, _CONSTANT) or value is None else ""


class _Stamped:
    """Adds to a locator of numba what a kernel depends on."""

    def __init__(self, function: FunctionType, file: str) -> None:
        super().__init__(function, file)  # type: ignore[call-arg]
        self._namespace = function.__globals__

    @classmethod
    def from_function(cls, function: FunctionType, file: str) -> Any:
        """See numba. None if neither the kernel nor what it may call is of this project."""
        if not any(map(_is_ours, (function.__module__, *modules_used(function.__globals__)))):
            return None
        return super().from_function(function, file)  # type: ignore[misc]

    def get_source_stamp(self) -> tuple[bytes, bytes]:
        """See numba."""
        digest = hashlib.sha256(_BUILD + "".join(_facts(self._namespace, False)).encode())
        for name, namespace in sorted(modules_used(self._namespace).items()):
            digest.update(f"{name}: {' '.join(_facts(namespace, True))}".encode())
        return super().get_source_stamp(), digest.digest()  # type: ignore[misc]


class UserProvided(_Stamped, caching.UserProvidedCacheLocator):
    """In the folder of ``NUMBA_CACHE_DIR``, if that is set."""


class InTree(_Stamped, caching.InTreeCacheLocator):
    """In ``__pycache__`` beside the source."""


class UserWide(_Stamped, caching.UserWideCacheLocator):
    """In the cache of the user, if the source is in a folder that nobody may write to."""


def _with_own_copies(optimise: Any) -> Any:
    """A method of numba that optimises the code of a kernel and of the copies of its callees,
    changed so that these copies are private before that."""

    def changed(library: CPUCodeLibrary) -> None:
        for function in library._final_module.functions:
            copied = not function.is_declaration and function.linkage.name == "linkonce_odr"
            if copied and function.name.startswith(_KERNEL):
                function.linkage = "internal"
        optimise(library)

    return changed


def _install() -> None:
    """Make numba keep copies private, and ask these locators first, in this process."""
    if not hasattr(CPUCodeLibrary, "_optimize_final_module"):
        raise ImportError(f"numba {numba.__version__} is not known here; install 0.68.1")
    optimise = CPUCodeLibrary._optimize_final_module
    CPUCodeLibrary._optimize_final_module = _with_own_copies(optimise)  # type: ignore[method-assign]
    ours = [f"{__name__}.{c.__qualname__}" for c in (UserProvided, InTree, UserWide)]
    others = numba.config.CACHE_LOCATOR_CLASSES or ",".join(
        c.__name__ for c in caching.CacheImpl._locator_classes
    )
    numba.config.CACHE_LOCATOR_CLASSES = ",".join([*ours, others])


_install()
