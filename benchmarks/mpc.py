"""One LTV-MPC step by QP backend, easy and hard cases, against a reference solved to 1e-10.

The hard cases are also solved with contact forces (section 2.4.6): "forces". Every solver gets the
same rows and the same warm start as ours: once with row generation by the same compiled code, and
once with every row. Each starts from its solution of the previous tick, and cold where a closed
loop begins.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from benchmarks.measure import at_least, at_most, quantiles, thread_times
from push_model import CurvatureLimits, DifferentialDrive, unicycle_step
from push_mpc import (
    Contact,
    ContactForceMpc,
    ContactForceSettings,
    LtvMpc,
    MpcSettings,
    Reference,
    line_contact,
)
from push_planner import push_sides
from push_qp import ActiveSetBackend, DaqpBackend, OsqpBackend, Qp, QpBackend, QpSolution
from push_scenario.scenario import load_scenario

DRIVE = DifferentialDrive(0.0205, 0.0265, 6.28)
LIMITS = Contact(CurvatureLimits(-1.8, 1.8))
UNBOUNDED, FORCES = (
    replace(s, max_wheel_slack=100.0, max_curvature_slack=100.0, max_obstacle_slack=100.0)
    for s in (MpcSettings(), ContactForceSettings())
)
LOOPS, TICKS = 12, 50  # closed loops, and ticks of each; 1 in 50 is a cold start


@dataclass(frozen=True)
class Kind:
    """A case: a controller with its contact, in easy or hard loops."""

    controller: type[LtvMpc]
    settings: Any
    contact: Contact
    hard: bool

    def make(self, solver: Any = None) -> LtvMpc:
        """A controller; with its own solver if none is given."""
        return self.controller(self.settings, DRIVE, solver)


def kinds() -> dict[str, Kind]:
    """The cases by name."""
    scenario = load_scenario("short")
    robot, item = scenario.robot()[1], scenario.object()[1]
    side = push_sides(robot, item, 1.0)[0]
    forces = Contact(side.nominal, line_contact(robot, item, side.grasp))
    return {
        "easy": Kind(LtvMpc, UNBOUNDED, LIMITS, False),
        "hard": Kind(LtvMpc, UNBOUNDED, LIMITS, True),
        "forces": Kind(ContactForceMpc, FORCES, forces, True),
    }


class WrittenOut:
    """Our active set with every row written out, as for the other solvers."""

    def __init__(self) -> None:
        self._solver = ActiveSetBackend()

    def solve(self, qp: Qp) -> QpSolution:
        G, b = qp.rows(np.arange(qp.bound.size))
        return self._solver.solve(Qp.dense(qp.H, qp.f, G, b, qp.low, qp.high))

    def reset(self) -> None:
        self._solver.reset()


class Nothing:
    """Solves nothing, to measure the cost of a step without the solver."""

    def solve(self, qp: Qp) -> QpSolution:
        return QpSolution(np.zeros(len(qp.f)), True, "nothing")

    def reset(self) -> None:
        pass


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


def cases(kind: Kind, seed: int = 0, solver: Any = None, loops: int = LOOPS) -> list[Any]:
    """Consecutive ticks of closed loops at 100 Hz: error, reference, obstacles. seed: other loops.
    solver: of the controller that closes them.

    Easy: near the reference, obstacles far away. Hard: far from the reference, on a bend near the
    curvature limit, obstacles close on both sides. There are always 20 obstacles.
    """
    hard = kind.hard
    first = 7 if hard else 3
    random = np.random.default_rng([first, seed] if seed else first)
    p, h = 20, 0.1
    result = []
    for _ in range(loops):
        kappa = random.uniform(1.2, 1.7) * random.choice([-1, 1]) if hard else 0.3
        mpc = kind.make(solver)
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
            answer = mpc.solve(error, Reference(pose, twist), kind.contact, circles)
            v = max(v + 0.01 * answer.acceleration[0], 0.0)
            omega += 0.01 * answer.acceleration[1]
            state = unicycle_step(state, v, omega, 0.01) + random.normal(size=3) * [
                2e-4,
                2e-4,
                2e-3,
            ]
    return result


BACKENDS: dict[str, Callable[[], Any]] = {
    "active set": ActiveSetBackend,
    "active set, every row": WrittenOut,
    "daqp": DaqpBackend,
    "daqp, every row": lambda: DaqpBackend(every_row=True),
    "osqp 1e-5 polish": lambda: OsqpBackend(1e-5),
    "osqp 1e-5 polish, every row": lambda: OsqpBackend(1e-5, every_row=True),
    "osqp 1e-3": lambda: OsqpBackend(1e-3, polish=False),
    "osqp 1e-3, every row": lambda: OsqpBackend(1e-3, polish=False, every_row=True),
    "no solver": Nothing,
}


def run() -> dict[str, Any]:
    """Times, violations and first-input errors."""
    result: dict[str, Any] = {}
    for label, kind in kinds().items():
        inputs = cases(kind)
        sample = inputs[::10]
        exact = [solve_fresh(Reference10(), kind, c)[0] for c in sample]
        times = _interleaved(kind, inputs)
        for name, make in BACKENDS.items():
            row = {
                "median_s": float(np.median(times[name])),
                "p99_s": float(np.percentile(times[name], 99)),
            }
            text = f"  {label:6s} {name:27s} {quantiles(times[name])}"
            if name != "no solver":
                answers = [solve_fresh(make(), kind, case) for case in sample]
                errors = [
                    float(np.abs((first - best) / [0.3, 6.0]).max())
                    for (first, _), best in zip(answers, exact, strict=True)
                ]
                row["violation_max"] = float(np.max([violation for _, violation in answers]))
                row["first_input_error_max"] = float(np.max(errors))  # nan if one is
                text += (
                    f"   violation max {row['violation_max']:.1e}   first-input error median "
                    f"{np.median(errors):.1e} max {np.max(errors):.1e}"
                )
            print(text, flush=True)
            result[f"{label} {name}"] = row
    result["bounds"] = _bounds(result)
    return result


def _interleaved(kind: Kind, inputs: list[Any]) -> dict[str, np.ndarray]:
    """CPU time [s] of each step by backend. Backends alternate, one closed loop each, so that a
    temporarily slow machine slows all of them. OSQP runs three loops.
    """
    controllers = {name: kind.make(make()) for name, make in BACKENDS.items()}
    times: dict[str, list[np.ndarray]] = {name: [] for name in BACKENDS}
    for first in range(0, len(inputs), TICKS):
        for name, mpc in controllers.items():
            if "osqp" in name and first >= 3 * TICKS:
                continue
            if first == 0:
                mpc.solve(inputs[0][0], inputs[0][1], kind.contact, inputs[0][2])

            def step(case: Any, mpc: LtvMpc = mpc) -> Any:
                if case[3]:
                    mpc.reset()
                return mpc.solve(case[0], case[1], kind.contact, case[2])

            times[name].append(thread_times(step, inputs[first : first + TICKS])[0])
    return {name: np.concatenate(parts) for name, parts in times.items()}


def _bounds(result: dict[str, Any]) -> dict[str, Any]:
    easy, hard = result["easy active set"], result["hard active set"]

    def ratio(name: str, quantile: str = "median_s", of: Sequence[str] = ("easy", "hard")) -> float:
        """The smallest value."""
        return min(
            result[f"{kind} {name}"][quantile] / result[f"{kind} active set"][quantile]
            for kind in of
        )

    forces = result["forces active set"]

    return {
        "step median, easy [ms]": at_most(1e3 * easy["median_s"], 0.065),
        "step median, hard [ms]": at_most(1e3 * hard["median_s"], 0.115),
        "step p99 [ms]": at_most(1e3 * max(easy["p99_s"], hard["p99_s"]), 0.4),
        "OSQP 1e-5 with polish / ours, the same rows, median": at_least(
            ratio("osqp 1e-5 polish"), 4.0
        ),
        "DAQP / ours, the same rows, median": at_least(ratio("daqp"), 1.0),
        "DAQP / ours, the same rows, p99": at_least(ratio("daqp", "p99_s"), 1.0),
        "DAQP with every row / ours, median": at_least(ratio("daqp, every row"), 1.0),
        "first-input error, hard, max": at_most(hard["first_input_error_max"], 1e-3),
        "forces: step / that without forces, median": at_most(
            forces["median_s"] / hard["median_s"], 20.0
        ),
        "forces: OSQP 1e-5 with polish / ours, the same rows, median": at_least(
            ratio("osqp 1e-5 polish", of=("forces",)), 1.0
        ),
        "forces: DAQP / ours, the same rows, median": at_least(ratio("daqp", of=("forces",)), 1.0),
        "forces: first-input error, max": at_most(forces["first_input_error_max"], 1e-3),
    }


def solve_fresh(solver: QpBackend, kind: Kind, case: Any) -> tuple[np.ndarray, float]:
    """First input and worst violated row of a step without history."""
    qp = kind.make(solver).programme(case[0], case[1], kind.contact, case[2])
    result = solver.solve(qp)
    if not result.solved:
        return np.full(2, np.nan), np.inf
    return result.z[:2], qp.violation(result.z)
