"""Which robots count as stopped by the object, on simple motions at a flat face."""

import numpy as np
import pytest

from push_estimation.stopped_robots import StoppedRobots
from push_model import se2

R, STEP, NOISE = 0.037, 0.02, 1e-3  # [m], [s], [m]
NONE = np.zeros((0, 2))
FACE = np.array([-R, 0.0])  # place of a robot that touches the face x = 0, object at x > 0


class Face:
    """The line of contact of the face x = 0, believed to be deeper than it is by ``error`` [m]."""

    def __init__(self, error=0.0):
        self.error = error

    def depth(self, points):
        return points[:, 0] + R - self.error

    def outward(self, point):
        return np.array([-1.0, 0.0])


LINE = Face()


def watched(moves, seed, seconds=1.2, others=NONE):
    """Places where robots count as stopped. moves: by name, the first place ``(2,)``, the command
    ``(2,)`` [m/s] and the velocity ``(2,)`` [m/s], world frame."""
    random = np.random.default_rng(seed)
    stopped, found = StoppedRobots(R), []
    item = np.array([0.3, -0.2, random.uniform(-3.0, 3.0)])
    turn, heading = se2.rotation_matrix(float(item[2])), random.uniform(-3.0, 3.0)
    for k in range(int(seconds / STEP)):
        t = k * STEP
        robots = {}
        for name, (place, command, velocity) in moves.items():
            at = se2.transform(item, np.array([place]))[0] + t * turn @ np.array(velocity)
            body = se2.rotation_matrix(heading).T @ turn @ np.array(command)
            stopped.command(name, t, *body, False)
            robots[name] = np.array([*(at + NOISE * random.standard_normal(2)), heading])
        world = se2.transform(item, others) if len(others) else NONE
        found += [s.place for s in stopped.frame(t, item, robots, world, LINE)]
    return found


@pytest.mark.parametrize("seed", range(40))
def test_a_robot_that_presses_on_a_face_is_stopped_where_it_is(seed):
    found = watched({"a": (FACE, (0.03, 0.0), (0.0, 0.0))}, seed)
    assert len(found) == 2
    assert all(np.hypot(*(place - FACE)) < 1e-3 for place in found)


@pytest.mark.parametrize("seed", range(40))
def test_a_robot_that_slides_along_the_face_while_it_presses_is_stopped(seed):
    found = watched({"a": (FACE, (0.03, 0.04), (0.0, 0.04))}, seed)
    assert found and all(abs(place[0] + R) < 1e-3 for place in found)


@pytest.mark.parametrize("seed", range(40))
def test_a_robot_that_something_stops_on_its_way_along_the_object_is_stopped(seed):
    """A corner of the object that is not in the estimated outline."""
    found = watched({"a": (FACE, (0.0, 0.05), (0.0, 0.0))}, seed)
    assert len(found) == 2


@pytest.mark.parametrize("seed", range(40))
@pytest.mark.parametrize(
    ("command", "velocity"),
    [
        ((0.05, 0.0), (0.05, 0.0)),  # it comes closer
        ((0.0, 0.0), (0.0, 0.0)),  # it waits
        ((0.0, 0.05), (0.0, 0.05)),  # it goes along
        ((-0.05, 0.0), (0.0, 0.0)),  # it was to go away, and something holds it
    ],
)
def test_others_are_not(seed, command, velocity):
    start = FACE - [0.08, 0.0]
    assert not watched({"a": (start, command, velocity)}, seed, seconds=1.0)


@pytest.mark.parametrize("seed", range(40))
def test_a_robot_that_follows_the_object_at_a_distance_is_not_stopped(seed):
    """The object flees as fast as the robot follows. Another one pushes it."""
    random = np.random.default_rng(seed)
    stopped, found = StoppedRobots(R), []
    for k in range(60):
        t = k * STEP
        item = np.array([0.05 * t, 0.0, 0.0]) + 5e-4 * random.standard_normal(3)
        robots = {"a": np.array([0.05 * t - R - 0.02, 0.0, 0.0])}
        robots["b"] = robots["a"] + [0.02, 0.2, 0.0]
        robots = {n: p + 5e-4 * random.standard_normal(3) for n, p in robots.items()}
        for name in robots:
            stopped.command(name, t, 0.05, 0.0, False)
        found += stopped.frame(t, item, robots, NONE, LINE)
    assert not found


@pytest.mark.parametrize("seed", range(40))
def test_a_robot_that_pushes_the_object_is_stopped_by_it(seed):
    """It is commanded 3 cm/s faster than the object moves."""
    random = np.random.default_rng(seed)
    stopped, found = StoppedRobots(R), []
    for k in range(60):
        t = k * STEP
        item = np.array([0.05 * t, 0.0, 0.0]) + 5e-4 * random.standard_normal(3)
        robot = np.array([0.05 * t - R, 0.0, 0.0]) + 5e-4 * random.standard_normal(3)
        stopped.command("a", t, 0.08, 0.0, False)
        found += [s.place for s in stopped.frame(t, item, {"a": robot}, NONE, LINE)]
    assert len(found) == 2 and all(np.hypot(*(p - FACE)) < 1.5e-3 for p in found)


