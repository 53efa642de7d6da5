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
        assert "(m/s)" in descriptor.description
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


@pytest.fixture
def controller(ros):
    from push_mpc.node import ControllerNode
    from push_scenario.scenario import load_scenario

    scenario = load_scenario("short")
    node = ControllerNode(scenario, scenario.robot("")[0])
    yield node
    node.destroy_node()


@pytest.mark.parametrize("order", [1, -1])
def test_what_is_set_together_is_used_together_or_not_at_all(controller, order):
    """Settings of two groups; one is refused, whichever is looked at first."""
    from rclpy.parameter import Parameter

    def use():
        tracker = controller.follower.tracker
        return tracker.settings.lag_end, tuple(tracker.controller.settings.input_weight)

    before = use()
    good = Parameter("tracker.lag_end", value=0.09)
    wrong = Parameter("mpc.input_weight", value=[0.0, 0.0])
    result = controller.set_parameters_atomically([good, wrong][::order])
    assert not result.successful and "input_weight" in result.reason
    assert use() == before and controller.get_parameter(good.name).value == before[0]
    right = Parameter("mpc.input_weight", value=[0.5, 0.5])
    assert controller.set_parameters_atomically([good, right][::order]).successful
    assert use() == (0.09, (0.5, 0.5))


class Pair:
    """A node with two groups of settings, each of which may say that it is busy."""

    def __init__(self):
        import rclpy

        from push_estimation.pose_gate import PoseGateSettings
        from push_ros.parameters import declare_settings

        self.node, self.used, self.busy = rclpy.create_node("pair"), {}, set()
        for name in ("first", "second"):
            made = declare_settings(
                self.node, PoseGateSettings, prefix=name, apply=lambda s, n=name: self.apply(n, s)
            )
            self.used[name] = made

    def apply(self, name, settings):
        if name in self.busy:
            raise SettingsError(f"{name} is busy")
        self.used[name] = settings


@pytest.mark.parametrize("busy", ["first", "second"])
def test_a_group_that_is_busy_keeps_the_others_as_they_are(ros, busy):
    from rclpy.parameter import Parameter

    pair = Pair()
    before = dict(pair.used)
    pair.busy = {busy}
    both = [Parameter(f"{n}.persistence", value=4) for n in ("first", "second")]
    result = pair.node.set_parameters_atomically(both)
    assert not result.successful and result.reason == f"{busy} is busy"
    assert pair.used == before
    pair.busy = set()
    assert pair.node.set_parameters_atomically(both).successful
    assert [s.persistence for s in pair.used.values()] == [4, 4]
    pair.node.destroy_node()
