"""``ros2 launch planar_push single.launch.py scenario:=…``: the nodes of the system ``single``."""

from typing import Any

from push_bringup.launch_description import describe


def generate_launch_description() -> Any:
    """As ROS calls it."""
    return describe("single")
