"""The wheel-slip NMPC (2.14) against IPOPT: solve time and cost of the solution.

Both solve the same programme from the same start: along a closed loop, with the last solution,
and from random states, with none. Programmes with the slip constraint (2.31)-(2.33) and without it
are timed, and bounded, apart. Times are CPU times of the thread.
"""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from benchmarks.measure import at_least, at_most
from push_model.limit_surface import GRAVITY
from push_mpc.wheel_slip_nmpc import WheelSlipNmpc, WheelSlipSettings, beside
from push_scenario.scenario import load_scenario

_SMOOTH, _NEWTON = 0.1, 0.1  # as in push_mpc/torque_prediction.py, written independently


class Ipopt:
    """(2.14) in casadi, with the greatest violation as a further unknown.

    Its friction is the one that the controller trusts when this is made."""

    def __init__(self, nmpc: WheelSlipNmpc) -> None:
        s, r = nmpc.settings, nmpc.robot
        n, most = 2 * s.control_horizon, nmpc.drive.max_torque
        z, slack = ca.SX.sym("z", n), ca.SX.sym("s")
        start, reference = ca.SX.sym("q", 5), ca.SX.sym("r", 5, s.horizon + 1)
        along = r.mass + 2.0 * r.rolling / r.radius**2
        about = r.turning + 2.0 * r.half_track**2 / r.radius**2 * r.rolling
        x, y, theta, v, omega = ca.vertsplit(start)
        cost, rows = 0, []
        for k in range(s.horizon):
            j = 2 * min(k, s.control_horizon - 1)
            right, left = z[j], z[j + 1]
            lag = r.body_mass * r.ahead
            a = ((right + left) / r.radius + lag * omega**2) / along
            eps = (r.half_track / r.radius * (right - left) - lag * v * omega) / about
            pulls = [
                (t - r.rolling / r.radius * (a + sign * r.half_track * eps)) / r.radius
                for t, sign in ((right, 1.0), (left, -1.0))
            ]
            aside = r.mass * v * omega + lag * eps
            forward, across = a - r.ahead * omega**2, v * omega + r.ahead * eps
            wheels = 2.0 * (r.wheel_mass * r.radius + r.rolling / r.radius)
            held = r.body_mass * (r.ahead * GRAVITY - r.height * forward) - wheels * a
            caster = held / r.caster
            tilt = r.body_mass * r.height * across + 2.0 * r.wheel_mass * r.radius * v * omega
            both, apart = r.mass * GRAVITY - caster, tilt / r.half_track
            loads = [0.5 * (both + apart), 0.5 * (both - apart)]
            if s.constraint:
                for pull, load in zip(pulls, loads, strict=True):
                    norm = ca.sqrt(pull**2 + (s.sideways_share * aside) ** 2 + _SMOOTH**2)
                    rows += [_NEWTON * (norm - nmpc.trusted * load), -_NEWTON * load]
                rows.append(-_NEWTON * caster)
            x, y, theta, v, omega = (
                x + s.step * ca.cos(theta) * v,
                y + s.step * ca.sin(theta) * v,
                theta + s.step * omega,
                v + s.step * a,
                omega + s.step * eps,
            )
            limit = nmpc.drive.max_wheel_speed
            for side in (1.0, -1.0):
                speed = (v + side * r.half_track * omega) / r.radius
                rows += [speed - limit, -speed - limit]
            for place in (x, y):
                rows += [place - s.position_limit, -place - s.position_limit]
            ex, ey = x - reference[0, k + 1], y - reference[1, k + 1]
            error = ca.vertcat(
                ca.cos(theta) * ex + ca.sin(theta) * ey,
                -ca.sin(theta) * ex + ca.cos(theta) * ey,
                theta - reference[2, k + 1],
                v - reference[3, k + 1],
                omega - reference[4, k + 1],
            )
            factor = s.terminal_factor if k == s.horizon - 1 else 1.0
            cost += factor * ca.dot(ca.DM(s.state_weight), error**2)
        price = s.penalty * slack + s.penalty_square * slack**2
        problem = {
            "x": ca.vertcat(z, slack),
            "p": ca.vertcat(start, ca.reshape(reference, -1, 1)),
            "f": cost + price,
            "g": ca.vertcat(*[row - slack for row in rows]),
        }
        quiet = {"ipopt.print_level": 0, "print_time": 0, "ipopt.tol": 1e-8, "ipopt.sb": "yes"}
        warm = {"ipopt.warm_start_init_point": "yes"}
        self._solver = ca.nlpsol("nmpc", "ipopt", problem, quiet | warm)
        self._low, self._high = [-most] * n + [0.0], [most] * n + [1e6]

    def solve(self, z: Any, state: Any, reference: Any) -> tuple[Any, float, float]:
        """Torques, cost and CPU time [s] of a solve that begins at z."""
        given = np.concatenate([state, beside(state, reference).ravel()])
        began = time.thread_time()
        answer = self._solver(
            x0=np.append(z, 0.0), p=given, lbx=self._low, ubx=self._high, lbg=-np.inf, ubg=0.0
        )
        spent = time.thread_time() - began
        return np.array(answer["x"]).ravel()[:-1], float(answer["f"]), spent


