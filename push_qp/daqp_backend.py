"""DAQP (Arnstrom, Bemporad and Axehill, 2022), a dual active-set solver, as a backend."""

import daqp
import numpy as np

from push_model.arrays import Array
from push_qp.programme import Flags, Qp
from push_qp.row_generation import DenseSolution, RowGeneration

_ACTIVE, _AT_LOWER, _EQUALITY = 1, 2, 5  # its flags of a constraint


class Daqp:
    """Starts from the working set that the multipliers indicate."""

    tolerance = 1e-6  # its own default

    def solve(
        self, qp: Qp, G: Array, b: Array, equal: Flags, z: Array, multiplier: Array, known: bool
    ) -> DenseSolution:
        """See DenseSolver."""
        n = len(qp.f)
        upper = np.concatenate([qp.high, b])
        lower = np.concatenate([qp.low, np.where(equal, b, -1e30)])
        sense = np.zeros(len(upper), dtype=np.int32)
        if known:
            sense[multiplier > 0.0] = _ACTIVE
            sense[multiplier < 0.0] = _ACTIVE + _AT_LOWER
        sense[n:][equal] = _EQUALITY
        best, _, flag, info = daqp.solve(qp.H, qp.f, G, upper, lower, sense)
        return DenseSolution(np.asarray(best), np.asarray(info["lam"]), flag >= 1, f"daqp {flag}")


class DaqpBackend(RowGeneration):
    """DAQP with row generation, or with every row."""

    def __init__(self, every_row: bool = False) -> None:
        super().__init__(Daqp(), every_row)
