"""Objects that are stuck at walls: whereto they can be pushed."""

import math

import numpy as np
import pytest

from push_model import se2
from push_model.occupancy import rasterise
from push_model.screws import screw_poses
from push_model.specs import EnvironmentSpec
from push_scenario.bodies import load_object
from push_study.swarm_map import MapTask, run
from swarm_push.escape import Escape
from swarm_push.rim import Rim
from swarm_push.walls import Walls

R = 0.05


@pytest.mark.parametrize("name", ["transport_triangle", "transport_square", "transport_l"])
def test_motions_off_a_wall_lead_nowhere_into_it_and_are_pushed_from_free_places(name):
    """In a room of 2 m, its floor side touched by an edge of the object that lies flat on it."""
    item = load_object(name)
    walls = Walls(rasterise(EnvironmentSpec((2.0, 2.0))), R)
    outline = item.geometry.outline
    rim = Rim(outline, R, 1.5 * R)
    escape, found = Escape(rim, item, R, walls), 0
    for k in range(len(outline)):
        edge = outline[(k + 1) % len(outline)] - outline[k]
        turn = -math.atan2(edge[1], edge[0])
        laid = se2.transform(np.array([0.0, 0.0, turn]), outline)
        pose = np.array([0.1, -1.0 - laid[:, 1].min() + 1e-3, turn])
        up = se2.rotation_matrix(turn).T @ [0.0, 0.05]  # where nobody can push to from below
        motion = escape.direction(pose, np.array([*up, 0.0]))
        if motion is None:
            continue
        found += 1
        gone = screw_poses(pose, 0.03 * motion, np.ones(1))[0]
        lowest = se2.transform(gone, outline)[:, 1].min()
        assert lowest > -1.0 - 2e-3  # not into the wall
        there = walls.free(se2.transform(pose, rim.points))
        assert rim.drive(motion, item.contact_friction)[there].max() > 0.0
    assert found >= 2


def test_what_did_not_help_is_not_tried_again_at_the_same_place_until_all_was():
    item = load_object("transport_triangle")
    walls = Walls(rasterise(EnvironmentSpec((2.0, 2.0))), R)
    escape = Escape(Rim(item.geometry.outline, R, 1.5 * R), item, R, walls)
    lowest = item.geometry.outline[:, 1].min()
    here, wanted = np.array([0.1, -1.0 - lowest + 1e-3, 0.0]), np.array([0.03, 0.04, 0.0])
    scale = np.array([1.0, 1.0, item.limit_surface().radius])
    tried = []
    while (motion := escape.direction(here, wanted)) is not None:
        tried.append(motion * scale)
    assert len(tried) >= 3
    assert max(a @ b for k, a in enumerate(tried) for b in tried[:k]) < 0.8
    assert escape.direction(here, wanted) * scale == pytest.approx(tried[0])
    elsewhere = here + [0.2, 0.0, 0.0]
    assert escape.direction(elsewhere, wanted) * scale == pytest.approx(tried[0], abs=0.1)


def test_in_the_open_it_goes_where_it_is_wanted():
    item = load_object("transport_square")
    walls = Walls(rasterise(EnvironmentSpec((3.0, 3.0))), R)
    rim = Rim(item.geometry.outline, R, 1.5 * R)
    escape = Escape(rim, item, R, walls)
    for angle in np.linspace(0.0, 6.0, 12):
        wanted = 0.05 * np.array([math.cos(angle), math.sin(angle), 0.0])
        motion = escape.direction(np.array([0.0, 0.0, 0.4]), wanted)
        assert motion[:2] @ wanted[:2] > 0.7 * np.hypot(*motion[:2]) * 0.05


def test_a_triangle_flat_on_a_wall_comes_off_it(tmp_path):
    """Stood for good before there was an escape."""
    task = MapTask(
        "transport_middle", 22, str(tmp_path), "transport_triangle", 20, True, "planar", "mild",
        600.0,
    )  # fmt: skip
    row = run(task)
    assert row["success"], row["reason"]
