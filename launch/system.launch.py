"""``ros2 launch planar_push system.launch.py system:=NAME``: any system, or any method."""

from typing import Any

from push_bringup.launch_description import describe


def generate_launch_description() -> Any:
    """As ROS calls it."""
    return describe()
