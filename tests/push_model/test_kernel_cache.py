"""Machine code that is kept from run to run is never that of another source."""

import os
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

from push_model.kernel_cache import PACKAGES, dependencies
from push_planner import arc_search
from push_planner.push_curve import solve_curve

ROOT = Path(__file__).parents[2]
CALLEE = """
import numba
import numpy as np
from mine.constants import FACTOR

@numba.njit(cache=True)
def half(x):
    return {value} * x
"""
CALLER = """
import numba
from mine import callee
from mine.constants import FACTOR, TABLE

@numba.njit(cache=True)
def f(x):
    return FACTOR * callee.half(x) + TABLE[1]
"""
MAIN = """
from push_model import kernel_cache
kernel_cache.PACKAGES = {packages}
from mine.caller import f
print(f(8.0), sum(f.stats.cache_hits.values()))
"""


def run(folder, packages=("mine",)):
    """The result of the caller, and whether its code was kept from an earlier run."""
    path = f"{folder}{os.pathsep}{ROOT}"
    out = subprocess.run(
        [sys.executable, "-c", MAIN.format(packages=packages)],
        env={k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"} | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split()
    return float(out[0]), int(out[1]) > 0


def write(folder, value=0.5, factor=1.0, table=(0.0, 3.0)):
    package = folder / "mine"
    package.mkdir(exist_ok=True)
    (package / "__init__.py").write_text("")
    (package / "callee.py").write_text(CALLEE.format(value=value))
    (package / "caller.py").write_text(CALLER)
    constants = f"import numpy as np\nFACTOR = {factor}\nTABLE = np.array({list(table)})\n"
    (package / "constants.py").write_text(constants)


def test_a_kernel_is_compiled_anew_when_what_it_uses_of_other_files_changes(tmp_path):
    write(tmp_path)
    assert run(tmp_path) == (7.0, False)
    assert run(tmp_path) == (7.0, True)
    write(tmp_path, value=0.25)  # what it calls
    assert run(tmp_path) == (5.0, False)
    write(tmp_path, value=0.25, factor=2.0)
    assert run(tmp_path) == (7.0, False)
    write(tmp_path, value=0.25, factor=2.0, table=(0.0, 4.0))
    assert run(tmp_path) == (8.0, False)
    assert run(tmp_path) == (8.0, True)


def test_numba_alone_would_run_the_old_code(tmp_path):
    """If this fails, numba has learned it, and ``push_model/kernel_cache.py`` may go."""
    write(tmp_path)
    assert run(tmp_path, packages=()) == (7.0, False)
    write(tmp_path, value=0.25, factor=2.0)
    assert run(tmp_path, packages=()) == (7.0, True)


def test_what_a_kernel_depends_on_is_found():
    found = dependencies(arc_search._last_push.py_func)
    assert found["solve_curve"] is solve_curve and found["_NEAR"] == arc_search._NEAR
    found = dependencies(arc_search._advance.py_func)
    assert isinstance(found["heap.pop"], Dispatcher) and "_last_push" in found


def files_with_kernels():
    for package in PACKAGES:
        for file in sorted((ROOT / package).rglob("*.py")):
            if "@numba.njit(" in file.read_text():
                yield file


def test_push_model_is_imported_before_every_file_with_kernels():
    files = list(files_with_kernels())
    assert len(files) > 30
    for file in files:
        folders = [f for f in file.parents if ROOT in f.parents]
        sources = [file, *(f / "__init__.py" for f in folders)]
        begins = ("from push_model", "import push_model")
        own = (ROOT / "push_model") in file.parents
        assert own or any(
            line.startswith(begins) for s in sources for line in s.read_text().splitlines()
        ), f"{file}: import push_model.kernel_cache in the package's __init__.py"


def test_all_kernels_are_in_the_packages_that_are_stamped():
    known = set(files_with_kernels())
    for package in (p for p in ROOT.iterdir() if (p / "__init__.py").is_file()):
        for file in package.rglob("*.py"):
            if package.name != "tests" and "@numba.njit(" in file.read_text():
                assert file in known, f"add '{package.name}' to PACKAGES of kernel_cache.py"
    for module in list(sys.modules.values()):
        for value in list(vars(module).values()):
            ours = isinstance(value, Dispatcher) and value.__module__.split(".")[0] in PACKAGES
            if ours and value._cache.cache_path is not None:
                assert type(value._cache._impl.locator).__module__ == "push_model.kernel_cache"


@pytest.mark.parametrize("value", [np.arange(3.0), (1, 2.5), 7, "x"])
def test_constants_count_by_their_value(value):
    @numba.njit
    def kernel():
        return CONSTANT  # noqa: F821

    kernel.py_func.__globals__["CONSTANT"] = value
    try:
        assert dependencies(kernel.py_func) == {"CONSTANT": value}
    finally:
        del kernel.py_func.__globals__["CONSTANT"]
