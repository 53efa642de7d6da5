"""Markers for RViz and Foxglove."""

from collections.abc import Mapping

from geometry_msgs.msg import Point
from visualization_msgs.msg import Marker, MarkerArray

from push_model.arrays import Array
from push_ros.conversions import pose_to_ros, time_to_ros
from push_ros.validation import FRAME
from push_scenario.scenario import Scenario

_BLUE, _ORANGE = (0.1, 0.35, 0.8), (0.85, 0.45, 0.1)


def body_markers(scenario: Scenario, poses: Mapping[str, Array], seconds: float) -> MarkerArray:
    """The outline of every robot and object at its pose."""
    markers = []
    for number, (name, pose) in enumerate(poses.items()):
        is_robot = name in scenario.robots
        spec = scenario.robots[name][0] if is_robot else scenario.objects[name][0]
        outline = spec.outline
        marker = Marker(ns="bodies", id=number, type=Marker.LINE_STRIP, action=Marker.ADD)
        marker.header.frame_id = FRAME
        marker.header.stamp = time_to_ros(seconds)
        marker.pose = pose_to_ros(pose)
        marker.scale.x = 0.004
        marker.color.a = 1.0
        marker.color.r, marker.color.g, marker.color.b = _BLUE if is_robot else _ORANGE
        marker.points = [Point(x=float(x), y=float(y)) for x, y in [*outline, outline[0]]]
        markers.append(marker)
    return MarkerArray(markers=markers)
