"""Grasp-task compatibility and indices, of one grasp and of many at once, against LP solvers."""

from typing import Any

import numpy as np
from scipy.optimize import linprog, nnls

from benchmarks.measure import at_least, at_most, quantiles, thread_times
from grasp_opt.contact_outline import ContactOutline
from grasp_opt.indices import composed_quality, dexterity, extension, modified_hausdorff
from grasp_opt.wrench_cone import HELD, margin, margins, task_wrenches, wrench_rays
from push_scenario.bodies import load_object

GRASPS, CONTACTS, SAMPLES, LPS = 10_000, 3, 40, 200


def run() -> dict[str, Any]:
    """Times of one evaluation: the margin of a whole task, and all four indices."""
    random = np.random.default_rng(1)
    item = load_object("plate_ellipse")
    surface, outline = item.limit_surface(), ContactOutline(item.geometry)
    length, friction = surface.radius, item.contact_friction
    twists = random.normal(size=(SAMPLES, 3)) * [0.01, 0.02, 0.1] + [0.1, 0.0, 0.0]
    wrenches = task_wrenches(twists, surface, length)
    grasps = [outline.at(random.uniform(0.0, outline.length, CONTACTS)) for _ in range(GRASPS)]

    def test(contacts: Any) -> float:
        return margin(wrench_rays(contacts.points, contacts.normals, friction, length), wrenches)

    def indices(contacts: Any) -> tuple[Any, ...]:
        p, n = contacts.points[None], contacts.normals[None]
        rays = wrench_rays(p, n, friction, length, bisectors=True)
        return (
            composed_quality(p, n),
            extension(p),
            dexterity(p, length),
            modified_hausdorff(rays, wrenches),
        )

    def programme(contacts: Any) -> bool:
        rays = wrench_rays(contacts.points, contacts.normals, friction, length)
        answers = [
            linprog(np.zeros(len(rays)), A_eq=rays.T, b_eq=w, bounds=(0, None), method="highs")
            for w in wrenches[:1]
        ]
        return all(a.status == 0 for a in answers)

    def least_squares(contacts: Any) -> bool:
        rays = wrench_rays(contacts.points, contacts.normals, friction, length)
        return max([nnls(rays.T, w)[1] for w in wrenches]) < 1e-7

    test(grasps[0]), indices(grasps[0])
    alone, found = thread_times(test, grasps)
    four, _ = thread_times(indices, grasps[:2000])
    points = np.array([g.points for g in grasps])
    normals = np.array([g.normals for g in grasps])

    def together(_: int) -> Any:
        rays = wrench_rays(points, normals, friction, length)
        return margins(rays, wrenches)

    many, both = thread_times(together, [0, 1, 2])
    lp, _ = thread_times(programme, grasps[:LPS])
    squares, answers = thread_times(least_squares, grasps[:2000])
    agree = sum((f >= -HELD) == a for f, a in zip(found, answers, strict=False))
    print(f"  margin of a task of {SAMPLES} wrenches   {quantiles(alone)}")
    print(f"  many at once, each                 {quantiles(many / GRASPS)}")
    print(f"  four indices                       {quantiles(four)}")
    print(f"  LP (HiGHS), one wrench of them     {quantiles(lp)}")
    print(f"  NNLS, all wrenches                 {quantiles(squares)}   {agree} of 2000 agree")
    assert np.array_equal(both[0], np.array(found))
    each = float(np.median(alone))
    return {
        "margin_s": each,
        "many_s": float(np.median(many)) / GRASPS,
        "indices_s": float(np.median(four)),
        "lp_s": float(np.median(lp)),
        "nnls_s": float(np.median(squares)),
        "bounds": {
            "margin, median [ms]": at_most(1e3 * each, 0.1),
            "four indices, median [ms]": at_most(1e3 * float(np.median(four)), 0.1),
            "one LP / the margin of the whole task": at_least(float(np.median(lp)) / each, 10.0),
            "NNLS of all wrenches / margin": at_least(float(np.median(squares)) / each, 3.0),
            "agree with NNLS": at_least(agree / 2000.0, 1.0),
        },
    }
