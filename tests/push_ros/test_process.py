"""Who hears a publisher."""

import rclpy
from geometry_msgs.msg import PoseStamped

from push_msgs.msg import JobState
from push_ros.process import Spinner, heard
from push_ros.qos import COMMAND, LATCHED


def test_another_subscriber_does_not_count(ros):
    """A goal was lost when the recorder was known before the supervisor was."""
    node, recorder = rclpy.create_node("sender"), rclpy.create_node("recorder")
    publisher = node.create_publisher(PoseStamped, "/goal_pose", COMMAND)
    recorder.create_subscription(PoseStamped, "/goal_pose", lambda m: None, COMMAND)
    spinner = Spinner([node, recorder])
    assert spinner.until(lambda: publisher.get_subscription_count() > 0, 5.0)
    assert not heard(node, publisher)
    supervisor = rclpy.create_node("any_name")
    supervisor.create_publisher(JobState, "/job_state", LATCHED)
    goals = []
    supervisor.create_subscription(PoseStamped, "/goal_pose", goals.append, COMMAND)
    spinner.close()
    node = rclpy.create_node("sender")
    publisher = node.create_publisher(PoseStamped, "/goal_pose", COMMAND)
    spinner = Spinner([node, supervisor])
    try:
        assert spinner.until(lambda: heard(node, publisher), 5.0)
        publisher.publish(PoseStamped())
        assert spinner.until(lambda: goals, 5.0)
    finally:
        spinner.close()
