"""``ros2 launch planar_push rearrange.launch.py scenario:=…``: the system ``rearrange``."""

from typing import Any

from push_bringup.launch_description import describe


def generate_launch_description() -> Any:
    """As ROS calls it."""
    return describe("rearrange")
