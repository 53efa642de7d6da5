"""Whether there is a way, how wide it is, and that the guide takes it."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import label

from push_model.distance_field import DistanceField
from push_model.occupancy import OccupancyGrid, rasterise
from push_model.shapes import polygon, rectangle
from push_model.specs import BoxSpec, EnvironmentSpec
from push_model.widest_way import widest_clearance
from push_planner import PlanError, PlannerSettings, PlanningFailed, PushPlanner
from push_planner.guide_path import (
    NoGuidePath,
    guide_paths,
    lattice_path,
    origin_floor,
    path_cost,
    relieved_ends,
)
from tests.push_planner.exact_geometry import points_distance, random_world

QUICK = replace(PlannerSettings(), rrt_iterations=100, clearance_levels=2)
WIDTH, MARGIN, CELL = 0.09, QUICK.safety_distance, 0.01
NO_ENDS = np.zeros((0, 4))


def along(points, spacing=0.002):
    """Points of a path, close together."""
    pieces = [
        a + np.linspace(0.0, 1.0, 2 + int(np.hypot(*(b - a)) / spacing))[:, None] * (b - a)
        for a, b in zip(points[:-1], points[1:], strict=True)
    ]
    return np.vstack(pieces)


def wall_with_gap(x, thick, middle, width, yaw=0.0):
    """A wall across the arena and beyond, turned about (x, middle), where its gap is."""
    c, s = np.cos(yaw), np.sin(yaw)
    off = width / 2.0 + 1.5
    return tuple(
        BoxSpec((x - s * side, middle + c * side), (thick, 3.0), yaw) for side in (-off, off)
    )


def guides_or_refusal(planner, start, goal):
    try:
        return list(planner._guides(start, goal, 1)), None
    except PlanningFailed as refusal:
        return [], refusal


@pytest.mark.long
@pytest.mark.parametrize(("tilt", "allowance"), [(0.0, 2.0 * CELL), (0.35, 2.0 * 2**0.5 * CELL)])
def test_gaps_of_any_width_are_decided_right(robot, box, tilt, allowance):
    """120 walls, one gap each at a random place. The map may take off a cell on either side, or a
    cell's diagonal where the wall is oblique."""
    random = np.random.default_rng(1)
    found = refused = 0
    for _ in range(60):
        width = random.uniform(0.05, 0.2) if random.random() < 0.5 else random.uniform(0.09, 0.3)
        x, middle = random.uniform(-0.3, 0.3), random.uniform(-0.8, 0.8)
        world = EnvironmentSpec(
            (3.0, 2.0),
            wall_with_gap(x, random.uniform(0.02, 0.3), middle, width, random.uniform(-tilt, tilt)),
            resolution=CELL,
        )
        planner = PushPlanner(QUICK, rasterise(world), robot, box)
        start = np.array([-1.2, random.uniform(-0.8, 0.8), 0.0])
        goal = np.array([1.2, random.uniform(-0.8, 0.8), 0.0])
        guides, refusal = guides_or_refusal(planner, start, goal)
        if refusal is not None:
            assert refusal.code is PlanError.NO_GUIDE_PATH
            assert width < WIDTH + 2.0 * MARGIN + allowance
            wide, needed = map(float, re.findall(r"(\d\.\d{3}) m", str(refusal)))
            assert needed == pytest.approx(WIDTH + 2.0 * MARGIN, abs=6e-4)
            assert width - allowance - 6e-4 < wide < width + 6e-4
            assert wide < needed
            refused += 1
            continue
        assert width > WIDTH + 2.0 * MARGIN - CELL and guides
        for guide in guides:
            exact = points_distance(world, along(guide.points))
            assert exact.min() >= guide.clearance - 1e-9
            assert guide.clearance >= WIDTH / 2.0 + MARGIN - 0.004
            assert np.array_equal(guide.points[[0, -1]], [start[:2], goal[:2]])
        found += 1
    assert found > 20 and refused > 12


def test_a_gap_with_just_the_margins_on_both_sides_is_used_to_the_millimetre(robot, box):
    """On cells of a millimetre the map takes nothing off."""
    for width, wanted in ((0.115, True), (0.110, False)):
        grid = OccupancyGrid(np.zeros((500, 600), dtype=bool), 0.001, np.array([-0.3, -0.25]))
        grid.occupied[:, 280:320] = True
        grid.occupied[200 : 200 + round(1000 * width), 280:320] = False
        planner = PushPlanner(QUICK, grid, robot, box)
        ends = np.array([-0.18, 0.1, 0.0]), np.array([0.18, -0.1, 0.0])
        if wanted:
            assert list(planner._guides(*ends, 1))
        else:
            with pytest.raises(PlanningFailed, match=r"is 0\.110 m wide .* needs 0\.114 m"):
                list(planner._guides(*ends, 1))


def test_the_widest_way_against_every_threshold():
    """Connected parts at every value that the field has: the same bottleneck, 150 worlds."""
    random = np.random.default_rng(2)
    parted = 0
    for number in range(150):
        world = random_world(random, 4 + number % 12, 0.04, size=(1.6, 1.2), largest=0.6)
        field = DistanceField(rasterise(world))
        free = np.argwhere(field.values > 0.0)
        (i, j), (k, m) = free[random.integers(len(free), size=2)]
        ends = np.array([j, i], dtype=float), np.array([m, k], dtype=float)
        widest = widest_clearance(field.values, *ends, NO_ENDS, 1.0, 1e3)
        best = 0.0
        for level in np.unique(field.values[field.values > 0.0]):
            parts, _ = label(field.values >= level, np.ones((3, 3)))
            # a pose lies among four points of the lattice, from each of which a way may begin
            first, last = (set(parts[a : a + 2, b : b + 2].flat) for a, b in ((i, j), (k, m)))
            if first & last - {0}:
                best = float(level) ** 0.5
        assert widest == pytest.approx(best, abs=1e-12)
        parted += widest == 0.0
        path = None
        if widest > 0.0:
            tips = [e * field.spacing + field.args[:2] for e in ends]
            path = lattice_path(field, *tips, 0.99 * widest * field.spacing)
        assert (path is None) == (widest == 0.0)
    assert parted > 5


