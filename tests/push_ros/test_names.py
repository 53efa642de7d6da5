"""Where things are, in every namespace that a node may be started in."""

import pytest
import rclpy

from push_ros.names import Names, inside, names_of, names_of_robot, space


@pytest.mark.parametrize(
    ("given", "prefix"),
    [("", "/"), ("/", "/"), ("a", "/a/"), ("/a", "/a/"), ("/a/b/", "/a/b/")],
)
def test_a_namespace_as_a_prefix(given, prefix):
    assert space(given) == prefix


def test_names():
    names = Names("/", "/red/")
    assert names.world("poses") == "/poses"
    assert names.team("goal_pose") == "/red/goal_pose"
    assert names.robot("epuck1", "cmd_vel") == "/epuck1/cmd_vel"
    assert inside("", "epuck1") == "/epuck1" and inside("/a", "epuck1") == "/a/epuck1"


@pytest.mark.parametrize(
    ("namespace", "world", "expected"),
    [
        ("", "", Names("/", "/")),
        ("/a", "", Names("/a/", "/a/")),
        ("/a/red", "/a", Names("/a/", "/a/red/")),
        ("/red", "/", Names("/", "/red/")),
    ],
)
def test_a_team_s_node(ros, namespace, world, expected):
    node = rclpy.create_node("planner", namespace=namespace)
    assert names_of(node, world) == expected
    node.destroy_node()


@pytest.mark.parametrize(
    ("namespace", "world"), [("/epuck1", "/"), ("", "/"), ("/a/epuck1", "/a/"), ("/a", "/a/")]
)
def test_a_robot_s_node_lives_below_the_world_or_in_it(ros, namespace, world):
    node = rclpy.create_node("controller", namespace=namespace)
    assert names_of_robot(node, "epuck1") == Names(world, world)
    node.destroy_node()


def test_a_namespace_given_on_the_command_line_moves_a_node(ros):
    node = rclpy.create_node("planner", cli_args=["--ros-args", "-r", "__ns:=/a"])
    assert names_of(node).team("plan_push") == "/a/plan_push"
    node.destroy_node()
