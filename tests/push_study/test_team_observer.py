"""What the observer of a team counts."""

import pytest

from push_msgs.msg import Contacts
from push_ros.names import Names
from push_study.team_run import TeamObserver


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
        message = Contacts(body_a=[pair[0]], body_b=[pair[1]], force_x=[1.0], force_y=[0.0])
        watcher._on_contacts(message)
        assert watcher.trace.collision_ticks == 0, "nothing counts before the task"
        watcher.recording = True
        watcher._on_contacts(message)
        found = watcher.trace.collision_ticks, watcher.trace.obstacle_ticks
        assert found == (collisions, obstacles)
    finally:
        watcher.destroy_node()