def test_obstacles_that_part_start_and_goal(robot, box):
    world = EnvironmentSpec((3.0, 2.0), boxes=(BoxSpec((0.0, 0.0), (0.1, 2.0)),))
    planner = PushPlanner(QUICK, rasterise(world), robot, box)
    with pytest.raises(PlanningFailed, match="no way connects them") as error:
        planner.solve(np.array([-1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0]))
    assert error.value.code is PlanError.NO_GUIDE_PATH


def test_a_start_or_goal_beside_a_wall_narrows_the_way_there_only(robot, box):
    """Flush with a wall the origin has 46 mm. The rest of the way keeps the margin."""
    random = np.random.default_rng(3)
    for _ in range(60):
        middle = random.uniform(-0.6, 0.6)
        world = EnvironmentSpec((3.0, 2.0), wall_with_gap(0.0, 0.1, middle, 0.16), resolution=CELL)
        planner = PushPlanner(QUICK, rasterise(world), robot, box)
        start = np.array([random.uniform(-1.3, -0.3), -0.954, 0.0])
        goal = np.array([1.454, random.uniform(-0.8, 0.8), 0.0])
        guides = list(planner._guides(start, goal, 1))
        assert guides
        for guide in guides:
            spots = along(guide.points)
            exact = points_distance(world, spots)
            inner = np.minimum(*(np.hypot(*(spots - p[:2]).T) for p in (start, goal))) > 0.05
            assert exact[inner].min() >= WIDTH / 2.0 + MARGIN - 0.004
            assert exact.min() >= WIDTH / 2.0
            assert guide.clearance >= WIDTH / 2.0 + MARGIN - 0.004


@pytest.mark.parametrize(("weight", "offered"), [(0.05, True), (0.3, False)])
def test_a_short_narrow_way_is_offered_where_2_1_prefers_it(robot, box, weight, offered):
    """A gap of 0.13 m straight ahead, one of 0.3 m that takes another metre."""
    boxes = (BoxSpec((0.0, -0.5325), (0.1, 0.935)), BoxSpec((0.0, 0.3825), (0.1, 0.635)))
    grid = rasterise(EnvironmentSpec((3.0, 2.0), boxes, resolution=0.005))
    planner = PushPlanner(replace(QUICK, clearance_weight=weight), grid, robot, box)
    guides = list(planner._guides(np.array([-0.5, 0.0, 0.0]), np.array([0.5, 0.0, 0.0]), 1))
    wide = [g for g in guides if g.clearance > 0.075]
    narrow = [g for g in guides if g.clearance <= 0.065]
    assert wide and min(g.length for g in wide) > 1.6
    assert bool(narrow) == offered
    if offered:
        assert min(g.cost for g in narrow) < min(g.cost for g in wide)
        assert min(g.length for g in narrow) < 1.05 and narrow[0].clearance > 0.056


def test_guides_are_equal_for_equal_seeds(scenario, robot, box):
    planner = PushPlanner(PlannerSettings(), scenario.grid, robot, box)
    start, goal = np.array([-1.15, -0.7, 0.0]), np.array([1.3, 0.75, 0.0])
    first, again = (list(planner._guides(start, goal, 7)) for _ in range(2))
    assert [g.cost for g in first] == [g.cost for g in again]
    assert all(np.array_equal(a.points, b.points) for a, b in zip(first, again, strict=True))


def test_the_distance_that_an_origin_keeps():
    assert origin_floor(rectangle(0.2, 0.06)) == pytest.approx(0.03)
    corner = polygon(np.array([[0, 0], [0.1, 0], [0.1, 0.01], [0.01, 0.01], [0.01, 0.1], [0, 0.1]]))
    assert origin_floor(corner) == 0.0


def test_clearance_of_a_path_without_its_relieved_ends():
    field = DistanceField(rasterise(EnvironmentSpec((3.0, 2.0))))
    start, goal = np.array([-1.45, 0.0]), np.array([1.0, 0.0])
    ends = relieved_ends(field, start, goal, 0.2, 0.04)
    assert ends[1, 3] == 0.0
    assert ends[0, 2] * field.spacing == pytest.approx(0.15, abs=0.02)
    points = np.array([start, goal])
    assert path_cost(field, points, QUICK).clearance == pytest.approx(0.05, abs=1e-3)
    assert 0.2 - 1e-9 <= path_cost(field, points, QUICK, ends).clearance < 0.22


def test_no_guide_path_tells_the_width():
    world = EnvironmentSpec((3.0, 2.0), wall_with_gap(0.0, 0.1, 0.0, 0.1))
    field = DistanceField(rasterise(world))
    with pytest.raises(NoGuidePath) as error:
        next(guide_paths(field, np.array([-1.0, 0.0]), np.array([1.0, 0.0]), 0.06, QUICK, 1))
    assert error.value.widest == pytest.approx(0.05)
