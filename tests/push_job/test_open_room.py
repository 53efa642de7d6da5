"""The host of laws in an open room: what it tells a law, and when robots stand."""

import math
from dataclasses import replace

import numpy as np
import pytest

from push_job.method import Arena, Seen, Task
from push_job.open_room import OpenRoomMethod, OpenRoomSettings
from push_model import se2
from push_model.belief import Belief, Interval
from push_model.jobs import JobError, JobPhase
from push_model.occupancy import OccupancyGrid, rasterise
from push_model.specs import EnvironmentSpec
from push_scenario.bodies import load_object, load_robot

SQUARE = load_object("transport_square")
DISC = load_robot("disc")
ROOM = rasterise(EnvironmentSpec((4.0, 3.0), resolution=0.05))
NEAR, FAR = np.array([0.3, 0.0, math.nan]), np.array([1.0, 0.0, math.nan])


class Recorded:
    """A law that drives along x, and keeps what it is told."""

    def __init__(self, room):
        self.room, self.told = room, []

    def velocities(self, time, pose, robots):
        self.told.append((time, pose, robots))
        return np.full((len(robots), 2), [0.01 * len(self.told), 0.0])


def hosted(grid=ROOM, count=2, item=SQUARE):
    laws = []
    robots = {f"e{i}": DISC for i in range(count)}
    make = lambda room: laws.append(Recorded(room)) or laws[-1]  # noqa: E731
    method = OpenRoomMethod("recorded", make, Arena(grid, robots, "object", item))
    return method, Belief({"object": item}, robots), laws


def seen(time, at=(0.0, 0.0, 0.0), robots=("e0", "e1")):
    return Seen(time, np.array(at), {n: np.array([-1.0, int(n[1:]), 0.0]) for n in robots})


def test_the_room_is_what_is_free_wherever_the_map_lies():
    """The walls of a grid are two cells thick; other maps have other walls, and another origin."""
    corner = np.array([7.0, -3.0])
    thick = np.pad(ROOM.occupied, ((0, 3), (5, 0)), constant_values=True)
    for grid, shift in (
        (ROOM, np.zeros(2)),
        (OccupancyGrid(thick, 0.05, ROOM.origin + corner - [0.25, 0.0]), corner),
    ):
        method, belief, laws = hosted(grid)
        moved = np.array([*shift, 0.0])
        method.begin(Task((FAR + moved,)), belief)
        here = seen(1.0)
        robots = {n: p + moved for n, p in here.robots.items()}
        method.step(replace(here, object=here.object + moved, robots=robots), belief)
        ((_, pose, places),) = laws[0].told
        assert laws[0].room.size == pytest.approx((4.0, 3.0))
        assert laws[0].room.target == pytest.approx(FAR[:2])
        assert pose == pytest.approx(SQUARE.mass_pose(here.object))
        assert places == pytest.approx(np.array(list(here.robots.values())))


def test_robots_stand_once_the_task_has_ended():
    """Also where the object then comes to a target of it."""
    method, belief, laws = hosted()
    method.begin(Task((NEAR, FAR)), belief)
    assert method.step(seen(0.0), belief).commands
    method.end(JobError.CANCELED, "enough")
    for k in range(1, 5):
        assert not method.step(seen(0.1 * k, (0.3, 0.0, 0.0)), belief).commands
    assert method.status.phase == JobPhase.IDLE and method.status.code == JobError.CANCELED
    assert len(laws) == 1 and method.status.progress == 0.0


def test_a_decision_holds_for_its_step_the_robots_it_was_made_for_and_no_longer():
    method, belief, laws = hosted(count=3)
    method.begin(Task((FAR,)), belief)
    decided = []
    for time, robots in (
        *((5.0, ("e0", "e1")), (5.01, ("e0", "e1")), (5.02, ("e0", "e1"))),
        *((5.02, ("e0", "e1")), (5.03, ("e0", "e2")), (1.0, ("e0", "e2")), (1.01, ("e0", "e2"))),
    ):
        told = method.step(seen(time, robots=robots), belief).commands
        assert tuple(told) == robots
        decided.append(len(laws[0].told))
    assert decided == [1, 1, 2, 2, 3, 4, 4]


def test_a_belief_that_changes_does_not_move_the_outline():
    """The pose that a law gets is that of the object whose outline it knows."""
    method, belief, laws = hosted()
    method.begin(Task((FAR,)), belief)
    other = {("object", k): Interval.exact(v) for k, v in (("com_x", 0.05), ("com_y", 0.02))}
    method.step(seen(0.0, (0.1, 0.2, 0.7)), belief.updated(other))
    _, pose, _ = laws[0].told[-1]
    outline = se2.transform(pose, laws[0].room.item.geometry.outline)
    assert outline == pytest.approx(se2.transform(np.array([0.1, 0.2, 0.7]), SQUARE.outline))


def test_no_progress_fails_the_task():
    method, belief, _ = hosted()
    method.begin(Task((FAR,)), belief)
    limit = OpenRoomSettings().stalled
    for time in (0.0, limit - 1.0, limit + 0.1):
        assert method.status.phase == JobPhase.PUSHING
        told = method.step(seen(time), belief)
    assert method.status.code == JobError.EXECUTION_FAILED and not told.commands


def test_progress_to_a_further_target_is_measured_from_that_target():
    """The small distance from the target that was just reached once counted as the best so far."""
    method, belief, _ = hosted()
    method.begin(Task((NEAR, FAR)), belief)
    limit = OpenRoomSettings().stalled
    for k, x in enumerate((0.0, 0.25, 0.4, 0.6, 0.8)):
        told = method.step(seen(0.5 * limit * k, (x, 0.0, 0.0)), belief)
        assert method.status.phase == JobPhase.PUSHING and told.commands, (x, method.status)
