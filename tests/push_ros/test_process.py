"""Who hears a publisher."""

import rclpy
from geometry_msgs.msg import PoseStamped

from push_ros.process import Spinner, reaches
from push_ros.qos import COMMAND


def test_another_subscriber_does_not_count(ros):
    """A goal was lost when the recorder was known before the supervisor was."""
    node, recorder = rclpy.create_node("sender"), rclpy.create_node("recorder")
    publisher = node.create_publisher(PoseStamped, "/goal_pose", COMMAND)
    recorder.create_subscription(PoseStamped, "/goal_pose", lambda m: None, COMMAND)
    spinner = Spinner([node, recorder])
    assert spinner.until(lambda: publisher.get_subscription_count() > 0, 5.0)
    assert not reaches(node, publisher, "supervisor")
    supervisor = rclpy.create_node("supervisor")
    heard = []
    supervisor.create_subscription(PoseStamped, "/goal_pose", heard.append, COMMAND)
    spinner.close()
    node = rclpy.create_node("sender")
    publisher = node.create_publisher(PoseStamped, "/goal_pose", COMMAND)
    spinner = Spinner([node, supervisor])
    try:
        assert spinner.until(lambda: reaches(node, publisher, "supervisor"), 5.0)
        publisher.publish(PoseStamped())
        assert spinner.until(lambda: heard, 5.0)
    finally:
        spinner.close()
