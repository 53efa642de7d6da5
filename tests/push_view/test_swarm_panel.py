"""The panel of a swarm: what it tells of a job under way, and draws of one that is over."""

import math

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from rclpy.node import Node

from push_msgs.msg import SwarmStatus
from push_record.collisions import Collisions
from push_record.contents import BagContents, Job, SwarmTicks
from push_ros.names import Names
from push_ros.process import Spinner
from push_ros.qos import STATUS
from push_scenario.scenario import load_scenario
from push_view.panels import panel_of


def status(time=0.0, phase="push"):
    message = SwarmStatus(
        object="square", law="crescent", phase=phase, robots=["e1", "e2"], dead=["e3"], targets=3,
        target=1, weight=[1.0], mean_x=[-0.2], mean_y=[0.0], root=[10.0, 0.0, 0.0, 10.0],
        region_x=[-1.0, 1.0, 1.0, -1.0], region_y=[-1.0, -1.0, 1.0, 1.0],
        centroid_x=[-0.2, -0.2], centroid_y=[0.1, -0.1], position_error=0.25,
        orientation_error=math.nan, solve_time=8e-4,
    )  # fmt: skip
    message.header.stamp.sec = int(time)
    return message


def test_the_page_is_told_phase_target_and_who_does_not_move(ros):
    node = Node("somebody")
    publisher = node.create_publisher(SwarmStatus, "/swarm_status", STATUS)
    live = panel_of("swarm").live(node, Names("/", "/"), ("e1", "e2", "e3"))
    assert live.rows() == []
    spinner = Spinner([node])
    try:
        assert spinner.until(lambda: publisher.get_subscription_count() > 0, 5.0)
        publisher.publish(status())
        assert spinner.until(lambda: bool(live.rows()), 5.0)
        rows = dict(live.rows())
        assert rows["phase"] == "push" and rows["target"] == "2 of 3"
        assert rows["taking part"] == "2 of 3" and rows["does not move"] == "e3"
        assert rows["to the target"] == "250 mm" and rows["heading error"] == "–"
        live.close()
    finally:
        spinner.close()


def test_the_report_draws_errors_phases_and_density_with_cells():
    scenario = load_scenario("swarm-square")
    contents = BagContents(scenario, {}, Collisions(frozenset(), frozenset()))
    contents.time = np.arange(10.0)
    contents.poses = {
        "square": np.zeros((10, 3)),
        "e1": np.tile([-0.3, 0.1, 0.0], (10, 1)),
        "e2": np.tile([-0.3, -0.1, 0.0], (10, 1)),
    }
    ticks = SwarmTicks()
    for k in range(10):
        phase = "gather" if k < 4 else "push"
        ticks.rows.append((float(k), 1.0 - 0.1 * k, 0.1, 1e-3, phase))
        ticks.moments.append(status(k, phase))
    job = Job("/", "swarm", ("e1", "e2", "e3"), "square", swarm=ticks)
    page = plt.figure()
    panel_of("swarm").draw(page, page.add_gridspec(1, 1)[0], contents, job)
    assert len(page.axes) == 6
    moments = page.axes[3:]
    assert [a.get_title() for a in moments] == ["0 s: gather", "4 s: push", "9 s: push"]
    assert all(a.collections and a.patches for a in moments)  # density, object
    empty = plt.figure()
    panel_of("swarm").draw(empty, empty.add_gridspec(1, 1)[0], contents, Job("/"))
    assert not empty.axes
    plt.close(page)
    plt.close(empty)
