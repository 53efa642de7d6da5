"""The robot's way keeps its distance, but for the ends; on maps of any size."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.ndimage import label

from push_model import se2
from push_model.distance_field import DistanceField
from push_model.occupancy import rasterise
from push_model.shapes import densified
from push_model.specs import BoxSpec, EnvironmentSpec
from push_planner import NoRobotPath, PlannerSettings, RobotPathError, plan_robot_path
from tests.push_planner.exact_geometry import points_distance, random_world

SETTINGS = PlannerSettings()
NONE = np.zeros((0, 3))


def room(world, circles, radius, points):
    """Exact distance of a disc at points from walls and circles."""
    result = points_distance(world, points) - radius
    for x, y, least in circles:
        result = np.minimum(result, np.hypot(points[:, 0] - x, points[:, 1] - y) - least)
    return result


@pytest.mark.long
def test_the_way_keeps_its_distance_away_from_tight_ends(robot):
    """250 worlds, half of the ends tight: beside a wall or a circle."""
    random = np.random.default_rng(1)
    radius, slack = robot.footprint_radius, robot.footprint_radius - robot.body_radius
    found = tight = refused = 0
    for number in range(250):
        world = random_world(random, number % 9, size=(2.0, 1.6))
        field = DistanceField(rasterise(world))
        circles = np.column_stack(
            [random.uniform([-1.0, -0.8], [1.0, 0.8], (number % 4, 2)), np.full(number % 4, 0.13)]
        )
        spots = random.uniform([-0.95, -0.75], [0.95, 0.75], (400, 2))
        spare = room(world, circles, radius, spots)
        wide, close = spots[spare > 0.05], spots[(spare > -0.5 * slack) & (spare < 0.008)]
        if len(wide) < 2 or len(close) < 2:
            continue
        start = (close if number % 2 else wide)[0]
        goal = (close if number % 4 > 1 else wide)[1]
        ends = [np.array([*p, random.uniform(-3, 3)]) for p in (start, goal)]
        try:
            path = plan_robot_path(field, robot, SETTINGS, *ends, circles)
        except NoRobotPath:
            refused += 1
            continue
        found += 1
        assert path.pose[0] == pytest.approx(ends[0], abs=1e-9)
        assert path.pose[-1][:2] == pytest.approx(goal, abs=2e-3)
        kept = room(world, circles, radius, path.pose[:, :2])
        here = room(world, circles, radius, np.array([start, goal]))
        # By the map, which is what the planner knows, it comes no closer than its ends are; but
        # for the way to the next point of the lattice.
        believed = np.array([field.at(*p) for p in path.pose[:, :2]]) - radius
        for x, y, least in circles:
            believed = np.minimum(believed, np.hypot(*(path.pose[:, :2] - (x, y)).T) - least)
        lowest = min(believed[0], believed[-1], SETTINGS.safety_distance)
        assert believed.min() >= lowest - 0.75 * field.spacing - 1e-6
        assert kept.min() >= believed.min() - 1e-9
        gap = np.minimum(*(np.hypot(*(path.pose[:, :2] - p).T) for p in (start, goal)))
        short = kept < SETTINGS.safety_distance - 1e-6
        if short.any():
            tight += 1
            # no farther off than it takes to come away from it, and never without a reason
            assert here.min() < SETTINGS.safety_distance + 1.5 * 0.01
            assert gap[short].max() < 0.15, (number, gap[short].max())
    print(f"found {found} tight {tight} refused {refused}")
    assert found > 120 and tight > 40


@pytest.mark.long
def test_where_an_end_is_tight_the_bumper_keeps_off_as_far_as_any_motion_lets_it(
    robot, monkeypatch
):
    """400 worlds: against the fastest motion, which looks at the disc around the robot only."""
    random = np.random.default_rng(2)
    radius, slack = robot.footprint_radius, robot.footprint_radius - robot.body_radius
    outline = densified(robot.outline, 0.005)

    def kept(field, circles, way):
        """[m] of the outline; by its points, so up to 2.5 mm too much beside a circle."""
        least = field.clearances(outline, way.pose).min()
        for x, y, wanted in circles:
            points = np.concatenate([se2.transform(pose, outline) for pose in way.pose])
            least = min(least, np.hypot(*(points - (x, y)).T).min() - (wanted - radius))
        return least

    chosen, fastest = [], []
    for number in range(400):
        world = random_world(random, number % 9, size=(2.0, 1.6))
        field = DistanceField(rasterise(world))
        circles = np.column_stack(
            [random.uniform([-1.0, -0.8], [1.0, 0.8], (number % 4, 2)), np.full(number % 4, 0.13)]
        )
        spots = random.uniform([-0.95, -0.75], [0.95, 0.75], (400, 2))
        spare = room(world, circles, radius, spots)
        tight = spots[(spare > -0.5 * slack) & (spare < 0.008)]
        if len(tight) < 2:
            continue
        ends = [np.array([*spot, random.uniform(-3, 3)]) for spot in tight[:2]]
        if min(field.clearance(outline, end) for end in ends) <= 0.003:
            continue
        try:
            way = plan_robot_path(field, robot, SETTINGS, *ends, circles)
        except NoRobotPath:
            continue
        with monkeypatch.context() as patch:
            patch.setattr("push_planner.robot_path._outline_room", lambda *_: None)
            blind = plan_robot_path(field, robot, SETTINGS, *ends, circles)
        chosen.append(min(kept(field, circles, way), SETTINGS.safety_distance))
        fastest.append(min(kept(field, circles, blind), SETTINGS.safety_distance))
    chosen, fastest = np.array(chosen), np.array(fastest)
    print(f"{len(chosen)}: {(chosen < 3e-3).sum()} below 3 mm, fastest {(fastest < 3e-3).sum()}")
    assert len(chosen) > 120
    assert (chosen > fastest - 5e-3).all()
    assert (chosen < 3e-3).sum() < 0.85 * (fastest < 3e-3).sum()


def test_no_detour_and_none_through_a_robot(robot):
    """Another robot in the only passage closes it; beside the passage it does not."""
    boxes = (BoxSpec((0.0, 0.59), (0.1, 0.82)), BoxSpec((0.0, -0.59), (0.1, 0.82)))
    field = DistanceField(rasterise(EnvironmentSpec((3.0, 2.0), boxes)))
    start, goal = np.array([-0.6, 0.0, 0.0]), np.array([0.6, 0.0, 0.0])
    free = plan_robot_path(field, robot, SETTINGS, start, goal, NONE)
    assert np.hypot(*np.diff(free.pose[:, :2], axis=0).T).sum() == pytest.approx(1.2, abs=1e-3)
    aside = np.array([[0.0, 0.16, 0.125], [0.3, 0.5, 0.13]])
    path = plan_robot_path(field, robot, SETTINGS, start, goal, aside)
    gaps = np.hypot(*(path.pose[:, None, :2] - aside[:, :2]).transpose(2, 0, 1)) - aside[:, 2]
    assert gaps.min() >= SETTINGS.safety_distance - 1e-6
    with pytest.raises(NoRobotPath) as error:
        plan_robot_path(field, robot, SETTINGS, start, goal, np.array([[0.0, 0.0, 0.125]]))
    assert error.value.code == RobotPathError.NO_PATH


@pytest.mark.parametrize(
    ("start", "goal", "code"),
    [
        ([-1.47, 0.0, 0.0], [0.0, 0.0, 0.0], RobotPathError.START_BLOCKED),
        ([0.0, 0.0, 0.0], [0.0, -0.98, 0.0], RobotPathError.GOAL_BLOCKED),
        ([0.0, 0.0, 0.0], [7.0, 0.0, 0.0], RobotPathError.GOAL_BLOCKED),
    ],
)
def test_ends_in_a_wall_are_refused(robot, start, goal, code):
    field = DistanceField(rasterise(EnvironmentSpec((3.0, 2.0))))
    with pytest.raises(NoRobotPath) as error:
        plan_robot_path(field, robot, SETTINGS, np.array(start), np.array(goal), NONE)
    assert error.value.code == code


def test_ways_are_found_where_the_flood_of_all_places_says_so(robot):
    """Against connected parts of the lattice, in narrow worlds of coarse cells."""
    random = np.random.default_rng(4)
    need = robot.footprint_radius + SETTINGS.safety_distance
    yes = no = 0
    for number in range(150):
        r = (0.02, 0.05)[number % 2]
        field = DistanceField(rasterise(random_world(random, 16 + number % 12, r, largest=0.7)))
        for loss, wanted in ((1.0, True), (-1.0, False)):
            # Between points of the lattice a way has a spacing more or less than on them.
            parts, _ = label(field.values >= (need / field.spacing + loss) ** 2, np.ones((3, 3)))
            free = np.argwhere(field.values >= (need / field.spacing + 1.0) ** 2)
            if len(free) < 2:
                continue
            a, b = free[random.integers(len(free), size=2)]
            if (parts[tuple(a)] == parts[tuple(b)]) != wanted:
                continue
            ends = [np.array([*(field.spacing * p[::-1] + field.args[:2]), 0.0]) for p in (a, b)]
            if wanted:
                plan_robot_path(field, robot, SETTINGS, *ends, NONE)
                yes += 1
            else:
                with pytest.raises(NoRobotPath):
                    plan_robot_path(field, robot, SETTINGS, *ends, NONE)
                no += 1
    assert yes > 60 and no > 15


_LARGE = """
import resource, sys, time
import numpy as np
from push_model.occupancy import rasterise
from push_model.specs import BoxSpec, EnvironmentSpec
from push_planner import PlannerSettings, PushPlanner, plan_robot_path
from push_scenario.scenario import load_scenario

