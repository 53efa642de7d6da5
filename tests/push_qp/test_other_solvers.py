"""Other people's solvers find what ours finds, on the programmes of bench mpc."""

import numpy as np
import pytest

from benchmarks.mpc import cases, kinds
from benchmarks.qp_rivals import RIVALS, backend
from benchmarks.solvers import agreement, makers

MODULES = {"proxqp": "proxsuite"}


@pytest.mark.parametrize("name", RIVALS)
@pytest.mark.parametrize("label", ["easy", "hard", "forces"])
def test_its_first_input_is_ours(name, label):
    """40 steps of closed loops, without history; forces: with contact forces as unknowns. Their
    tolerance is 1e-6 of rows and duals, ours is exact, so inputs differ by a little."""
    pytest.importorskip(MODULES.get(name, name))
    assert agreement(kinds()[label], name, 40) < 5e-3


def test_what_is_installed_takes_part(capsys):
    found = makers()
    told = capsys.readouterr().out
    assert {"active set", "daqp", "osqp"} <= set(found)
    for name in RIVALS:
        try:
            backend(name)
        except ImportError:
            assert f"{name} is not installed" in told and name not in found
        else:
            assert name in found


def test_loops_of_other_seeds_are_other_loops():
    kind = kinds()["hard"]
    first, again, other = (cases(kind, s)[:60] for s in (1, 1, 2))
    assert all(np.array_equal(a[0], b[0]) for a, b in zip(first, again, strict=True))
    assert not all(np.array_equal(a[0], b[0]) for a, b in zip(first, other, strict=True))
