"""Robots with a map and their own sensing: what they see, where they believe they are, and how they
lead the object round walls."""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from push_job.method import Arena, Certificate, Refusal, Seen, Task
from push_job.open_room import NoWay, OpenRoomSettings
from push_model import se2
from push_model.belief import Belief
from push_model.free_space import FreeSpace
from push_model.jobs import JobError, JobPhase
from push_model.occupancy import OccupancyGrid, rasterise
from push_model.outlines import distance
from push_model.specs import BoxSpec, EnvironmentSpec
from push_scenario.bodies import load_object, load_robot
from push_study.swarm.maps import MAPS, drawn, load_map
from sim_bridge.planar_world import PlanarWorld
from swarm_push.local_law import LocalLawSettings, _between, seen_centre
from swarm_push.map_guide import MapGuide
from swarm_push.map_route import MapRoute, RouteSettings
from swarm_push.own_pose import OwnPose, OwnPoseSettings
from swarm_push.own_sensing import METHOD, Guides, _discs
from swarm_push.robot_sensor import RobotSensor, RobotSensorSettings
from swarm_push.wall_sides import wall_sides
from swarm_push.walls import Walls
from tests.samples import slice_and_study

SQUARE, ROBOT = load_object("transport_square"), load_robot("epuck_ring")
RADIUS = ROBOT.footprint_radius
EXACT = RobotSensorSettings(distance_error=0.0, least_error=0.0, odometry_error=0.0)
GRIDS = {name: rasterise(load_map(name)) for name in MAPS}
SPACES = {name: FreeSpace(grid) for name, grid in GRIDS.items()}
SIDES = {name: wall_sides(grid) for name, grid in GRIDS.items()}
FAR = np.array([50.0, 50.0, 0.0])


def test_free_space_is_to_the_left_of_every_side_of_a_wall():
    """200 random maps: every step between a free and an occupied cell is on one side."""
    for seed in range(200):
        random = np.random.default_rng(seed)
        occupied = random.random((6, 8)) < 0.4
        grid = OccupancyGrid(occupied, 0.5, np.array([-1.0, 2.0]))
        sides = wall_sides(grid)
        along = sides[:, 1] - sides[:, 0]
        lengths = np.hypot(*along.T)
        solid = np.pad(occupied, 1, constant_values=True)
        steps = (solid[1:] != solid[:-1]).sum() + (solid[:, 1:] != solid[:, :-1]).sum()
        assert lengths.sum() == pytest.approx(0.5 * steps)
        left = np.column_stack([-along[:, 1], along[:, 0]]) / lengths[:, None]
        for start, unit, normal in zip(sides[:, 0], along / lengths[:, None], left, strict=True):
            for sign, expected in ((1.0, False), (-1.0, True)):
                x, y = (start + 0.25 * unit + 0.25 * sign * normal - grid.origin) / 0.5
                assert solid[math.floor(y) + 1, math.floor(x) + 1] == expected


def scene(name, seed, count=10):
    """Pose of the object and of robots at random places of a map."""
    start, _, robots = drawn(name, SQUARE, seed, count, turned=False)
    return SQUARE.mass_pose(start), robots


def test_walls_are_scanned_and_hide_what_is_behind_them():
    """30 scenes of ten robots: points of a scan lie on walls, with nothing before them; robots
    behind a wall and the object behind it are not seen. There is no beacon."""
    outline, hidden = SQUARE.geometry.outline, 0
    for seed in range(30):
        name = list(MAPS)[1 + seed % 3]
        pose, robots = scene(name, seed)
        look = RobotSensor(outline, (3.0, 3.0), EXACT, seed, SIDES[name])
        for robot, reading in zip(robots, look.look(pose, robots, np.ones(2)), strict=True):
            assert np.isnan(reading.target).all()
            walls, seen = (se2.transform(robot, p) for p in (reading.walls, reading.object))
            assert len(walls) > 20 and (SPACES[name].clearance(walls) < 1e-6).all()
            if len(seen):
                assert (distance(se2.transform(pose, outline), seen) < 1e-6).all()
            between = robot[:2] + np.linspace(0.05, 0.95, 8)[:, None, None] * (
                np.concatenate([walls, seen]) - robot[:2]
            )
            assert (SPACES[name].clearance(between.reshape(-1, 2)) > 0.0).all()
            mates = se2.transform(robot, reading.robots)
            for other in robots[:, :2]:
                line = robot[:2] + np.linspace(0.0, 1.0, 60)[:, None] * (other - robot[:2])
                if (SPACES[name].clearance(line) <= 0.0).any():
                    hidden += 1
                    assert np.hypot(*(mates - other).T).min(initial=9.0) > 1e-6
    assert hidden > 50


