"""Machine code that is kept from run to run is never that of another source."""

import os
import subprocess
import sys
from itertools import count
from pathlib import Path

import numba
import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

from push_model.kernel_cache import PACKAGES, modules_used
from push_planner import arc_search, push_curve

ROOT = Path(__file__).parents[2]
CALLEE = """
import numba
import numpy as np
from mine.constants import FACTOR

@numba.njit(cache=True, fastmath={{"contract", "arcp", "nsz", "reassoc"}})
def half(x):
    return {value} * x
"""
CALLER = """
import numba
from mine import callee
from mine.constants import FACTOR, TABLE, Pair

@numba.njit(cache=True)
def f(x):
    return FACTOR * later(x) + TABLE[1]

@numba.njit(cache=True)
def later(x):
    return callee.half(x)
"""
MAIN = """
from push_model import kernel_cache
kernel_cache.PACKAGES = {packages}
from mine.caller import f
print(f(8.0), sum(f.stats.cache_hits.values()))
"""


def run(folder, packages=("mine",), seeds=count(1)):  # noqa: B008
    """The result of the caller, and whether its code was kept from an earlier run. Sets are in
    another order in each run."""
    changes = {"PYTHONPATH": f"{folder}{os.pathsep}{ROOT}", "PYTHONHASHSEED": str(next(seeds))}
    out = subprocess.run(
        [sys.executable, "-c", MAIN.format(packages=packages)],
        env={k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"} | changes,
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split()
    return float(out[0]), int(out[1]) > 0


def write(folder, value=0.5, factor=1.0, table=(0.0, 3.0), fields="a b"):
    package = folder / "mine"
    package.mkdir(exist_ok=True)
    (package / "__init__.py").write_text("")
    (package / "callee.py").write_text(CALLEE.format(value=value))
    (package / "caller.py").write_text(CALLER)
    constants = f"import numpy as np\nFACTOR = {factor}\nTABLE = np.array({list(table)})\n"
    constants += f"from collections import namedtuple\nPair = namedtuple('Pair', '{fields}')\n"
    (package / "constants.py").write_text(constants)


CURVES = """
import hashlib, sys
import numpy as np
from push_planner import push_curve as c

given = 1.0, 0.1, 1.0, 0.0, -3.0, 2.5
if "callees" in sys.argv:
    c._refine(0.1, 0.1, 1e18, 0.2, *given, c.BASIS_COARSE)
    c._length(0.1, 0.1, *given[:4], c.BASIS_COARSE)
    c._holds(0.1, 0.1, *given, c.BASIS_COARSE)
    c._violation(0.1, 0.1, *given, c.BASIS_COARSE, np.empty(41))
random = np.random.default_rng(1)
digest = hashlib.sha256()
for x, y, t in random.uniform([0.1, -0.5, -1.2], [1.5, 0.5, 1.2], (400, 3)):
    found = c.solve_curve(x, y, np.cos(t), np.sin(t), *given[4:], c.BASIS_COARSE, c.BASIS_DENSE)
    digest.update(np.array(found).tobytes())
print(digest.hexdigest(), sum(c.solve_curve.stats.cache_hits.values()))
"""


@pytest.mark.long
def test_results_are_equal_to_the_bit_whatever_was_compiled_and_called_before(tmp_path):
    """Curves of pushes: sums with ``fastmath`` in kernels that other kernels call."""
    told = []
    for folder, order in (("a", ()), ("a", ()), ("a", ("callees",)), ("b", ("callees",))):
        changes = {"PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(tmp_path / folder)}
        command = [sys.executable, "-c", CURVES, *order]
        out = subprocess.run(
            command, env=os.environ | changes, capture_output=True, text=True, check=True
        )
        told.append(out.stdout.split())
    assert [kept for _, kept in told] == ["0", "1", "1", "0"]
    assert len({digest for digest, _ in told}) == 1, told


def test_a_kernel_shares_no_code_with_those_that_it_calls():
    """It shares only numba's reference counting, which numba has to find by its names."""

    @numba.njit(fastmath=True)
    def callee(x):  # too long to become part of the caller
        total = 0.0
        for k in range(3):
            total += (np.sqrt(x) + k).sum()
        return total

    @numba.njit(fastmath=True)
    def caller(x):
        return callee(x) + callee(x[1:])

    assert caller(np.arange(9.0)) > callee(np.arange(9.0))
    (compiled,) = caller.overloads.values()
    functions = [f for f in compiled.library._final_module.functions if not f.is_declaration]
    links = {f.name: f.linkage.name for f in functions}
    assert [link for name, link in links.items() if "6callee" in name] == ["internal"]
    assert {n for n, link in links.items() if link not in ("internal", "external")} == {
        "NRT_incref",
        "NRT_decref",
    }


@pytest.mark.long
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
    write(tmp_path, value=0.25, factor=2.0, table=(0.0, 4.0), fields="b a")
    assert run(tmp_path)[1] is False


def test_numba_alone_would_run_the_old_code(tmp_path):
    """If this fails, numba has learned it, and ``push_model/kernel_cache.py`` may go."""
    write(tmp_path)
    assert run(tmp_path, packages=()) == (7.0, False)
    write(tmp_path, value=0.25, factor=2.0)
    assert run(tmp_path, packages=()) == (7.0, True)


STAMPS = """
import importlib, sys
for module in sys.argv[1:]:
    importlib.import_module(module)
from numba.core.dispatcher import Dispatcher
for module in list(sys.modules.values()):
    for name, value in list(vars(module).items()):
        if isinstance(value, Dispatcher) and value._cache.cache_path:
            print(value.__module__, value.py_func.__name__, value._cache._cache_file._source_stamp)
"""


@pytest.mark.long
def test_stamps_do_not_depend_on_the_order_of_imports_or_of_sets():
    modules = ["push_planner", "swarm_push.swarm_job", "grasp_opt.placement", "push_mpc"]
    found = [
        subprocess.run(
            [sys.executable, "-c", STAMPS, *order],
            env=os.environ | {"PYTHONHASHSEED": str(seed), "PYTHONPATH": str(ROOT)},
            capture_output=True,
            text=True,
            check=True,
        ).stdout.splitlines()
        for seed, order in enumerate((modules, modules[::-1], ["push_planner.arc_search"]))
    ]
    assert len(set(found[0])) > 100 and set(found[0]) == set(found[1])
    assert len(set(found[2])) > 30 and set(found[2]) < set(found[0])


def test_the_modules_whose_kernels_may_be_called_are_found():
    found = modules_used(vars(arc_search))
    assert {"push_model.heap", "push_planner.push_curve", "push_model.distance_field"} <= set(found)
    assert "push_planner.arc_search" not in found
    assert set(modules_used(vars(push_curve))) == set()


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
