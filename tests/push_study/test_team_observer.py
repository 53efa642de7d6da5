"""What the observer of a team counts."""

import numpy as np
import pytest

from push_ros.names import Names
from push_study.team_run import TeamObserver
from sim_bridge.world import BodyContacts, BodyPoses, Contact


@pytest.mark.parametrize(
    ("pair", "collisions", "obstacles"),
    [
        (("object", "e0"), 0, 0),
        (("e1", "object"), 0, 0),
        (("e0", "e1"), 1, 0),
        (("object", "wall2"), 1, 1),
        (("polygon0", "e1"), 1, 1),
    ],
)
def test_robots_that_touch_each_other_touch_no_obstacle(ros, pair, collisions, obstacles):
    watcher = TeamObserver(Names("/", "/"), ["e0", "e1"])
    try:
        zero = np.zeros(3)
        contacts = BodyContacts.of([Contact(*pair, zero, zero, np.array([1.0, 0.0, 0.0]), 1.0)])
        poses = BodyPoses(("e0", "e1", "object"), np.arange(9.0).reshape(3, 3))
        watcher.see(0.1, poses, contacts)
        assert watcher.trace.collision_ticks == 0, "nothing counts before the task"
        watcher.recording = True
        watcher.see(0.2, poses, contacts)
        assert watcher.trace.now.tolist() == [[6.0, 7.0, 8.0], [0.0, 1.0, 2.0], [3.0, 4.0, 5.0]]
        force = {("object", "e0"): [1.0, 0.0], ("e1", "object"): [0.0, -1.0]}.get(pair, [0.0, 0.0])
        assert watcher.trace.forces[0][:, 0].tolist() == force
        found = watcher.trace.collision_ticks, watcher.trace.obstacle_ticks
        assert found == (collisions, obstacles)
    finally:
        watcher.destroy_node()


def test_a_robot_that_is_gone_has_no_pose_and_without_the_object_nothing_is_kept(ros):
    watcher = TeamObserver(Names("/", "/"), ["e0", "e1"])
    try:
        nothing = BodyContacts.of([])
        watcher.see(0.1, BodyPoses(("e1",), np.ones((1, 3))), nothing)
        assert not len(watcher.trace.now)
        watcher.see(0.2, BodyPoses(("e1", "object"), np.ones((2, 3))), nothing)
        assert np.isnan(watcher.trace.now[1]).all() and (watcher.trace.now[[0, 2]] == 1.0).all()
    finally:
        watcher.destroy_node()
