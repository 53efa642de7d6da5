"""Send a robot a straight trajectory, while ``planar-push launch torque`` runs.

``follow_a_trajectory.py [ROBOT] [METRES]`` works with any controller, e.g. ``epuck1 0.2`` with the
system ``single``.
"""

import sys
from typing import Any

import numpy as np
from rclpy.action import ActionClient

from push_model.trajectory import line
from push_msgs.action import FollowTrajectory
from push_msgs.msg import Poses
from push_ros.conversions import poses_from_ros, trajectory_to_ros
from push_ros.latched import visitor
from push_ros.qos import STREAM


def main(robot: str = "pioneer", distance: str = "2.0") -> bool:
    """Whether the robot followed the trajectory to its end."""
    seen: dict[str, Any] = {}
    with visitor() as (node, spinner):
        node.create_subscription(
            Poses, "/poses", lambda m: seen.update(poses_from_ros(m, (robot,))[0]), STREAM
        )
        client = ActionClient(node, FollowTrajectory, f"/{robot}/follow_trajectory")
        if not spinner.until(lambda: robot in seen and client.server_is_ready(), 20.0):
            print(f"no poses of {robot}, or no controller; is a suite running?")
            return False
        way = line(np.array(seen[robot]), float(distance), 0.08, 0.1)
        goal = FollowTrajectory.Goal(trajectory=trajectory_to_ros(way))
        sent = client.send_goal_async(goal)
        spinner.until(sent.done, 10.0)
        answer = sent.result().get_result_async()
        spinner.until(answer.done, 3.0 * way.duration + 20.0)
        result = answer.result().result
    print(f"{result.error_code}: {result.error_msg or 'at its end'}, {result.position_error:.3f} m")
    return bool(result.error_code == 0)


if __name__ == "__main__":
    sys.exit(not main(*sys.argv[1:]))
