"""One LTV-MPC step by QP backend, easy and hard cases, against a reference solved to 1e-10."""

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from benchmarks.measure import at_least, at_most, quantiles, thread_times
from push_model import CurvatureLimits, DifferentialDrive, unicycle_step
from push_mpc import LtvMpc, MpcSettings, Reference
from push_qp import ActiveSetBackend, DaqpBackend, OsqpBackend, Qp, QpBackend, QpSolution

DRIVE = DifferentialDrive(0.0205, 0.0265, 6.28)
LIMITS = CurvatureLimits(-1.8, 1.8)
LOOPS, TICKS = 12, 50  # closed loops, and ticks of each; 1 in 50 is a cold start


class Reference10:
    """IPOPT to 1e-10, an interior-point method: independent of the backends compared."""

    def solve(self, qp: Qp) -> QpSolution:
        G, b = qp.rows(qp.all_rows())
        z = ca.MX.sym("z", len(qp.f))
        problem = {
            "x": z,
            "f": 0.5 * ca.bilin(ca.DM(qp.H), z, z) + ca.dot(ca.DM(qp.f), z),
            "g": ca.mtimes(ca.DM(G), z),
        }
        options = {
            "print_time": False,
            "ipopt": {
                "print_level": 0,
                "sb": "yes",
                "tol": 1e-10,
                "constr_viol_tol": 1e-10,
                "hessian_constant": "yes",
                "jac_d_constant": "yes",
                "bound_relax_factor": 0.0,
            },
        }
        solver = ca.nlpsol("reference", "ipopt", problem, options)
        answer = solver(lbx=qp.low, ubx=qp.high, ubg=b, lbg=-np.inf)
        best = np.array(answer["x"]).ravel()
        return QpSolution(best, bool(solver.stats()["success"]), "ipopt")

    def reset(self) -> None:
        pass


def cases(hard: bool) -> list[Any]:
    """Consecutive ticks of closed loops at 100 Hz: error, reference, obstacles.

    Easy: near the reference, obstacles out of the way. Hard: from far off, on a bend near the
    curvature limit, obstacles close along the way on both sides. The obstacles are 20 each time.
    """
    random = np.random.default_rng(7 if hard else 3)
    p, h = 20, 0.1
    result = []
    for _ in range(LOOPS):
        kappa = random.uniform(1.2, 1.7) * random.choice([-1, 1]) if hard else 0.3
        mpc = LtvMpc(replace(MpcSettings(), max_slack=1e6), DRIVE)
        aside = random.uniform(0.01, 0.025) if hard else 0.001
        state = np.array([-0.005, random.choice([-1, 1]) * aside, random.normal() * 0.1 * hard])
        v, omega = 0.05 if hard else 0.07, 0.0

        def at(t: np.ndarray, kappa: float = kappa) -> np.ndarray:
            theta = kappa * 0.07 * t
            return np.column_stack([np.sin(theta) / kappa, (1 - np.cos(theta)) / kappa, theta])

        way = at(np.linspace(0.5, 5.0, 10))
        normal = np.column_stack([-np.sin(way[:, 2]), np.cos(way[:, 2])])
        gap = random.uniform(0.045, 0.06, 10)[:, None] if hard else np.full((10, 1), 0.2)
        centres = np.vstack([way[:, :2] + gap * normal, way[:, :2] - gap * normal])
        circles = np.column_stack([centres, np.full(20, 0.045)])
        for tick in range(TICKS):
            pose = at(0.01 * tick + h * np.arange(p + 1))
            twist = np.tile([0.07, 0.0, 0.07 * kappa], (p + 1, 1))
            d = state - pose[0]
            c, s = np.cos(pose[0, 2]), np.sin(pose[0, 2])
            error = np.array(
                [c * d[0] + s * d[1], -s * d[0] + c * d[1], d[2], v - 0.07, omega - 0.07 * kappa]
            )
            result.append((error, Reference(pose, twist), circles, tick == 0))
            answer = mpc.solve(error, Reference(pose, twist), LIMITS, circles)
            v = max(v + 0.01 * answer.acceleration[0], 0.0)
            omega += 0.01 * answer.acceleration[1]
            state = unicycle_step(state, v, omega, 0.01) + random.normal(size=3) * [
                2e-4,
                2e-4,
                2e-3,
            ]
    return result


def run() -> dict[str, Any]:
    """Times, violations and first-input errors."""
    settings = replace(MpcSettings(), max_slack=1e6)
    backends: dict[str, Any] = {
        "active set": ActiveSetBackend(),
        "daqp": DaqpBackend(),
        "osqp 1e-5 polish": OsqpBackend(1e-5),
        "osqp 1e-3": OsqpBackend(1e-3, polish=False),
    }
    result: dict[str, Any] = {}
    for kind in ("easy", "hard"):
        inputs = cases(kind == "hard")
        sample = inputs[::10]
        exact = [solve_fresh(Reference10(), settings, c)[0] for c in sample]
        for name, solver in backends.items():
            mpc = LtvMpc(settings, DRIVE, solver)
            mpc.solve(inputs[0][0], inputs[0][1], LIMITS, inputs[0][2])

            def step(case: Any, mpc: LtvMpc = mpc) -> Any:
                if case[3]:
                    mpc.reset()
                return mpc.solve(case[0], case[1], LIMITS, case[2])

            times, _ = thread_times(step, inputs if "osqp" not in name else inputs[: 3 * TICKS])
            errors, violations = [], []
            for case, best in zip(sample, exact, strict=True):
                first, violation = solve_fresh(solver, settings, case)
                errors.append(np.abs((first - best) / [0.3, 6.0]).max())
                violations.append(violation)
            print(
                f"  {kind:4s} {name:17s} {quantiles(times)}   violation max "
                f"{max(violations):.1e}   first-input error median {np.median(errors):.1e} "
                f"max {max(errors):.1e}",
                flush=True,
            )
            result[f"{kind} {name}"] = {
                "median_s": float(np.median(times)),
                "p99_s": float(np.percentile(times, 99)),
                "violation_max": float(max(violations)),
                "first_input_error_max": max(errors),
            }
    both = {
        n: max(result[f"easy {n}"]["median_s"], result[f"hard {n}"]["median_s"]) for n in backends
    }
    p99 = max(result["easy active set"]["p99_s"], result["hard active set"]["p99_s"])
    result["bounds"] = {
        "step median, the worse of easy and hard [ms]": at_most(1e3 * both["active set"], 0.15),
        "step p99 [ms]": at_most(1e3 * p99, 0.4),
        "OSQP 1e-5 with polish / ours, median": at_least(
            both["osqp 1e-5 polish"] / both["active set"], 4.0
        ),
        "DAQP / ours, median of the hard cases": at_least(
            result["hard daqp"]["median_s"] / result["hard active set"]["median_s"], 1.0
        ),
        "first-input error, hard, max": at_most(
            result["hard active set"]["first_input_error_max"], 1e-3
        ),
    }
    return result


def solve_fresh(solver: QpBackend, settings: MpcSettings, case: Any) -> tuple[np.ndarray, float]:
    """First input and worst violated row of a step without history."""
    qp = LtvMpc(settings, DRIVE, solver).programme(case[0], case[1], LIMITS, case[2])
    result = solver.solve(qp)
    if not result.solved:
        return np.full(2, np.nan), np.inf
    return result.z[:2], max(-float(qp.rooms(result.z).min()), 0.0)
