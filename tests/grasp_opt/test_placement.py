"""Placements: the forces' problem against an exact solver, the search against exhaustive grids."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from grasp_opt.object_trajectory import polynomial, screw, study_trajectories
from grasp_opt.placement import NoPlacement, PlacementSettings, Placer
from grasp_opt.placement_bound import PlacementBound
from grasp_opt.placement_nlp import LocalPlacer
from grasp_opt.robust_placement import robust_placement
from grasp_opt.wrench_cone import HELD
from push_model.shape_specs import RectangleShape
from push_scenario.bodies import load_object
from tests.samples import mostly_long

SIX = study_trajectories()
FEW = PlacementSettings(steps=12)
PACES = 0.05, 0.05, 0.2  # [m/s], [m/s^2], [m]: speed, acceleration and reach of a screw


def plates():
    ellipse = load_object("plate_ellipse")
    return {
        "ellipse": ellipse,
        "rectangle": replace(ellipse, shape=RectangleShape(0.4, 0.3)),
        "hexagon": load_object("plate_hexagon"),
        "triangle": load_object("plate_triangle"),
    }


def exact(placer, way):
    """The least cost with these places, by an active-set method on the condensed problem."""
    placer.cost(way)
    C, N, m = placer._columns, len(placer.steps), 2 * placer.count
    A, b = np.zeros((3 * N + m * N, m * N)), np.zeros(3 * N + m * N)
    root = np.sqrt(placer.weights)
    for k in range(N):
        for j in range(k + 1):
            c, s, pace = placer.turn[j]
            turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, pace]])
            A[3 * k : 3 * k + 3, m * j : m * j + m] = root[:, None] * (turn @ C)
        b[3 * k : 3 * k + 3] = root * placer.steps[: k + 1].sum(axis=0)
    A[3 * N :] = math.sqrt(placer.force_weight) * np.eye(m * N)
    return float(lsq_linear(A, b, (0.0, np.inf), method="bvls", tol=1e-14, max_iter=9999).cost)


@pytest.mark.parametrize("model", ["limit_surface", "printed"])
def test_costs_of_random_placements_are_exact(model):
    random = np.random.default_rng(4)
    shapes, tasks = list(plates().values()), list(SIX.values())
    for _ in range(25):
        count = int(random.integers(1, 4))
        item, task = shapes[random.integers(4)], tasks[random.integers(6)]
        placer = Placer(item, task, count, 0.05, replace(FEW, model=model))
        grid = placer.grid(24)
        way = grid[random.integers(len(grid))]
        found = placer.cost(way)
        assert found == pytest.approx(exact(placer, way), rel=1e-6)
        placement = placer.placement(way)
        assert placement.cost == pytest.approx(found, rel=1e-9)
        # the forces are within their cones, and make the errors that are told
        for force, normal in zip(placement.forces[5], placement.contacts.normals, strict=True):
            across = normal[0] * force[1] - normal[1] * force[0]
            assert abs(across) <= item.contact_friction * float(force @ normal) + 1e-6
        errors = 0.5 * (placer.weights * placement.errors**2).sum()
        forces = placement.forces / placer.force_scale
        assert errors <= found * (1 + 1e-6) and (forces**2).sum() > 0.0


@pytest.mark.parametrize("name", mostly_long(plates(), 2))
@pytest.mark.parametrize("count", [2, 3])
def test_no_placement_of_a_finer_grid_is_better(name, count):
    item = plates()[name]
    for task in (SIX["polynomial-2"], SIX["sinusoid-3"]):
        placer = Placer(item, task, count, 0.05, FEW)
        best = placer.best()
        grid = placer.grid({2: 90, 3: 36}[count])
        costs = [placer.cost(way, 1e-4) for way in grid]
        assert len(grid) > 400 and best.cost <= min(costs) * 1.001
        assert placer.allowed(best.way[None]).all()
        assert placer.outline.from_corner(best.way).min() >= FEW.corner


def test_robots_keep_apart_and_a_side_holds_as_many_as_fit():
    """Three on a side of 0.4 m with corners of 15 mm: only side by side."""
    item = plates()["rectangle"]
    straight = polynomial((0.0,), 0.8, 0.1, 0.1)
    placer = Placer(item, straight, 3, 0.05, FEW)
    best = placer.best()
    centres = best.contacts.centres(0.05)
    gaps = [np.hypot(*(centres[i] - centres[j])) for i in range(3) for j in range(i)]
    assert min(gaps) >= 0.105 - 1e-6
    assert (best.contacts.normals[:, 0] > 0.99).all()  # all on the one side that pushes ahead
    forces = np.linalg.norm(best.forces[2:-2], axis=2)
    assert forces.std() < 0.02 * forces.mean() and best.margin > 0.1
    assert forces.sum(axis=1).mean() == pytest.approx(item.limit_surface().max_force, rel=0.02)


def test_what_does_not_fit_is_said_so():
    item = load_object("box9")
    with pytest.raises(NoPlacement, match="5 robots of 50 mm find no room"):
        Placer(item, SIX["polynomial-1"], 5, 0.05, FEW).best()
    with pytest.raises(ValueError, match="1 to 5 robots"):
        Placer(item, SIX["polynomial-1"], 6, 0.05, FEW)


@pytest.mark.parametrize("count", [4, 5])
def test_more_robots_share_the_load(count):
    item = load_object("plate_ellipse")
    few, many = (Placer(item, SIX["polynomial-1"], n, 0.05, FEW).best() for n in (2, count))
    assert many.cost < few.cost and many.way.shape == (count,)
    most = [np.linalg.norm(p.forces, axis=2).max() for p in (few, many)]
    assert most[1] < most[0]


def test_the_thesis_programme_by_ipopt_ends_where_the_search_does_on_an_ellipse():
    """An independent solver with an independent model of outline and forces."""
    item = load_object("plate_ellipse")
    for task in ("polynomial-1", "sinusoid-2"):
        placer = Placer(item, SIX[task], 2, 0.05, FEW)
        best = placer.best()
        start = placer.outline.way_of_angle(math.pi + np.array([-0.4, 0.4]))
        answer = LocalPlacer(placer).solve(start)
        assert answer.solved and answer.objective == pytest.approx(
            placer.cost(answer.way), rel=5e-3
        )
        assert best.cost <= answer.objective * 1.005
        assert np.sort(answer.way) == pytest.approx(best.way, abs=5e-3)


def test_a_robust_placement_has_margin_pushes_only_and_asks_no_robot_for_too_much():
    """Where the cheapest one has hardly any margin, or a robot ahead of the object."""
    item, task = load_object("plate_ellipse"), SIX["polynomial-3"]
    cheapest = Placer(item, task, 3, 0.05, FEW).best()
    robust = robust_placement(item, task, 3, 0.05, 1.4, FEW)
    assert cheapest.margin < 0.05 and robust.margin >= 0.1 and robust.cost >= cheapest.cost
    assert np.linalg.norm(robust.forces, axis=2).max() <= 1.4 * 1.001
    contacts = robust.contacts
    for vx, vy, omega in task.body_twists[1:-1]:
        x, y = contacts.points.T
        speeds = np.column_stack([vx - omega * y, vy + omega * x])
        assert ((speeds * contacts.normals).sum(axis=1) > 0.0).all()
    free = Placer(item, task, 3, 0.05, replace(FEW, least_margin=0.2)).best()
    assert free.cost <= robust.cost * (1 + 1e-6)
    with pytest.raises(
        NoPlacement, match=r"supports the task with a margin of 0 and 0\.5 N a robot"
    ):
        robust_placement(item, task, 2, 0.05, 0.5, FEW)


def test_what_the_screen_leaves_out_does_not_hold_the_task():
    """Costs are computed only of what pushes and has the margin."""
    random, kept, all_of_them = np.random.default_rng(7), 0, 0
    shapes = list(plates().values())
    for _ in range(40):
        count, least = int(random.integers(2, 6)), float(random.choice([0.0, 0.05, 0.1]))
        asked = replace(FEW, least_margin=least, only_pushing=True, most_force=1.0)
        item = shapes[random.integers(4)]
        task = screw(np.zeros(3), np.array([0.3, *random.normal(size=2) * [0.05, 0.2]]), *PACES)
        placer = Placer(item, task, count, 0.05, asked)
        ways = placer.grid(20)
        ways = ways[random.choice(len(ways), min(60, len(ways)), replace=False)]
        screened = {tuple(way) for way in placer._screened(ways)}
        for way in ways:
            enough = placer.margin(placer.outline.at(way)) >= least - HELD
            assert (tuple(way) in screened) == (enough and placer.pushes(way))
            assert tuple(way) in screened or not placer.holds(way)
        kept, all_of_them = kept + len(screened), all_of_them + len(ways)
    assert 0.02 < kept / all_of_them < 0.6


@pytest.mark.long
def test_a_greater_margin_is_asked_for_where_there_is_one():
    """Else half of it, or what there is."""
    item, reached = load_object("plate_ellipse"), []
    for task in list(SIX.values())[:4]:
        usual = robust_placement(item, task, 3, 0.05, 5.0, FEW)
        wide = robust_placement(item, task, 3, 0.05, 5.0, FEW, margin=0.25)
        assert wide.margin >= usual.margin - 1e-9 and wide.cost >= usual.cost * (1 - 1e-6)
        reached.append(wide.margin >= 0.125 - 1e-9)
    assert all(reached)
    none = robust_placement(item, SIX["polynomial-3"], 3, 0.05, 5.0, FEW, margin=0.0)
    assert none.margin < 0.1


@pytest.mark.parametrize("name", mostly_long(plates(), 2))
@pytest.mark.parametrize("count", [2, 3])
def test_no_placement_costs_less_than_the_lower_bound(name, count):
    """Random placements and the best known one, by an exact solver; boxes large and small."""
    placer = Placer(plates()[name], SIX["sinusoid-3"], count, 0.05, FEW)
    best, judge, random = placer.best(), PlacementBound(placer), np.random.default_rng(5)
    grid = placer.grid({2: 60, 3: 24}[count])
    some = [best.way, *grid[random.integers(len(grid), size=4)]]
    lowers = [judge.lower(0.01, best.cost, boxes).lower for boxes in (0, 600)]
    assert 0.0 <= lowers[0] <= min(exact(placer, way) for way in some) * (1 + 1e-6)
    assert lowers[0] <= lowers[1] + 1e-12 <= best.cost * (1 + 1e-6)


@pytest.mark.long
def test_the_best_known_placement_of_two_is_near_the_lower_bound():
    placer = Placer(plates()["ellipse"], SIX["polynomial-2"], 2, 0.05, FEW)
    best = placer.best()
    bound = PlacementBound(placer).lower(0.1, best.cost, 6000)
    assert 0.0 <= bound.gap(best.cost) <= 0.1