def route(name, start, target, radius=0.25, **settings):
    radii = radius, RADIUS
    return MapRoute(
        SPACES[name], np.array(start), np.array(target), radii, RouteSettings(**settings)
    )


@pytest.mark.long
def test_routes_lead_to_the_target_and_leave_the_object_room():
    """40 random pairs of places: a disc has its room all along; every robot finds the same."""
    for seed in range(40):
        random, name = np.random.default_rng(seed), list(MAPS)[seed % 4]
        places = random.uniform(-1.2, 1.2, (200, 2))
        start, target = places[SPACES[name].clearance(places) > 0.27][:2]
        radius = float(random.uniform(0.1, 0.25))
        found = route(name, start, target, radius)
        assert np.allclose(found.points[[0, -1]], [start, target])
        assert (SPACES[name].clearance(found.points) > radius - 2e-3).all()
        if seed < 10:
            assert np.array_equal(found.points, route(name, start, target, radius).points)
        assert found.left(start) == pytest.approx(found.length)
        assert found.left(target) == pytest.approx(0.0)
    with pytest.raises(NoWay, match=r"disc of 0\.6 m"):
        route("transport_two_corners", [-1.0, -1.0], [1.0, 1.0], 0.6)


def test_an_object_beside_its_route_is_led_back_to_it():
    straight = route("transport_reference", [-1.0, 0.0], [1.0, 0.0])
    for x, y in np.random.default_rng(1).uniform([-0.8, -0.4], [0.4, 0.4], (100, 2)):
        aim = straight.aim(np.array([x, y]))
        assert aim[0] == pytest.approx(x + 0.4, abs=0.06) and aim[1] == pytest.approx(-y, abs=1e-9)


def test_an_object_is_led_along_its_side_of_a_thin_wall():
    """The route goes round the end of a wall and comes back close behind it. 200 places of an
    object before the wall: also those to which the way behind it is nearer."""
    environment = EnvironmentSpec((4.0, 4.0), (BoxSpec((1.0, -0.5), (0.05, 3.0)),), resolution=0.05)
    space, nearer = FreeSpace(rasterise(environment)), 0
    start, target = np.array([-1.0, -1.5]), np.array([1.5, -1.5])
    found = MapRoute(space, start, target, (0.2, RADIUS), RouteSettings())
    top = int(np.hypot(*(found.points - [1.0, 1.0]).T).argmin())
    for item in np.random.default_rng(1).uniform([0.3, -1.7], [0.75, -0.2], (200, 2)):
        nearer += int(np.hypot(*(found.points - item).T).argmin()) > top
        assert found.place(item) <= top and found.aim(item)[0] < item[0]
        assert found.left(item) > 0.5 * found.length
    assert nearer > 20


@lru_cache
def studied(name):
    """The route of the study of this map."""
    return route(name, *MAPS[name])


def guide(name, pose):
    own = OwnPose(SIDES[name], np.array(pose), 0.0, OwnPoseSettings())
    return MapGuide(SPACES[name], studied(name), own, RADIUS)


def test_robots_have_room_behind_the_object_where_it_is_pushed():
    """300 places: away from walls the way is that of the route; at a wall it is turned."""
    turned = 0
    for seed in range(300):
        random, name = np.random.default_rng(seed), list(MAPS)[seed % 4]
        item = random.uniform(-1.3, 1.3, 2)
        if SPACES[name].clearance(item[None])[0] < 0.15:
            continue
        one = guide(name, [*item, 0.0])
        way = one.target(np.zeros(2))
        plain = studied(name).aim(item) - item
        assert np.hypot(*way) == pytest.approx(np.hypot(*plain))
        unit = way / np.hypot(*way)
        behind = item - unit * (0.25 + RADIUS)
        if np.allclose(way, plain):
            continue
        turned += 1
        assert SPACES[name].clearance(behind[None])[0] >= RADIUS
    assert turned > 20


def test_an_object_at_a_wall_is_not_pressed_against_it():
    one = guide("transport_corner", [1.3, 0.0, 0.7])
    one.target(np.zeros(2))
    at = lambda x, y: se2.rotation_matrix(0.7).T @ np.array([x, y])  # noqa: E731
    assert one.pins(at(1.0, 0.0)) and one.pins(at(0.5, 0.866))
    assert not one.pins(at(0.0, 1.0)) and not one.pins(at(-1.0, 0.0))
    open_place = guide("transport_reference", [0.0, 0.0, 0.7])
    open_place.target(np.zeros(2))
    assert not any(open_place.pins(at(math.cos(a), math.sin(a))) for a in np.linspace(0, 6, 30))


