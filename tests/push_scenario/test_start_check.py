"""FAULTS 26: start poses in walls, in each other or outside are refused, with the names."""

import math
from itertools import combinations

import numpy as np
import pytest
from PIL import Image

from push_model import SettingsError, se2
from push_model.occupancy import MapSpec, OccupancyGrid
from push_model.outlines import distance, inside
from push_model.specs import EnvironmentSpec, ObjectSpec
from push_scenario.room import Room, object_footprint
from push_scenario.scenario import scenario_from_mapping

WALLS = {
    "size": [3.0, 2.0],
    "boxes": [{"centre": [0.5, 0.5], "size": [0.4, 0.2], "yaw": 0.6}],
    "circles": [{"centre": [-0.6, 0.4], "radius": 0.2}],
    "polygons": [{"vertices": [[0.2, -0.6], [0.6, -0.6], [0.4, -0.3]]}],
}


def scenario(robots, objects=None, environment=WALLS, **keys):
    values = {
        "environment": environment,
        "robots": {n: {"type": "epuck", "start": p} for n, p in robots.items()},
        "objects": {n: {"type": "box9", "start": p} for n, p in (objects or {}).items()},
        **keys,
    }
    return scenario_from_mapping(values, "s", "s.yaml")


@pytest.mark.parametrize(
    ("robots", "objects", "words"),
    [
        ({"a": [0.5, 0.5, 0]}, {}, ["robot 'a' starts in box 0, at (0.5, 0.5)"]),
        ({"a": [-0.6, 0.62, 0]}, {}, ["robot 'a' starts in circle 0"]),
        ({"a": [0.4, -0.5, 0]}, {}, ["robot 'a' starts in polygon 0"]),
        ({"a": [9, 0, 0]}, {}, ["robot 'a' starts outside the arena"]),
        ({"a": [1.48, 0, 0]}, {}, ["robot 'a' starts in the arena's wall"]),
        ({"a": [0, 0, 0]}, {"x": [0.07, 0, 0]}, ["robot 'a' starts in object 'x'"]),
        ({"a": [0, 0, 0], "b": [0.05, 0.02, 1]}, {}, ["robot 'a' starts in robot 'b'"]),
        (
            {"a": [0, 0, 0]},
            {"x": [1, 0, 0], "y": [1, 0.08, 0]},
            ["object 'x' starts in object 'y'"],
        ),
        (
            {"a": [0.5, 0.5, 0], "b": [0, -3, 0]},
            {"x": [-1, 0, 0], "y": [-1, 0, 0]},
            ["'a' starts in box 0", "'b' starts outside", "'x' starts in object 'y'"],
        ),
    ],
)
def test_bodies_that_cannot_stand_there_are_named(robots, objects, words):
    with pytest.raises(SettingsError) as error:
        scenario(robots, objects)
    assert len(str(error.value).splitlines()) == len(words)
    for word in words:
        assert word in str(error.value)


def test_touching_is_allowed():
    scenario({"a": [0, 0, 0]}, {"x": [0.095, 0, 0], "y": [0.185, 0, 0]})  # face on face
    scenario({"a": [1.4, 0, math.pi / 2]}, {"x": [1.455, 0.3, 0]})  # along the wall


@pytest.mark.parametrize(
    ("goal", "words"),
    [
        ([0.5, 0.5, 0], "object 'x' at the goal is in box 0"),
        ([2.0, 0.5, 0], "object 'x' at the goal is outside the arena"),
        ([1.47, 0.5, 0], "object 'x' at the goal is in the arena's wall"),
    ],
)
def test_goals_in_walls_and_outside_are_refused(goal, words):
    bodies = {"robots": {"a": [-1, -0.5, 0]}, "objects": {"x": [-0.5, -0.5, 0]}}
    with pytest.raises(SettingsError, match=words):
        scenario(**bodies, goal=goal)
    with pytest.raises(SettingsError, match="at the goal 2 is"):
        scenario(**bodies, goals=[[1, 0, 0], goal])
    with pytest.raises(SettingsError, match="at the pose of the trajectory 2 is"):
        scenario(**bodies, trajectory=[{"at": 0, "pose": [0, 0, 0]}, {"at": 1, "pose": goal}])
    with pytest.raises(SettingsError, match=words.replace("the goal", "the goal of team 't'")):
        scenario(**bodies, teams={"t": {"robots": ["a"], "goal": goal}})
    with pytest.raises(SettingsError, match="the goal is outside"):
        scenario({"a": [0, 0, 0]}, goal=[5, 5, 0])
    scenario({"a": [0, 0, 0]}, {"x": [-0.5, -0.5, 0]}, goal=[-0.5, 0, 0])


def test_map_cells_are_walls_exactly(tmp_path):
    """A cell that a body covers by a hair more than touching is enough; one beside it is not."""
    pixels = np.full((100, 100), 254, dtype=np.uint8)
    pixels[50, 50] = 0  # the cell from (0, -0.01) to (0.01, 0)
    pixels[20, 20] = 205
    Image.fromarray(pixels).save(tmp_path / "m.png")
    room = {"image": str(tmp_path / "m.png"), "resolution": 0.01, "origin": [-0.5, -0.5, 0]}

    def starts(**pose):
        values = {
            "environment": room,
            "robots": {"a": {"type": "epuck_ring", "start": [*pose.get("a", (0.3, 0.3)), 0]}},
            "objects": {"x": {"type": "box9", "start": [*pose.get("x", (0.3, -0.3)), 0]}},
        }
        return scenario_from_mapping(values, "s", "s.yaml")

    starts(x=(-0.045, 0), a=(0.06, -0.005))
    with pytest.raises(SettingsError, match="object 'x' starts in an occupied or unknown cell"):
        starts(x=(-0.0445, 0))
    with pytest.raises(SettingsError, match="robot 'a' starts in an occupied or unknown cell"):
        starts(a=(0.0595, -0.005))
    with pytest.raises(SettingsError, match="'x' starts in an occupied or unknown"):
        starts(x=(-0.3, 0.3))  # the unknown cell lies wholly within
    with pytest.raises(SettingsError, match="'a' starts in the arena's wall"):
        starts(a=(0.47, 0.3))


