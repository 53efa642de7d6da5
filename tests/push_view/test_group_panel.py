"""The panel of a group: what it tells of a push under way, and draws of one that is over."""

import math

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from rclpy.node import Node

from push_msgs.msg import GroupStatus
from push_record.contents import GROUP_STATUS, GroupPushes, Job
from push_ros.names import Names
from push_ros.process import Spinner
from push_ros.qos import STATUS
from push_view.drawing import draw_forces
from push_view.panels import panel_of


def test_the_page_is_told_errors_margin_forces_and_who_does_not_move(ros):
    node = Node("somebody")
    publisher = node.create_publisher(GroupStatus, "/group_status", STATUS)
    live = panel_of("group").live(node, Names("/", "/"), ("a", "b", "c"))
    assert live.rows() == []
    message = GroupStatus(pushers=["a", "c"], force_x=[0.6, 0.0], force_y=[0.8, 0.5], dead=["b"])
    message.position_error, message.margin, message.lacking = 1.5e-3, math.nan, 0.25
    spinner = Spinner([node])
    try:
        assert spinner.until(lambda: publisher.get_subscription_count() > 0, 5.0)
        publisher.publish(message)
        assert spinner.until(lambda: bool(live.rows()), 5.0)
        rows = dict(live.rows())
        assert rows["pushing"] == "2 of 3" and rows["tracking error"] == "1.5 mm"
        assert rows["grasp margin"] == "–" and rows["wrench not made"] == "25 %"
        assert rows["force of a"] == "1.00 N" and rows["force of c"] == "0.50 N"
        assert rows["does not move"] == "b"
        live.close()
    finally:
        spinner.close()


def test_the_report_draws_a_line_a_robot_and_forces_within_their_cones():
    push = GroupPushes(("a", "c"), 0.2)
    for k in range(30):
        push.rows.append([0.1 * k, *([0.01] * (len(GROUP_STATUS) - 1))])
        push.points.append(np.array([[0.0, 0.1], [0.0, -0.1]]))
        push.normals.append(np.array([[1.0, 0.0], [1.0, 0.0]]))
        push.forces.append(np.array([[1.0, 0.1], [0.5, 0.0]]))
    job = Job("/", "group", ("a", "b", "c"), "plate", pushes=[push, GroupPushes(("a",), 0.2)])
    figure, axes = plt.subplots()
    draw_forces(axes, push)
    assert len(axes.texts) == 4 and len(axes.lines) == 8  # two moments, two robots, two edges
    page = plt.figure()
    panel_of("group").draw(page, page.add_gridspec(1, 1)[0], None, job)
    assert len(page.axes) == 5
    assert [t.get_text() for t in page.axes[4].get_legend().get_texts()] == ["a", "b", "c"]
    plt.close(figure)
    plt.close(page)
