"""Objects that are stuck at walls: whereto they can be pushed."""

import math

import numpy as np
import pytest

from push_model import se2
from push_model.occupancy import rasterise
from push_model.screws import screw_poses
from push_model.specs import BoxSpec, EnvironmentSpec
from push_scenario.bodies import load_object, load_robot
from push_study.uncertainty import uncertainty
from swarm_push.crescent_law import CrescentLawSettings
from swarm_push.escape import Escape
from swarm_push.laws import LawSections
from swarm_push.region import covered_region
from swarm_push.rim import Rim
from swarm_push.swarm_job import SwarmJob, SwarmJobSettings
from swarm_push.walls import Walls
from tests.driving import GroupWorld, drive

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
        way = escape.direction(pose, np.array([*up, 0.0]))
        if way is None:
            continue
        (motion, length), found = way, found + 1
        assert length >= 0.1
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
    while (way := escape.direction(here, wanted)) is not None:
        tried.append(way[0] * scale)
    assert len(tried) >= 3
    assert max(a @ b for k, a in enumerate(tried) for b in tried[:k]) < 0.8
    assert escape.direction(here, wanted)[0] * scale == pytest.approx(tried[0])
    elsewhere = here + [0.2, 0.0, 0.0]
    assert escape.direction(elsewhere, wanted)[0] * scale == pytest.approx(tried[0], abs=0.1)


def test_it_is_stuck_when_it_comes_no_further_and_nobody_comes_nearer():
    item = load_object("transport_square")
    walls = Walls(rasterise(EnvironmentSpec((2.0, 2.0))), R)
    here, wanted = np.array([0.0, -0.799, 0.0]), np.array([0.0, 0.1, 0.0])

    def leaves(speed=(0.0, 0.0), nearer=0.0, there=True, twist=wanted):
        """When [s] it is led off, moving and robots coming nearer at speeds [m/s]."""
        escape = Escape(Rim(item.geometry.outline, R, 1.5 * R), item, R, walls, 12.0, 0.02)
        for now in np.arange(0.0, 40.0, 0.02):
            pose = here + [speed[0] * now, speed[1] * now, 0.0]
            to_go = 20.0 - nearer * now if there else None
            if escape.motion(now, pose, twist, to_go) is not None:
                return now
        return None

    assert leaves() == pytest.approx(12.0, abs=0.4)
    assert leaves(speed=(0.002, 0.0)) == pytest.approx(12.0, abs=0.4)  # jostled, not onward
    assert leaves(speed=(0.0, 0.0018)) is None
    assert leaves(nearer=0.03) is None
    assert leaves(there=False) is None
    assert leaves(twist=np.zeros(3)) is None


def test_in_the_open_it_goes_where_it_is_wanted():
    item = load_object("transport_square")
    walls = Walls(rasterise(EnvironmentSpec((3.0, 3.0))), R)
    rim = Rim(item.geometry.outline, R, 1.5 * R)
    escape = Escape(rim, item, R, walls)
    for angle in np.linspace(0.0, 6.0, 12):
        wanted = 0.05 * np.array([math.cos(angle), math.sin(angle), 0.0])
        motion, _ = escape.direction(np.array([0.0, 0.0, 0.4]), wanted)
        assert motion[:2] @ wanted[:2] > 0.7 * np.hypot(*motion[:2]) * 0.05


@pytest.mark.long
def test_a_triangle_that_lies_flat_on_a_wall_comes_off_it():
    """And stays there where nothing leads it off."""
    room = EnvironmentSpec((2.6, 2.0), (BoxSpec((0.0, -0.8), (2.6, 0.4)),), resolution=0.02)
    item, robot, grid = load_object("transport_triangle"), load_robot("epuck_ring"), rasterise(room)
    outline = item.geometry.outline
    start = np.array([0.0, -0.6 + outline[:, 1].max() + 2e-3, math.pi])
    region = covered_region(grid, robot.footprint_radius)
    begin = [[x, 0.5, 0.0] for x in np.linspace(-0.9, 0.9, 12)]
    reached = []
    for stuck in (CrescentLawSettings().stuck, 600.0):
        laws = LawSections(crescent=CrescentLawSettings(stuck=stuck))
        settings = SwarmJobSettings(position_tolerance=0.1, orientation=False)
        job = SwarmJob(region, item, robot, settings, laws, grid)
        job.begin([np.array([0.0, 0.4, math.nan])])
        with GroupWorld(
            room, robot, np.array(begin), item, start, uncertainty("mild"), 1, "planar"
        ) as world:
            drive(job, world, item, 100.0)
        reached.append(job.index == 1)
    assert reached == [True, False]
