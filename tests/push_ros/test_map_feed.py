"""Requests that come before the first map."""

import pytest

from push_ros import map_feed
from push_ros.map_feed import PATIENCE, FirstMap
from push_ros.names import Names


class Timers:
    """Stands in for a node: keeps what its timer calls."""

    def create_timer(self, period, callback, clock):
        self.call = callback


@pytest.mark.parametrize("space", ["/", "/lab/"])
def test_a_request_that_waits_is_told_once_which_topic_is_silent(space, monkeypatch):
    """Also if the world has a namespace."""
    node, now, missed = Timers(), [50.0], []
    monkeypatch.setattr(map_feed.time, "monotonic", lambda: now[0])
    first = FirstMap(node, Names(space, "/team/"), missed.append)
    now[0] += 2.0 * PATIENCE
    node.call()
    assert not missed, "nobody waits"
    first.wait()
    now[0] += PATIENCE - 0.1
    node.call()
    assert not missed and first.awaited
    for _ in range(3):
        now[0] += 0.2
        node.call()
    assert missed == [f"no map has been received on {space}map"] and not first.awaited
