"""What the observer of a team counts."""

from pathlib import Path

import numpy as np
import pytest

import push_study
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


def test_a_robot_that_is_gone_has_no_pose_and_contacts_count_without_the_object(ros):
    watcher = TeamObserver(Names("/", "/"), ["e0", "e1"])
    try:
        nothing = BodyContacts.of([])
        hit = BodyContacts.of([Contact("e0", "e1", *np.zeros((3, 3)), 1.0)])
        watcher.recording = True
        watcher.see(0.1, BodyPoses(("e1",), np.ones((1, 3))), hit)
        assert not len(watcher.trace.now) and watcher.trace.collision_ticks == 1
        watcher.see(0.2, BodyPoses(("e1", "object"), np.ones((2, 3))), nothing)
        assert np.isnan(watcher.trace.now[1]).all() and (watcher.trace.now[[0, 2]] == 1.0).all()
    finally:
        watcher.destroy_node()


def test_only_studies_of_teams_know_the_witness_of_the_bridge():
    """What it is told is the truth, which nothing that moves a robot may know."""
    root = Path(push_study.__file__).parents[1]
    files = [f for p in root.iterdir() if (p / "__init__.py").is_file() for f in p.rglob("*.py")]
    named = {
        f.relative_to(root).as_posix()
        for f in files
        if f.parts[len(root.parts)] != "tests" and ".witness" in f.read_text()
    }
    assert named == {"push_study/team_run.py", "sim_bridge/node.py"}
