"""Push-curve optimisation against SLSQP and IPOPT on random pairs of poses."""

import math
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import minimize

from benchmarks.measure import at_least, at_most, quantiles, thread_times
from push_planner import PushCurve, shortest_push_curve

LOW, HIGH, PAIRS, SAMPLES = -4.0, 5.0, 500, 50
TOLERANCE = 1.02  # of a limit; solvers that sample 50 points exceed it a little in between


def pairs(count: int = PAIRS) -> list[np.ndarray]:
    """End poses relative to the start, roughly ahead of it."""
    random = np.random.default_rng(0)
    result = []
    for _ in range(count):
        distance, bearing = random.uniform(0.2, 1.5), random.uniform(-1.2, 1.2)
        result.append(
            np.array(
                [
                    distance * math.cos(bearing),
                    distance * math.sin(bearing),
                    random.uniform(-1.6, 1.6),
                ]
            )
        )
    return result


def feasible(k: np.ndarray, end: np.ndarray) -> bool:
    """Whether a curve keeps the limits on a dense sample, to 2 %."""
    if k is None or not np.isfinite(k).all() or k.min() <= 0.0:
        return False
    kappa = PushCurve(np.zeros(3), end, float(k[0]), float(k[1]), 0.0).sample(801)[2]
    return bool(kappa.max() <= HIGH * TOLERANCE and kappa.min() >= LOW * TOLERANCE)


def length(k: np.ndarray, end: np.ndarray) -> float:
    points = PushCurve(np.zeros(3), end, float(k[0]), float(k[1]), 0.0).sample(801)[0]
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def model() -> dict[str, Any]:
    """(2.5)-(2.7) in CasADi, parameter: end pose."""
    k, end = ca.SX.sym("k", 2), ca.SX.sym("end", 3)
    s = np.linspace(0.0, 1.0, SAMPLES)
    f1, g1 = 3 * s**2 - 2 * s, (s - 1) ** 2 + 2 * s * (s - 1)
    f2, g2 = 6 * s - 2, 6 * s - 4
    dx = (3 * s**2 - 3 * f1) * end[0] + f1 * k[1] * ca.cos(end[2]) + g1 * k[0]
    dy = (3 * s**2 - 3 * f1) * end[1] + f1 * k[1] * ca.sin(end[2])
    ddx = (6 * s - 3 * f2) * end[0] + f2 * k[1] * ca.cos(end[2]) + g2 * k[0]
    ddy = (6 * s - 3 * f2) * end[1] + f2 * k[1] * ca.sin(end[2])
    q = dx * dx + dy * dy
    speed = ca.sqrt(q + 1e-12)
    arc = (ca.sum1(speed) - 0.5 * (speed[0] + speed[SAMPLES - 1])) / (SAMPLES - 1)
    return {"x": k, "p": end, "f": arc, "g": (dx * ddy - dy * ddx) / (q * speed + 1e-12)}


def run() -> dict[str, Any]:
    """Time, feasible cases and length gap."""
    ends = pairs()
    nlp = model()
    quiet = {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes", "max_iter": 200}}
    ipopt_solver = ca.nlpsol("ipopt", "ipopt", nlp, quiet)
    value = ca.Function(
        "value",
        [nlp["x"], nlp["p"]],
        [nlp["f"], ca.gradient(nlp["f"], nlp["x"]), nlp["g"], ca.jacobian(nlp["g"], nlp["x"])],
    )

    def ours(end: np.ndarray) -> np.ndarray | None:
        curve = shortest_push_curve(np.zeros(3), end, LOW, HIGH)
        return None if curve is None else np.array([curve.k_start, curve.k_end])

    def ipopt(end: np.ndarray) -> np.ndarray:
        d = float(np.hypot(end[0], end[1]))
        result = ipopt_solver(x0=[d, d], p=end, lbx=0.02, ubx=50, lbg=LOW, ubg=HIGH)
        return np.array(result["x"]).ravel()

    def slsqp(end: np.ndarray) -> np.ndarray:
        d = float(np.hypot(end[0], end[1]))

        def parts(k: np.ndarray) -> list[np.ndarray]:
            return [np.array(a) for a in value(k, end)]

        bounds = {
            "type": "ineq",
            "fun": lambda k: np.concatenate(
                [HIGH - parts(k)[2].ravel(), parts(k)[2].ravel() - LOW]
            ),
            "jac": lambda k: np.vstack([-parts(k)[3], parts(k)[3]]),
        }
        return np.asarray(
            minimize(
                lambda k: float(parts(k)[0][0, 0]),
                [d, d],
                jac=lambda k: parts(k)[1].ravel(),
                bounds=[(0.02, 50)] * 2,
                method="SLSQP",
                constraints=bounds,
                options={"maxiter": 80},
            ).x
        )

    ours(ends[0])
    found, times = {}, {}
    for name, solver in (("ours", ours), ("slsqp", slsqp), ("ipopt", ipopt)):
        times[name], answers = thread_times(solver, ends)
        found[name] = [
            k if k is not None and feasible(k, e) else None
            for k, e in zip(answers, ends, strict=True)
        ]
    best = [
        min((length(found[n][i], e) for n in found if found[n][i] is not None), default=math.nan)
        for i, e in enumerate(ends)
    ]
    any_feasible = sum(not math.isnan(b) for b in best)
    result: dict[str, Any] = {}
    for name in found:
        gaps = np.array(
            [
                length(k, e) / b - 1.0
                for k, e, b in zip(found[name], ends, best, strict=True)
                if k is not None
            ]
        )
        count = len(gaps)
        print(
            f"  {name:6s} {quantiles(times[name])}   feasible {count}/{any_feasible}   length gap "
            f"mean {gaps.mean():.1e} max {gaps.max():.1e}"
        )
        result[name] = {
            "median_s": float(np.median(times[name])),
            "feasible": count,
            "gap_max": float(gaps.max()),
            "gap_mean": float(gaps.mean()),
        }
    ratio = result["ipopt"]["median_s"] / result["ours"]["median_s"]
    rivals = max(result["ipopt"]["feasible"], result["slsqp"]["feasible"])
    result["bounds"] = {
        "median [ms]": at_most(1e3 * result["ours"]["median_s"], 0.2),
        "IPOPT / ours, median": at_least(ratio, 30.0),
        "feasible cases over the best rival": at_least(result["ours"]["feasible"] - rivals, 0),
    }
    return result
