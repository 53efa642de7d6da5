"""A tick of a group of five, and its force distribution against QP solvers."""

import math
from typing import Any

import casadi
import numpy as np
import osqp
from scipy.sparse import csc_matrix

from benchmarks.measure import at_least, at_most, quantiles, thread_times
from grasp_opt.contact_outline import ContactOutline, Contacts
from grasp_opt.group_control import distribute
from grasp_opt.group_push import GroupPush, Phase
from grasp_opt.object_trajectory import polynomial
from push_model import se2
from push_model.arrays import Array
from push_model.coulomb import cone_edges
from push_model.grasp import grasp_matrix
from push_scenario.bodies import load_object, load_robot

TICKS, PROGRAMMES, ROBOTS = 3000, 500, 5
_SQUARES = 1e-3  # weight of forces relative to the wrench, as in distribute


def _ticks() -> tuple[Array, int]:
    """CPU times [s] of ticks of a push: poses with noise, an object that is pushed off and back."""
    random = np.random.default_rng(1)
    item, robot = load_object("plate_ellipse"), load_robot("epuck_ring")
    way = ContactOutline(item.geometry).way_of_angle(1.5 * math.pi + np.linspace(-1.0, 1.0, ROBOTS))
    task = polynomial((0.25,), 3.2, 0.05, 0.05, -0.5 * math.pi)
    push = GroupPush(item, robot, way, task)
    places = push.controller.places
    inputs = []
    for k in range(TICKS + 50):
        now = 0.02 * k
        pose = task.sample(max(0.0, now - 1.0)) + [4e-3 * math.sin(now), 0.0, 0.02 * math.sin(now)]
        pose = pose + random.normal(0.0, 1.0, 3) * [2e-4, 2e-4, 1.7e-3]
        robots = np.column_stack([se2.transform(pose, places), np.full(ROBOTS, pose[2] + 1.57)])
        robots += random.normal(0.0, 1.0, robots.shape) * [2e-4, 2e-4, 1.7e-3]
        inputs.append((now, pose, robots))
    times, steps = thread_times(lambda i: push.step(*i), inputs)
    return times[50:], sum(s.phase is Phase.PUSH for s in steps[50:])


def _programmes() -> list[tuple[Array, Contacts]]:
    random = np.random.default_rng(2)
    outline = ContactOutline(load_object("plate_ellipse").geometry)
    return [
        (
            random.normal(size=3) * [1.0, 1.0, 0.1],
            outline.at(random.uniform(0.0, outline.length, ROBOTS)),
        )
        for _ in range(PROGRAMMES)
    ]


def _matrices(contacts: Contacts, length: float) -> tuple[Array, Array]:
    """The map from the forces along the cones' edges to the wrench, and the edges."""
    n = len(contacts.points)
    spread = np.zeros((2 * n, 2 * n))
    for i, normal in enumerate(contacts.normals):
        spread[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = cone_edges(normal, 0.2).T
    G = grasp_matrix(contacts.points) / np.array([[1.0], [1.0], [length]])
    return G @ spread, spread


def run() -> dict[str, Any]:
    """Thread CPU times of whole ticks and of force distributions."""
    length = 0.15
    scale = np.array([1.0, 1.0, length])
    programmes = _programmes()

    def ours(p: tuple[Array, Contacts]) -> Array:
        return distribute(p[0], p[1], 0.2, length)

    def quadratic(p: tuple[Array, Contacts]) -> tuple[Array, Array, Array]:
        A, spread = _matrices(p[1], length)
        P = A.T @ A + _SQUARES**2 * spread.T @ spread
        return P, -A.T @ (p[0] / scale), spread

    def by_osqp(p: tuple[Array, Contacts]) -> Array:
        P, q, spread = quadratic(p)
        n = len(q)
        solver = osqp.OSQP()
        eye = csc_matrix(np.eye(n))
        solver.setup(
            csc_matrix(np.triu(P)), q, eye, np.zeros(n), np.full(n, np.inf),
            verbose=False, eps_abs=1e-5, eps_rel=1e-5, polishing=False,
        )  # fmt: skip
        answer: Array = spread @ np.maximum(0.0, solver.solve().x)
        return answer.reshape(-1, 2)

    n = 2 * ROBOTS
    shape = {"h": casadi.Sparsity.dense(n, n), "a": casadi.Sparsity(0, n)}
    quiet = {"print_iter": False, "print_header": False, "error_on_fail": False}
    conic = casadi.conic("forces", "qrqp", shape, quiet)

    def by_qrqp(p: tuple[Array, Contacts]) -> Array:
        P, q, spread = quadratic(p)
        x = np.asarray(conic(h=P, g=q, lbx=0.0, ubx=np.inf)["x"]).ravel()
        answer: Array = spread @ x
        return answer.reshape(-1, 2)

    def cost(p: tuple[Array, Contacts], forces: Array) -> float:
        G = grasp_matrix(p[1].points) / scale[:, None]
        lack = G @ forces.ravel() - p[0] / scale
        return float(lack @ lack + _SQUARES**2 * np.sum(forces**2))

    ours(programmes[0]), by_osqp(programmes[0]), by_qrqp(programmes[0])
    tick, pushing = _ticks()
    mine, answers = thread_times(ours, programmes)
    found = {}
    for name, call in (("OSQP 1e-5", by_osqp), ("casadi qrqp", by_qrqp)):
        times, theirs = thread_times(call, programmes)
        worse = [
            cost(p, a) - cost(p, b) for p, a, b in zip(programmes, answers, theirs, strict=True)
        ]
        found[name] = times, max(worse)
    print(f"  tick of {ROBOTS} robots           {quantiles(tick)}   {pushing} of {TICKS} push")
    print(f"  force distribution         {quantiles(mine)}")
    for name, (times, worse_by) in found.items():
        print(f"  {name:26s} {quantiles(times)}   ours costs at most {worse_by:.1e} more")
    median = float(np.median(mine))
    return {
        "tick_s": float(np.median(tick)),
        "tick_p99_s": float(np.percentile(tick, 99)),
        "distribution_s": median,
        "rivals": {k: float(np.median(t)) for k, (t, _) in found.items()},
        "bounds": {
            "tick of five robots, p99 [ms]": at_most(1e3 * float(np.percentile(tick, 99)), 2.0),
            "ticks that push": at_least(pushing / TICKS, 0.99),
            **{
                f"{name} / force distribution, median": at_least(float(np.median(t)) / median, 1.0)
                for name, (t, _) in found.items()
            },
            "cost above the rivals' [N^2]": at_most(max(w for _, w in found.values()), 1e-5),
        },
    }