scenario = load_scenario("env1-target1")
robot, item = scenario.robot()[1], scenario.object()[1]
settings = PlannerSettings(improvement_rounds=0)
def run(world, start, goal, far):
    started = time.process_time()
    planner = PushPlanner(settings, rasterise(world), robot, item)
    for progress in planner.plan(start, goal):
        if progress.best is not None:
            break
    first = time.process_time() - started
    path = plan_robot_path(planner.scene.field, robot, settings, *far, np.zeros((0, 3)))
    ways = time.process_time() - started - first
    return progress.best, path, first, ways

near = np.array([-1.0, 0.0, 0.0]), np.array([1.0, 0.2, 0.0])
run(EnvironmentSpec((4.0, 4.0)), *near, near)  # what is compiled, loaded
random = np.random.default_rng(1)
boxes = tuple(
    BoxSpec(tuple(p), (1.0 + 4.0 * random.random(), 3.0), random.random())
    for p in random.uniform(-46, 46, (150, 2)) if np.hypot(*p) > 10.0
)
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
world = EnvironmentSpec((100.0, 100.0), boxes, resolution=0.05)
far = np.array([-48.9, -48.9, 0.0]), np.array([48.9, 48.9, 0.0])
best, path, first, ways = run(world, np.array([-3.0, -1.0, 0.0]), np.array([3.0, 2.0, 0.5]), far)
after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
assert len(best.segments) >= 1 and np.hypot(*(path.pose[-1] - far[1])[:2]) < 2e-3
print(f"{(after - before) / 1024:.1f} {first:.3f} {ways:.3f}")
"""


@pytest.mark.long
def test_memory_on_a_map_of_four_million_cells():
    """100 m x 100 m: grid, field, first plan and a robot's way across take under 300 MB."""
    done = subprocess.run(
        [sys.executable, "-c", _LARGE], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    grown, first, ways = map(float, done.stdout.split())
    print(f"{grown} MB, first plan {first} s, robot's way {ways} s of CPU")
    assert grown < 300.0