@pytest.mark.parametrize("seed", range(40))
@pytest.mark.parametrize("touching", [True, False])
def test_who_pushes_an_object_without_being_at_its_outline(seed, touching):
    """The object moves just as a robot was commanded to, 3 cm before the outline that is believed.
    Where another robot is at the outline, that one may push it."""
    random = np.random.default_rng(seed)
    stopped, found, line = StoppedRobots(R), [], Face(0.03)
    for k in range(60):
        t = k * STEP
        item = np.array([0.05 * t, 0.0, 0.0]) + 5e-4 * random.standard_normal(3)
        robots = {"a": np.array([0.05 * t - R, 0.0, 0.0])}
        if touching:
            robots["b"] = robots["a"] + [0.03, 0.2, 0.0]
        robots = {n: p + 5e-4 * random.standard_normal(3) for n, p in robots.items()}
        for name in robots:
            stopped.command(name, t, 0.05, 0.0, False)
        found += stopped.frame(t, item, robots, NONE, line)
    assert len(found) == (0 if touching else 2)
    assert all(np.hypot(*(s.place - FACE)) < 1.5e-3 and not s.on_its_way for s in found)


@pytest.mark.parametrize("seed", range(10))
def test_at_a_wall_and_far_from_the_object_the_cause_is_not_known(seed):
    stopped, robot = StoppedRobots(R), np.array([-R, 0.0, 0.0])
    for k in range(60):
        t = k * STEP
        stopped.command("a", t, 0.05, 0.0, False)
        assert not stopped.frame(t, np.zeros(3), {"a": robot}, NONE, LINE, unsure={"a"})
    for k in range(60):
        t = 2.0 + k * STEP
        stopped.command("a", t, 0.05, 0.0, False)
        assert not stopped.frame(t, np.zeros(3), {"a": robot - [0.12, 0.0, 0.0]}, NONE, LINE)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("angle", [0.0, 0.7, -1.2])
def test_behind_another_body_the_cause_is_not_known(seed, angle):
    """A robot, or a body that nobody commands, in front of it."""
    ahead = FACE + (2.0 * R + 1e-3) * np.array([np.cos(angle), np.sin(angle)]) - [0.05, 0.0]
    behind = FACE - [0.05, 0.0]
    robot = {"a": (behind, (0.03, 0.0), (0.0, 0.0)), "b": (ahead, (0.0, 0.0), (0.0, 0.0))}
    assert not watched(robot, seed)
    assert not watched({"a": robot["a"]}, seed, others=ahead[None])
    assert watched({"a": robot["a"]}, seed, others=behind[None] - [2.0 * R + 1e-3, 0.0])


def test_after_an_interruption_a_window_begins_anew():
    stopped = StoppedRobots(R)
    robot, item = np.array([-R, 0.0, 0.0]), np.zeros(3)

    def frames(begin, count):
        found = []
        for k in range(count):
            stopped.command("a", begin + STEP * k, 0.03, 0.0, False)
            found.append(stopped.frame(begin + STEP * k, item, {"a": robot}, NONE, LINE))
        return found

    assert not any(frames(0.0, 20))
    stopped.reset()
    assert not any(frames(5.0, 20))
    assert any(frames(9.0, 60))


@pytest.mark.parametrize("seed", range(10))
def test_a_robot_that_nobody_commands_any_more_stands_by_itself(seed):
    """Whoever commanded it has died: the bridge stops it, and its poses go on."""
    random = np.random.default_rng(seed)
    stopped, off = StoppedRobots(R), random.uniform(0.01, 0.08)
    for k in range(500):
        t = k * STEP
        if t < 0.3:
            stopped.command("a", t, 0.05, 0.0, False)
        robot = np.array([-R - off, 0.0, 0.0]) + 5e-4 * random.standard_normal(3)
        assert not stopped.frame(t, np.zeros(3), {"a": robot}, NONE, LINE)


@pytest.mark.parametrize("seed", range(10))
def test_a_motion_that_answers_an_older_frame_than_the_last_command_does_not_count(seed):
    """The bridges refuse it."""
    random = np.random.default_rng(seed)
    stopped = StoppedRobots(R)
    for k in range(200):
        t = k * STEP
        stopped.command("a", t, 0.0, 0.0, False)
        stopped.command("a", t - STEP, 0.05, 0.0, False)
        robot = np.array([-R, 0.0, 0.0]) + 5e-4 * random.standard_normal(3)
        assert not stopped.frame(t, np.zeros(3), {"a": robot}, NONE, LINE)
