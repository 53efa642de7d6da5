"""What a team's robots are told when the method says something that is no number: FAULTS 4."""

import math

import pytest
import rclpy
from builtin_interfaces.msg import Time

from push_job.method import Told
from push_msgs.msg import Velocities
from push_ros.commander import TeamCommander
from push_ros.names import Names
from push_ros.process import Spinner
from push_ros.qos import COMMAND
from push_ros.roster import Roster, RosterSettings


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("holonomic", [True, False])
def test_a_robot_whose_command_is_not_finite_is_told_to_stand_in_the_same_tick(ros, bad, holonomic):
    node, heard = rclpy.create_node("team"), []
    node.create_subscription(Velocities, "/cmd_vels", heard.append, COMMAND)
    spinner = Spinner([node])
    roster = Roster(RosterSettings(), ["a", "b", "c"], {}, 0.1, False)
    team = TeamCommander(node, Names("/", "/"), roster, holonomic)
    told = {"a": (0.1, 0.2), "b": (bad, 0.1), "c": (0.3, bad)}
    if holonomic:
        told["c"] = (0.3, 0.1, bad)
    assert spinner.until(lambda: team._publisher.get_subscription_count() > 0, 10.0)
    team.send(Time(sec=1), Told(told))
    assert spinner.until(lambda: bool(heard), 10.0)
    second = heard[0].vy if holonomic else heard[0].omega
    assert list(heard[0].vx) == [0.1, 0.0, 0.0] and list(second) == [0.2, 0.0, 0.0]
    assert all(map(math.isfinite, heard[0].omega)) and team.not_finite == 2
    team.send(Time(sec=2), Told({"a": (0.1, 0.2)}))
    assert team.not_finite == 2
    spinner.close()
