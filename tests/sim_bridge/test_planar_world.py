"""The planar world: Coulomb's laws in closed form, and PyBullet's world beside it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from grasp_opt.contact_outline import ContactOutline
from push_model import SettingsError, se2
from push_model.limit_surface import GRAVITY
from push_model.occupancy import MapSpec, OccupancyGrid
from push_model.shape_specs import PolygonShape, RectangleShape
from push_model.specs import BoxSpec, CircleSpec, EnvironmentSpec, ObjectSpec
from push_scenario.bodies import load_object, load_robot
from sim_bridge.planar_world import PlanarSettings, PlanarWorld
from sim_bridge.pybullet_world import PyBulletWorld
from sim_bridge.worlds import world_kind, world_names

OPEN = EnvironmentSpec((6.0, 6.0))
DISC = load_robot("disc")
STRONG = replace(DISC, drive=replace(DISC.drive, max_force=50.0))
PLATES = ("plate_square", "plate_triangle", "plate_hexagon", "plate_ellipse")


def run(world, seconds):
    world.step(round(seconds / world.time_step))


def test_it_is_a_world_by_name(robot, box):
    assert "planar" in world_names()
    kind = world_kind("planar")
    bodies = {"r": (robot, np.zeros(3))}, {"b": (box, np.array([0.2, 0.0, 0.0]))}
    for rate in (60.0, 100.0, 240.0):
        with kind.make(OPEN, *bodies, kind.settings(), 1.0 / rate) as world:
            steps = round(1.0 / rate / world.time_step)
            assert steps * world.time_step == pytest.approx(1.0 / rate)
            assert world.time_step <= kind.settings().time_step + 1e-12
            assert world.names == ("r", "b") and world.wheel_state("r") is None


@pytest.mark.parametrize("com", [(0.0, 0.0), (0.02, -0.01)])
def test_a_sliding_object_follows_its_limit_surface(com):
    """200 twists: the impulse of the floor is (3.4) of the twist that it leaves."""
    item = ObjectSpec(RectangleShape(0.09, 0.14), 0.05, 0.06, 0.3, 0.2, com=com)
    surface = item.limit_surface()
    random = np.random.default_rng(2)
    dt = 5e-4
    with PlanarWorld(OPEN, {}, {"b": (item, np.zeros(3))}, PlanarSettings(time_step=dt)) as world:
        for _ in range(200):
            world.reset()
            twist = random.normal(size=3) * [0.3, 0.3, 6.0]
            world.set_velocity("b", twist)
            world.step(1)
            after = world.velocity("b")
            wrench = -(after - twist) / dt * [item.mass, item.mass, item.moment]
            expected = surface.wrench(after)
            assert wrench == pytest.approx(expected, abs=2e-3 * surface.max_force)
    assert surface.max_force == pytest.approx(0.3 * 0.05 * GRAVITY)


def test_a_slow_object_is_stopped_and_stays(box):
    with PlanarWorld(OPEN, {}, {"b": (box, np.zeros(3))}) as world:
        world.set_velocity("b", np.array([0.01, -0.005, 0.1]))
        run(world, 0.2)
        there = world.poses()["b"].copy()
        run(world, 5.0)
        assert np.array_equal(world.poses()["b"], there)
        assert np.abs(world.velocity("b")).max() < 1e-12


def test_a_drive_pushes_with_its_traction_and_no_more():
    """Two discs head on: the stronger pushes the weaker with the difference; against a wall
    nothing moves."""
    weak = replace(DISC, drive=replace(DISC.drive, max_force=1.0))
    robots = {
        "s": (DISC, np.array([0.0, 0.0, 0.0])),
        "w": (weak, np.array([0.1, 0.0, math.pi])),
    }
    with PlanarWorld(OPEN, robots, {}) as world:
        world.command_all(["s", "w"], np.array([[0.1, 0.0, 0.0], [0.1, 0.0, 0.0]]))
        world.step(4)
        gained = world.velocity("s")[0] / (4 * world.time_step)
        assert gained == pytest.approx((1.9 - 1.0) / (2.0 * DISC.mass), rel=0.02)
        run(world, 0.3)
        assert world.velocity("s")[0] == pytest.approx(0.1, abs=1e-6)
        world.read_contacts()
        run(world, 0.1)
        (contact,) = world.read_contacts()
        assert np.abs(contact.force[0]) == pytest.approx(1.0, abs=0.02)
    room = EnvironmentSpec((1.0, 1.0))
    with PlanarWorld(room, {"d": (DISC, np.array([0.4, 0.1, 0.0]))}, {}) as world:
        world.command("d", 0.1, 0.0)
        run(world, 2.0)
        world.read_contacts()
        run(world, 1.0)
        assert world.poses()["d"][0] == pytest.approx(0.45, abs=1e-4)
        (contact,) = world.read_contacts()
        assert (contact.body_a, contact.body_b, contact.duty) == ("d", "wall2", 1.0)
        assert contact.force[0] == pytest.approx(-1.9, rel=1e-3)
        assert contact.normal[0] == pytest.approx(-1.0)
        assert contact.position[:2] == pytest.approx([0.5, 0.1], abs=1e-3)


def test_wheels_slide_when_their_friction_is_not_enough(robot):
    """An e-puck against a wall: its wheels give no more than mu m g."""
    slick = replace(robot, drive=replace(robot.drive, wheel_friction=0.3, wheel_torque=1.0))
    room = EnvironmentSpec((1.0, 1.0))
    with PlanarWorld(room, {"r": (slick, np.array([0.4, 0.0, 0.0]))}, {}) as world:
        world.command("r", 0.1, 0.0)
        run(world, 2.0)
        world.read_contacts()
        run(world, 1.0)
        (contact,) = world.read_contacts()
        assert contact.force[0] == pytest.approx(-0.3 * slick.mass * GRAVITY, rel=1e-3)
        assert world.poses()["r"][0] == pytest.approx(0.5 - robot.bumper.distance, abs=1e-4)


def test_work_that_goes_in_is_what_friction_takes():
    """A disc slides along a box that it turns: floor and contact share what its drive gives."""
    box = ObjectSpec(RectangleShape(0.2, 0.2), 0.3, 0.05, 0.5, 0.4)
    surface = box.limit_surface()
    start = {"d": (STRONG, np.array([-0.15, 0.07, 0.0]))}
    given = floor = contact_loss = 0.0
    dt = 1e-3
    settings = PlanarSettings(time_step=dt, tolerance=0.0, solver_iterations=100)
    with PlanarWorld(OPEN, start, {"b": (box, np.zeros(3))}, settings) as world:
        world.command_all(["d"], np.array([[0.1, 0.03, 0.0]]), True)
        run(world, 0.3)
        world.read_contacts()
        for _ in range(2000):
            world.step(1)
            v, o = world.velocity("d"), world.velocity("b")
            theta = world.poses()["b"][2]
            local = se2.transform(se2.pose(0, 0, -theta), o[None, :2])[0]
            floor += dt * float(surface.wrench(np.array([*local, o[2]])) @ [*local, o[2]])
            for c in world.read_contacts():
                force = c.force[:2] if c.body_a == "d" else -c.force[:2]
                arm = c.position[:2] - world.poses()["b"][:2]
                at_box = o[:2] + o[2] * np.array([-arm[1], arm[0]])
                given -= dt * float(force @ v[:2])
                contact_loss -= dt * float(force @ (v[:2] - at_box))
    assert given > 0.1 and contact_loss > 0.01 * given
    assert floor + contact_loss == pytest.approx(given, rel=0.01)


def twin(robots, objects, environment=OPEN):
    yield PyBulletWorld(environment, robots, objects)
    yield PlanarWorld(environment, robots, objects)


@pytest.mark.parametrize("name", PLATES)
def test_both_worlds_push_a_plate_alike(name):
    """Two strong discs, as a formation on an arc: where the plate ends, and with which forces."""
    plate = load_object(name)
    outline = ContactOutline(plate.geometry)
    way = outline.way_of_angle(np.array([math.pi - 0.7, math.pi + 0.7]))
    places = outline.at(way).centres(0.0501)
    ends, forces = [], []
    starts = {n: np.array([*p, 0.0]) for n, p in zip("de", places, strict=True)}
    for world in twin({n: (STRONG, s) for n, s in starts.items()}, {"p": (plate, np.zeros(3))}):
        with world:
            dt, angle, felt = 0.02, 0.0, []
            centre = np.array([0.0, 1.5])
            for tick in range(300):
                angle += min(1.0, tick / 50) * 0.08 / 1.5 * dt
                turn = se2.pose(0.0, 0.0, angle)
                goal = np.array(
                    [centre + se2.transform(turn, (p - centre)[None])[0] for p in places]
                )
                now = np.array([world.poses()[n][:2] for n in "de"])
                twists = np.column_stack([(goal - now) / dt, np.zeros(2)])
                world.command_all(["d", "e"], twists, True)
                run(world, dt)
                found = {frozenset((c.body_a, c.body_b)): c for c in world.read_contacts()}
                pair = [found.get(frozenset((n, "p"))) for n in "de"]
                felt.append([0.0 if c is None else np.hypot(*c.force[:2]) for c in pair])
            ends.append(world.poses()["p"].copy())
            forces.append(np.array(felt)[100:].mean(axis=0))
    apart = se2.between(ends[0], ends[1])
    assert np.hypot(*apart[:2]) < 2e-3 and abs(apart[2]) < 0.02, ends
    assert forces[1] == pytest.approx(forces[0], abs=0.15)


def test_nobody_gets_through_walls_and_obstacles(robot, box):
    """An e-puck that shoves a box into a corner with an obstacle in it: nobody gets through."""
    block, pillar = BoxSpec((0.3, 0.1), (0.1, 0.2), 0.4), CircleSpec((0.0, 0.3), 0.06)
    room = EnvironmentSpec((0.8, 0.8), boxes=(block,), circles=(pillar,))
    random = np.random.default_rng(5)
    for _ in range(15):
        heading = random.uniform(-math.pi, math.pi)
        start = np.array([*random.uniform(-0.12, 0.0, 2), heading])
        ahead = se2.compose(start, np.array([0.05 + 0.0705, random.uniform(-0.02, 0.02), 0.3]))
        with PlanarWorld(room, {"r": (robot, start)}, {"b": (box, ahead)}) as world:
            for _ in range(20):
                world.command("r", random.uniform(0.0, 0.12), random.uniform(-1.0, 1.0))
                run(world, 0.3)
                for name, outline in (("r", robot.outline), ("b", box.outline)):
                    corners = se2.transform(world.poses()[name], outline)
                    assert np.abs(corners).max() < 0.4 + 5e-4
                    assert np.hypot(*(corners - [0, 0.3]).T).min() > 0.06 - 5e-4
                    local = se2.transform(se2.inverse(se2.pose(0.3, 0.1, 0.4)), corners)
                    inside = (np.abs(local) < [0.05 - 5e-4, 0.1 - 5e-4]).all(axis=1)
                    assert not inside.any()


def test_flat_bumpers_touch_at_two_points_and_slip_at_the_limit(robot, box):
    for mu, factor, low, high in ((0.3, 1.1, 0.0, 0.05), (0.3, 0.85, 4.0, 40.0)):
        item = replace(box, contact_friction=mu)
        radius = (0.045 + robot.bumper.distance) / mu * factor
        ahead = np.array([robot.bumper.distance + 0.0451, 0.0, 0.0])
        with PlanarWorld(OPEN, {"r": (robot, np.zeros(3))}, {"b": (item, ahead)}) as world:
            world.command("r", 0.05, 0.0)
            run(world, 0.5)
            assert world._contacts.number[0] == 2
            first = se2.between(world.poses()["r"], world.poses()["b"])
            for part in range(1, 31):
                world.command("r", 0.05, 0.05 / radius * part / 30)
                run(world, 0.01)
            run(world, math.pi / 3 * radius / 0.05)
            last = se2.between(world.poses()["r"], world.poses()["b"])
            assert low <= 1e3 * abs(last[1] - first[1]) < high


def test_a_concave_object_is_hollow_and_a_map_has_walls(robot):
    corners = ((0, 0), (0.2, 0), (0.2, 0.19), (0.14, 0.19), (0.14, 0.06), (0.06, 0.06),
               (0.06, 0.2), (0, 0.2))  # fmt: skip
    item = ObjectSpec(
        PolygonShape(tuple((float(x), float(y)) for x, y in corners)), 0.2, 0.05, 0.3, 0.2
    )
    small = replace(DISC, body_radius=0.02, bumper=replace(DISC.bumper, radius=0.03))
    inside = np.array([0.1, 0.12]) - (np.array(corners[0]) - item.outline[0])
    robots = {"d": (small, np.array([*inside, 0.0]))}
    with PlanarWorld(OPEN, robots, {"u": (item, np.zeros(3))}) as world:
        run(world, 0.2)
        assert not world.read_contacts() and not world.poses()["u"].any()
        world.command_all(["d"], np.array([[0.05, 0.0, 0.0]]), True)
        run(world, 2.0)
        assert world.poses()["u"][0] > 0.05
    occupied = np.zeros((40, 60), dtype=bool)
    occupied[:, 45:50] = True  # x from 0.45 to 0.50
    room = MapSpec(OccupancyGrid(occupied, 0.02, np.array([-0.45, -0.4])), 0.1, 0.3)
    with PlanarWorld(room, {"r": (robot, np.zeros(3))}, {}) as world:
        world.command("r", 0.1, 0.0)
        run(world, 6.0)
        assert world.poses()["r"][0] + robot.bumper.distance == pytest.approx(0.45, abs=1e-3)


def test_the_killed_stand_the_removed_are_gone_until_the_reset(robot, box):
    robots = {"e": (robot, np.zeros(3)), "d": (DISC, np.array([0.0, 0.5, 0.0]))}
    with PlanarWorld(OPEN, robots, {"b": (box, np.array([0.3, 0.5, 0.0]))}) as world:
        world.command("e", 0.05, 0.0)
        world.command("d", 0.05, 0.0)
        run(world, 0.5)
        world.kill("e")
        run(world, 0.1)
        still = world.poses()["e"].copy()
        world.remove("d")
        world.command_all(["e", "d"], np.array([[0.05, 0.0, 0.0]] * 2))
        run(world, 10.0)
        assert world.names == ("e", "b") == tuple(world.poses())
        assert world.poses()["e"] == pytest.approx(still, abs=1e-9)
        assert world.poses()["b"] == pytest.approx([0.3, 0.5, 0.0])  # nobody came
        with pytest.raises(ValueError, match="removed"):
            world.place("d", np.zeros(3))
        with pytest.raises(ValueError, match="not finite"):
            world.command("e", math.nan, 0.0)
        world.reset()
        assert world.names == ("e", "d", "b")
        world.command("d", 0.05, 0.0)
        run(world, 8.0)
        assert world.poses()["b"][0] > 0.4
        world.place("b", np.array([1.0, 1.0, 2.0]))
        assert world.poses()["b"] == pytest.approx([1.0, 1.0, 2.0])


def test_runs_repeat_to_the_bit_also_after_a_reset(robot, box):
    ahead = np.array([0.1, 0.01, 0.1])
    robots = {"r": (robot, np.zeros(3)), "d": (DISC, np.array([0.3, 0.0, 2.0]))}
    results = []
    with PlanarWorld(OPEN, robots, {"b": (box, ahead)}) as world:
        for _ in range(2):
            world.reset()
            world.command("r", 0.08, 0.3)
            world.command("d", 0.02, 0.0)
            run(world, 3.0)
            contacts = [c.force.tolist() for c in world.read_contacts()]
            results.append((world.poses().table.copy(), contacts))
    assert np.array_equal(results[0][0], results[1][0]) and results[0][1] == results[1][1]


def test_torque_drives_are_refused_with_the_way_out():
    with pytest.raises(SettingsError, match=r"r: .* use bridge.world: pybullet"):
        PlanarWorld(OPEN, {"r": (load_robot("pioneer"), np.zeros(3))}, {})


def test_a_hundred_discs_in_a_bin_stay_in_it_and_apart():
    """Random commands, a plate among them: overlaps stay below half a millimetre."""
    random = np.random.default_rng(8)
    starts = [np.array([-0.9 + 0.2 * (k % 10), -0.9 + 0.2 * (k // 10), 0.0]) for k in range(100)]
    plate = load_object("plate_triangle")
    robots = {f"d{k}": (DISC, s) for k, s in enumerate(starts) if np.hypot(*(s[:2] - 0.1)) > 0.35}
    with PlanarWorld(
        EnvironmentSpec((2.0, 2.0)), robots, {"p": (plate, np.array([0.1, 0.1, 0.0]))}
    ) as world:
        names = list(robots)
        for _ in range(40):
            world.command_all(names, random.normal(0.0, 0.1, (len(names), 3)), True)
            run(world, 0.25)
            at = np.array([world.poses()[n][:2] for n in names])
            apart = np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1))
            np.fill_diagonal(apart, 1.0)
            assert apart.min() > 0.1 - 1e-3 and np.abs(at).max() < 0.95 + 5e-4


def test_who_comes_fast_is_stopped_before_and_throws_nobody():
    """Steps up to 20 ms, discs up to 0.9 m/s: no overlap, and the box gets no faster than they."""
    fast = replace(STRONG, drive=replace(STRONG.drive, max_speed=1.0))
    box = ObjectSpec(RectangleShape(0.09, 0.09), 0.05, 0.06, 0.3, 0.2)
    for dt in (5e-3, 2e-2):
        for v in (0.1, 0.47, 0.93):
            for start in np.linspace(-0.30, -0.31, 5):
                robots = {"d": (fast, np.array([start, 0.0, 0.0]))}
                settings = PlanarSettings(time_step=dt)
                with PlanarWorld(OPEN, robots, {"b": (box, np.zeros(3))}, settings) as world:
                    world.command_all(["d"], np.array([[v, 0.0, 0.0]]), True)
                    for _ in range(round(1.0 / dt)):
                        world.step(1)
                        poses = world.poses()
                        gap = poses["b"][0] - 0.045 - poses["d"][0] - 0.05
                        assert gap > -1e-4 and world.velocity("b")[0] < v * 1.01 + 1e-9


def test_there_is_room_for_any_number_of_contacts():
    """A long bar on a staircase of map cells: walls hold, and what was added up stays."""
    size = 0.01
    occupied = np.zeros((300, 300), dtype=bool)
    for k in range(300):
        occupied[max(0, k - 3) : k + 1, k] = True
    room = MapSpec(OccupancyGrid(occupied, size, np.array([-1.5, -1.5])), 0.1, 0.3)
    bar = ObjectSpec(RectangleShape(2.2, 0.06), 1.0, 0.05, 0.3, 0.2)
    side = np.array([-math.sin(math.pi / 4), math.cos(math.pi / 4)])
    start = np.array([*(0.045 * side), math.pi / 4])
    robots = {"d": (STRONG, np.array([*(0.135 * side), 0.0]))}
    with PlanarWorld(room, robots, {"bar": (bar, start)}) as world:
        room_before = len(world._contacts.keys)
        world.command_all(["d"], np.array([[*(-0.1 * side), 0.0]]), True)
        run(world, 2.0)
        assert len(world._contacts.keys) > room_before
        across = float(world.poses()["bar"][:2] @ side)
        assert across > 0.03 - 2e-3 and world.poses()["d"][:2] @ side > across + 0.03 + 0.05 - 1e-3
        world.read_contacts()
        run(world, 0.5)
        forces = {(c.body_a, c.body_b): c.force[:2] for c in world.read_contacts()}
        pressed = sum(f @ side for (a, b), f in forces.items() if b.startswith("wall"))
        given = -sum(f @ side for (a, b), f in forces.items() if (a, b) == ("d", "bar"))
        assert len(forces) > 30 and abs(pressed) > 0.7 * abs(given) - bar.limit_surface().max_force