def random_cases(count: int, seed: int = 1) -> list[tuple[Any, Any]]:
    """Random states near references of random speed and turn rate."""
    random = np.random.default_rng(seed)
    cases = []
    for _ in range(count):
        state = random.uniform([-0.3, -0.3, -0.5, -0.3, -0.5], [0.3, 0.3, 0.5, 0.6, 0.5])
        v, omega = random.uniform(0.1, 0.6), random.uniform(-0.6, 0.6)
        cases.append((state, arc(v, omega)))
    return cases


def arc(v: float, omega: float, steps: int = 16, step: float = 0.1) -> Any:
    """A reference of constant speed and turn from the origin."""
    at = step * np.arange(steps)
    heading = omega * at
    x = v * at if abs(omega) < 1e-9 else v / omega * np.sin(heading)
    y = 0.0 * at if abs(omega) < 1e-9 else v / omega * (1.0 - np.cos(heading))
    return np.column_stack([x, y, heading, 0.0 * at + v, 0.0 * at + omega])


def run(count: int = 200) -> dict[str, Any]:
    """CPU times and costs."""
    spec = next(iter(load_scenario("pioneer").robots.values()))[0]
    result: dict[str, Any] = {}
    bounds: dict[str, Any] = {}
    for name, constraint in (("with the constraint", True), ("without", False)):
        nmpc = WheelSlipNmpc(replace(WheelSlipSettings(), constraint=constraint), spec)
        rival = Ipopt(nmpc)
        nmpc.warm_up()
        ours, theirs, over = [], [], []
        for state, reference, z in _starts(nmpc, count):
            nmpc.set_start(z)
            answer = nmpc.solve(state, reference)
            assert answer.solved, answer.reason
            _, cost, spent = rival.solve(z, state, reference)
            ours.append(answer.solve_time)
            theirs.append(spent)
            over.append(answer.cost / cost - 1.0)
        late, slow = 1e3 * float(np.quantile(ours, 0.99)), 1e3 * float(np.quantile(theirs, 0.99))
        ratio, worse = float(np.median(theirs) / np.median(ours)), float(np.quantile(over, 0.99))
        print(
            f"  {name:20s} ours median {1e3 * np.median(ours):.2f} ms p99 {late:.2f} ms; IPOPT "
            f"median {1e3 * np.median(theirs):.2f} ms p99 {slow:.2f} ms; cost over IPOPT's: "
            f"median {100 * np.median(over):.3f} %, 99 % {100 * worse:.3f} %, most "
            f"{100 * np.max(over):.2f} %",
            flush=True,
        )
        result[name] = {"ours_s": float(np.median(ours)), "ipopt_s": float(np.median(theirs))}
        bounds[f"{name}: a solve, p99 [ms]"] = at_most(late, 10.0)
        bounds[f"{name}: IPOPT / ours, median"] = at_least(ratio, 3.0)
        bounds[f"{name}: IPOPT / ours, p99"] = at_least(slow / late, 3.0)
        bounds[f"{name}: cost over IPOPT's, 99 % of the solves"] = at_most(worse, 0.01)
    result["bounds"] = bounds
    return result


Start = tuple[Any, Any, Any]


def _starts(nmpc: WheelSlipNmpc, count: int) -> list[Start]:
    """Random states without a start, and as many along closed loops with the last solution."""
    none = np.zeros(2 * nmpc.settings.control_horizon)
    starts: list[Start] = [(q, r, none) for q, r in random_cases(count)]
    random = np.random.default_rng(2)
    rolled: Callable[..., Any] = nmpc.robot.accelerations
    while len(starts) < 2 * count:
        v, omega = random.uniform(0.1, 0.6), random.uniform(-0.6, 0.6)
        state = random.uniform([-0.2, -0.2, -0.3, 0.0, 0.0], [0.2, 0.2, 0.3, 0.0, 0.0])
        nmpc.reset()
        for k in range(20):
            reference = arc(v, omega, 16 + k)[k:]
            starts.append((state, reference, nmpc.start.copy()))
            right, left = nmpc.solve(state, reference).torques
            for _ in range(10):
                a, eps = rolled(state[3], state[4], right, left)
                rate = [np.cos(state[2]) * state[3], np.sin(state[2]) * state[3], state[4], a, eps]
                state = state + 0.01 * np.array(rate)
    return starts[: 2 * count]