def test_a_robot_walks_round_walls_to_the_object_and_then_along_its_route():
    """It walks on a map without an object: it comes to where the object was, and farther."""
    name = "transport_two_corners"
    one, here, met = guide(name, [1.2, 1.2, 0.0]), np.array([1.2, 1.2]), []
    for _ in range(4000):
        one.own.pose[:2] = here
        way = one.walk()
        here = here + 0.02 * way / max(float(np.hypot(*way)), 0.02)
        assert SPACES[name].clearance(here[None])[0] > 0.5 * RADIUS
        met.append(here)
    for place in (MAPS[name][0], (0.0, 0.0), MAPS[name][1]):
        assert np.hypot(*(np.array(met) - place).T).min() < 0.5


def test_a_robot_that_has_seen_the_object_in_a_wall_looks_for_it_on_the_route():
    """An estimate of the centre may be wrong by so much. It stood before that wall for ever."""
    name = "transport_two_corners"
    for wall in ((-0.5, -0.4), (1.55, 0.0), (0.0, 0.4)):
        here, met = np.array([-1.0, -1.0]), []
        one = guide(name, [*here, 0.0])
        one.target(np.array(wall) - here)
        for _ in range(1500):
            one.own.pose[:2] = here
            way = one.walk()
            step = here + 0.02 * way / max(float(np.hypot(*way)), 0.02)
            here = step if SPACES[name].clearance(step[None])[0] > 0.5 * RADIUS else here
            met.append(here)
        assert np.hypot(*(np.array(met) - MAPS[name][1]).T).min() < 0.5


@pytest.mark.parametrize("name", ["circle", "square", "rectangle"])
def test_what_is_told_of_the_size_of_an_object_corrects_its_centre(name):
    """200 places: with both radii the centre is closer than without, for a circle, of which a near
    robot sees a small part, and for a rectangle, which is not as deep as wide."""
    item = load_object(f"transport_{name}")
    outline, errors = item.geometry.outline, []
    for seed in range(200):
        random = np.random.default_rng(seed)
        pose = np.array([0.0, 0.0, random.uniform(-math.pi, math.pi)])
        corners, towards = se2.transform(pose, outline), random.uniform(-math.pi, math.pi)
        unit, away = np.array([math.cos(towards), math.sin(towards)]), 0.2
        while distance(corners, (away * unit)[None])[0] < RADIUS + 0.01:
            away += 0.005
        away += random.uniform(0.0, 0.5)
        robot = np.array([*(away * unit), random.uniform(-math.pi, math.pi)])
        look = RobotSensor(outline, (50.0, 50.0), RobotSensorSettings(), seed)
        (reading,) = look.look(pose, robot[None], np.ones(2))
        plain, _ = seen_centre(reading.object)
        told = _between(plain, reading.object, _discs(outline))
        errors.append([np.hypot(*se2.transform(robot, p[None])[0]) for p in (plain, told)])
    plain, told = np.mean(errors, axis=0)
    assert told < (0.05 if name != "rectangle" else 0.09), (plain, told)
    assert told < (1.0 if name == "square" else 0.7) * plain, (plain, told)


def made(name, item=SQUARE, count=20, **settings):
    robots = {f"e{i}": ROBOT for i in range(count)}
    sections = {"": OpenRoomSettings(**settings)}
    arena = Arena(GRIDS[name], robots, "object", item, sections)
    return METHOD.make(arena), Belief({"object": item}, robots)


@pytest.mark.long
def test_a_target_to_which_the_object_does_not_fit_is_refused():
    method, belief = made("transport_two_corners")
    start = np.array([-1.0, -1.0, 0.0])
    seen = Seen(0.0, start, {})
    task = Task((np.array([1.0, 1.0, math.nan]),))
    assert isinstance(method.assess(task, belief, seen), Certificate)
    large = replace(SQUARE, shape=replace(SQUARE.shape, length=0.9, width=0.9))
    method, belief = made("transport_two_corners", large)
    answer = method.assess(task, belief, seen)
    assert isinstance(answer, Refusal) and answer.code is JobError.PLANNING_FAILED
    method.begin(task, belief)
    method.step(Seen(0.0, start, {"e0": np.array([1.0, 1.0, 0.0])}), belief)
    assert method.status.phase == JobPhase.IDLE
    assert method.status.code == JobError.PLANNING_FAILED, method.status


def test_a_target_behind_a_wall_right_across_the_room_is_refused():
    """The room once counted as open: two rectangles of free cells, one beside the other."""
    room = EnvironmentSpec((3.0, 3.0), (BoxSpec((0.0, 0.0), (0.1, 3.0)),), resolution=0.05)
    arena = Arena(rasterise(room), {"e0": ROBOT}, "object", SQUARE)
    belief = Belief({"object": SQUARE}, {"e0": ROBOT})
    seen, task = Seen(0.0, np.array([-0.8, 0.0, 0.0]), {}), Task((np.array([0.8, 0.0, math.nan]),))
    answer = METHOD.make(arena).assess(task, belief, seen)
    assert isinstance(answer, Refusal) and answer.code is JobError.PLANNING_FAILED


