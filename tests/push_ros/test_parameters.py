"""FAULTS 20: ROS parameters that are wrong are refused, and say what was expected."""

import pytest

from push_model import SettingsError


def test_ros_parameters_follow_the_dataclass(ros, scenario):
    from rclpy.exceptions import ParameterNotDeclaredException
    from rclpy.parameter import Parameter

    from push_planner.node import PlannerNode

    node = PlannerNode(scenario)
    try:
        assert node.get_parameter("push_speed").value == node.settings.push_speed
        descriptor = node.describe_parameter("push_speed")
        assert "m/s" in descriptor.description
        assert descriptor.floating_point_range[0].to_value == 2.0
        (low,) = node.set_parameters([Parameter("push_speed", value=-1.0)])
        assert not low.successful and node.settings.push_speed > 0
        (kind,) = node.set_parameters([Parameter("push_speed", value="fast")])
        assert not kind.successful
        with pytest.raises(ParameterNotDeclaredException):
            node.set_parameters([Parameter("warp", value=1.0)])
        (cross,) = node.set_parameters([Parameter("heading_offsets", value=[0.0, 0.2])])
        assert cross.successful and node.settings.heading_offsets == (0.0, 0.2)
        (good,) = node.set_parameters([Parameter("push_speed", value=0.05)])
        assert good.successful and node.settings.push_speed == 0.05
    finally:
        node.destroy_node()


def test_unknown_scenario_settings_are_refused(ros, scenario):
    from push_mpc.node import ControllerNode

    with pytest.raises(SettingsError, match="warp"):
        ControllerNode(scenario.settings("controller", mpc__warp=3))
    with pytest.raises(SettingsError, match="horizon"):
        ControllerNode(scenario.settings("controller", mpc__horizon=-3))
