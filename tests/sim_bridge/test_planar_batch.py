"""Many planar worlds in one call: each is the planar world, to the bit."""

import numpy as np
import pytest

from push_model.settings import SettingsError
from push_model.shape_specs import RectangleShape
from push_model.specs import EnvironmentSpec, ObjectSpec
from push_scenario.bodies import load_object, load_robot
from sim_bridge.planar_batch import PlanarBatch
from sim_bridge.planar_world import PlanarWorld

ROOM = EnvironmentSpec((2.0, 1.6), resolution=0.02)
OFF_CENTRE = ObjectSpec(RectangleShape(0.2, 0.1), 0.1, 0.05, 0.3, 0.2, com=(0.02, -0.01))
WORLDS, TICKS = 24, 60


def crowded(random, robots, reach=0.15):
    """Poses of robots on one side of an object, near enough to push it and each other."""
    poses = np.zeros((WORLDS, robots + 1, 3))
    poses[:, -1] = random.uniform(-0.3, 0.3, (WORLDS, 3))
    spread = np.linspace(-0.9, 0.9, robots) if robots > 1 else np.zeros(1)
    angle = random.uniform(-2.0, 2.0, (WORLDS, 1)) + spread
    poses[:, :-1, 0] = poses[:, -1:, 0] + reach * np.cos(angle)
    poses[:, :-1, 1] = poses[:, -1:, 1] + reach * np.sin(angle)
    poses[:, :-1, 2] = angle - np.sign(angle) * np.pi
    return poses


@pytest.mark.parametrize(
    ("robot", "count", "item", "reach"),
    [
        ("epuck", 1, load_object("box9"), 0.12),
        ("epuck_ring", 4, load_object("plate_square"), 0.3),
        ("disc", 5, load_object("transport_l"), 0.34),
        ("epuck", 1, OFF_CENTRE, 0.17),
    ],
)
def test_every_world_moves_as_it_does_alone(robot, count, item, reach):
    """24 random worlds in contact; nothing of one world depends on the others."""
    spec, random = load_robot(robot), np.random.default_rng(5)
    batch = PlanarBatch(WORLDS, ROOM, [spec] * count, [item])
    starts = crowded(random, count, reach)
    batch.place(np.arange(WORLDS), starts)
    told = random.uniform(0.2, 1.0, (TICKS, WORLDS, count, 3)) * [spec.max_speed, 0.05, 1.0]
    for twists in told:
        batch.command(twists)
        batch.step(10)
    found, moved = batch.poses, 0
    for w in range(WORLDS):
        robots = {f"r{i}": (spec, starts[w, i]) for i in range(count)}
        with PlanarWorld(ROOM, robots, {"o": (item, starts[w, -1])}) as world:
            for twists in told[:, w]:
                world.command_all(list(robots), twists)
                world.step(10)
            expected = world.poses().table
        # The frame of an object whose centre of mass is elsewhere is rounded in another order.
        tolerance = 0.0 if item.com == (0.0, 0.0) else 1e-12
        assert np.abs(found[w] - expected).max() <= tolerance
        moved += np.hypot(*(found[w, -1] - starts[w, -1])[:2]) > 0.02
    assert moved > WORLDS / 2, "hardly any object was pushed: the test would see nothing"


def test_worlds_that_stand_still_do():
    spec, random = load_robot("epuck"), np.random.default_rng(2)
    batch = PlanarBatch(WORLDS, ROOM, [spec], [load_object("box9")])
    batch.place(np.arange(WORLDS), crowded(random, 1))
    batch.command(np.tile([0.1, 0.0, 0.0], (WORLDS, 1, 1)))
    before, still = batch.poses, np.arange(WORLDS) % 3 == 0
    batch.step(50, still)
    gone = np.abs(batch.poses - before).max(axis=(1, 2))
    assert (gone[still] == 0.0).all() and (gone[~still] > 0.01).all()


def test_placing_some_worlds_leaves_the_others_alone():
    spec, random = load_robot("epuck"), np.random.default_rng(3)
    batch = PlanarBatch(4, ROOM, [spec], [load_object("box9")])
    starts = crowded(random, 1)[:4]
    batch.place(np.arange(4), starts)
    batch.command(np.tile([0.1, 0.0, 0.0], (4, 1, 1)))
    batch.step(100)
    before = batch.poses
    batch.place(np.array([2]), starts[2:3])
    after = batch.poses
    assert np.array_equal(after[[0, 1, 3]], before[[0, 1, 3]])
    assert after[2] == pytest.approx(starts[2]) and not batch.velocities[2].any()


def test_a_world_that_runs_out_of_room_for_contacts_goes_on():
    """A heap of discs has more contacts than there is room for at first."""
    disc = load_robot("disc")
    n = 12
    batch = PlanarBatch(2, EnvironmentSpec((0.5, 0.5)), [disc] * n, [load_object("box9")])
    room = batch._contacts.keys.shape[1]
    batch._contacts = type(batch._contacts)(
        *(
            np.ascontiguousarray(a[:, :8]) if a.ndim > 1 and a.shape[1] == room else a
            for a in batch._contacts
        )
    )
    batch._contacts = batch._contacts._replace(number=np.zeros((2, 1), dtype=np.int64))
    side = disc.footprint_radius * 2.02
    grid = np.array([[(i % 4) * side - 0.15, (i // 4) * side - 0.2, 0.0] for i in range(n)])
    batch.place(np.arange(2), np.tile(np.vstack([grid, [0.15, 0.18, 0.0]]), (2, 1, 1)))
    batch.command(np.tile([0.1, 0.05, 0.0], (2, n, 1)))
    batch.step(200)
    assert batch._contacts.keys.shape[1] > 8
    assert np.isfinite(batch.poses).all() and np.array_equal(batch.poses[0], batch.poses[1])


def test_what_is_refused():
    with pytest.raises(ValueError, match="one type"):
        PlanarBatch(1, ROOM, [load_robot("epuck"), load_robot("disc")], [load_object("box9")])
    with pytest.raises(SettingsError, match="torque"):
        PlanarBatch(1, ROOM, [load_robot("pioneer")], [load_object("pioneer_box")])
    batch = PlanarBatch(1, ROOM, [load_robot("epuck")], [load_object("box9")])
    with pytest.raises(ValueError, match="finite"):
        batch.command(np.full((1, 1, 3), np.nan))
    with pytest.raises(ValueError, match="finite"):
        batch.place(np.zeros(1, dtype=int), np.full((1, 2, 3), np.inf))