def test_a_robot_is_told_its_pose_once(monkeypatch):
    """Also if motion capture loses robots, or loses one and finds another one in the same frame.
    What a robot has measured until then counts: its odometry goes on from its last reading."""
    told, made_guide = [], Guides.made
    monkeypatch.setattr(
        Guides, "made", lambda *args: told.append(args[2]) or made_guide(*args), raising=True
    )
    method, belief = made("transport_middle", count=3)
    method.begin(Task((np.array([0.0, 1.0, math.nan]),)), belief)
    places = {f"e{i}": np.array([0.3 * i - 0.3, -1.3, 0.1 * i]) for i in range(3)}
    for tick, names in enumerate(("e0 e1", "e0 e1", "e0 e2", "e0", "e0 e1 e2", "e1 e2")):
        robots = {n: places[n] + [0.002 * tick, 0.0, 0.03 * tick] for n in names.split()}
        assert method.step(Seen(0.02 * tick, np.array([0.0, -1.0, 0.0]), robots), belief).commands
    assert np.allclose(told, [places["e0"], places["e1"], places["e2"] + [0.004, 0.0, 0.06]])


def test_odometry_goes_on_while_motion_capture_does_not_see_a_robot():
    look, robots = RobotSensor(SQUARE.geometry.outline, (3.0, 3.0), EXACT, 1), np.zeros((2, 3))
    look.look(FAR, robots, np.ones(2), ("a", "b"))
    look.look(FAR, robots[:1], np.ones(2), ("a",))
    moved = np.array([[0.1, 0.2, 0.3], [0.0, 0.0, 0.0]])
    one, other = look.look(FAR, moved, np.ones(2), ("b", "a"))
    assert np.allclose(one.moved, moved[0]) and np.allclose(other.moved, 0.0)


def test_what_a_robot_does_not_see_does_not_change_its_reading():
    """20 scenes: the object is elsewhere, behind a wall or out of range."""
    same, sides = 0, SIDES["transport_two_corners"]
    for seed in range(20):
        pose, robots = scene("transport_two_corners", seed, 8)
        plain, moved = (
            RobotSensor(SQUARE.geometry.outline, (3.0, 3.0), EXACT, 1, sides).look(
                item, robots, np.ones(2)
            )
            for item in (pose, FAR)
        )
        for one, other in zip(plain, moved, strict=True):
            if not len(one.object) and len(one.walls) == len(other.walls):
                same += 1
                assert np.array_equal(one.walls, other.walls)
                assert np.array_equal(one.moved, other.moved)
    assert same > 20


def test_no_robot_is_commanded_into_a_wall():
    """200 robots at random places: towards the nearest wall at most as fast as the gap allows."""
    near, law = 0, LocalLawSettings()
    for seed in range(10):
        name = list(MAPS)[1 + seed % 3]
        pose, robots = scene(name, seed, 20)
        method, belief = made(name)
        method.begin(Task((np.array([*MAPS[name][1], math.nan]),)), belief)
        seen = Seen(0.0, pose, {f"e{i}": r for i, r in enumerate(robots)})
        method.step(seen, belief)
        chosen, walls = method._held, Walls(GRIDS[name], RADIUS)
        unit, gaps = walls.towards(robots[:, :2]), walls.clearance(robots[:, :2]) - RADIUS
        close = gaps < 0.1
        near += int(close.sum())
        # 5 mm: the error of a measured distance of so much, and the map's cells.
        most = law.closing * np.maximum(gaps - law.apart + 5e-3, 0.0)
        assert (np.sum(chosen * unit, axis=1)[close] <= most[close] + 1e-6).all()
    assert near > 20


@pytest.mark.parametrize(
    ("name", "item"), slice_and_study([("middle", "circle"), ("two_corners", "square")], 1)
)
def test_twenty_robots_bring_an_object_round_walls(name, item):
    name, item = f"transport_{name}", load_object(f"transport_{item}")
    start, goal, places = drawn(name, item, 3, 20, turned=False)
    method, belief = made(name, item, seed=3)
    robots = {f"e{i}": (ROBOT, place) for i, place in enumerate(places)}
    method.begin(Task((goal,)), belief)
    tick = 0
    with PlanarWorld(load_map(name), robots, {"object": (item, start)}) as world:
        while method.status.phase != JobPhase.IDLE and tick < 50 * 300:
            poses = world.poses()
            seen = Seen(tick / 50, poses["object"], {n: poses[n] for n in robots})
            for n, told in method.step(seen, belief).commands.items():
                world.command(n, *told)
            world.step(round(0.02 / world.time_step))
            tick += 1
    assert method.status.code == 0, method.status