def test_random_objects_overlap_when_a_fine_raster_says_so():
    """300 pairs of concave and convex outlines against points spread densely over both."""
    random = np.random.default_rng(11)
    shapes = [
        {"polygon": {"vertices": [[0, 0], [0.3, 0], [0.3, 0.1], [0.1, 0.1], [0.1, 0.3], [0, 0.3]]}},
        {"rectangle": {"length": 0.3, "width": 0.1}},
        {"flower": {"radius": 0.15, "amplitude": 0.06, "petals": 5}},
    ]
    specs = [ObjectSpec(s, 1.0, 0.1, 0.3, 0.2) for s in shapes]
    counts = {True: 0, False: 0}
    for _ in range(300):
        i, j = random.integers(0, 3, 2)
        a, b = (
            object_footprint("", specs[k], random.uniform([-0.2, -0.2, -3], [0.2, 0.2, 3]))
            for k in (i, j)
        )
        low, high = a.outline.min(axis=0), a.outline.max(axis=0)
        grid = np.stack(np.meshgrid(*np.linspace(low, high, 30).T), axis=-1).reshape(-1, 2)
        both = grid[inside(a.outline, grid) & inside(b.outline, grid)]
        met = a.meets(b)
        if len(both):
            deep = np.minimum(distance(a.outline, both), distance(b.outline, both)).max() > 1e-3
            assert met or not deep
        else:  # no grid point in both: at most a sliver, with the two lines close
            lines = min(distance(a.outline, b.outline).min(), distance(b.outline, a.outline).min())
            assert not met or lines < 0.02
        counts[met] += 1
    assert min(counts.values()) > 50


def test_clearance_is_never_more_than_the_way_to_a_wall(tmp_path):
    random = np.random.default_rng(2)
    spec = EnvironmentSpec((3.0, 2.0), boxes=(), circles=(), polygons=())
    assert Room(spec).clearance(np.array([[0.0, 0.0], [1.4, 0.0], [2, 0]])) == pytest.approx(
        [1.0, 0.1, 0.0]
    )
    room = Room(scenario({"a": [0, 0, 0]}).environment)
    points = random.uniform([-1.5, -1], [1.5, 1], (300, 2))
    clear = room.clearance(points)
    probe = ObjectSpec({"rectangle": {"length": 2e-4, "width": 2e-4}}, 1.0, 0.1, 0.3, 0.2)
    for point, free in zip(points, clear, strict=True):
        angle = random.uniform(-math.pi, math.pi, 5)
        for a in angle:
            at = point + 0.999 * max(free - 2e-4, 0.0) * np.array([math.cos(a), math.sin(a)])
            if free > 1e-3:
                assert room.trouble(object_footprint("", probe, se2.pose(*at, 0.0))) is None


def test_clearance_on_a_map_is_that_of_its_cells():
    """Never more than the exact distance, and less by a quarter of a cell at most."""
    random, size = np.random.default_rng(5), 0.05
    occupied = random.random((40, 60)) < 0.03
    grid = OccupancyGrid(occupied, size, np.array([-1.5, -1.0]))
    points = random.uniform([-1.5, -1.0], [1.5, 1.0], (500, 2))
    corners = np.argwhere(occupied)[:, ::-1] * size + grid.origin
    nearest = np.clip(points[:, None], corners, corners + size)
    exact = np.hypot(*(points[:, None] - nearest).transpose(2, 0, 1)).min(axis=1)
    edges = np.minimum(points + [1.5, 1.0], [1.5, 1.0] - points).min(axis=1)
    lost = np.minimum(exact, edges) - Room(MapSpec(grid, 0.1, 0.3)).clearance(points)
    assert lost.min() > -1e-6 and lost.max() < 0.25 * size


def test_a_thousand_discs_are_checked_pair_by_pair():
    """Every overlap that all pairs show is named, and no other."""
    random = np.random.default_rng(4)
    centres = random.uniform(-4.5, 4.5, (1000, 2))
    values = {
        "environment": {"size": [10, 10], "resolution": 0.05},
        "robots": {
            f"d{i}": {"type": "disc", "start": [*c, 0.0]} for i, c in enumerate(centres.tolist())
        },
        "objects": {"o": {"type": "swarm_square", "start": [0, 0, 0.3]}},
    }
    with pytest.raises(SettingsError) as error:
        scenario_from_mapping(values, "s", "s.yaml")
    said = {
        tuple(part.split("'")[i] for i in (1, 3))
        for part in str(error.value).splitlines()
        if "in robot" in part
    }
    apart = np.hypot(*(centres[:, None] - centres[None]).transpose(2, 0, 1))
    expected = {
        (f"d{i}", f"d{j}") for i, j in combinations(range(1000), 2) if apart[i, j] < 0.1 - 1e-4
    }
    assert said == expected and len(said) > 50
    assert "in object 'o'" in str(error.value)
