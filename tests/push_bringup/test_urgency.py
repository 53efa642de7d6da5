"""Which nodes go first, and which give way: as the main of each module tells ``run_node``."""

import importlib.util
import re
from pathlib import Path

import pytest

from push_bringup.node_kinds import KINDS, METHOD_MODULE, MODULES
from push_ros.scheduling import Urgency

BETWEEN_POSES_AND_COMMANDS = {
    *(kind.module for kind in KINDS.values() if kind.commands),
    MODULES["controller"],
    MODULES["torque_controller"],
    MODULES["swarm_agent"],
    METHOD_MODULE,
    MODULES["supervisor"],  # without its heartbeat at each frame the controller stops the robot
}
LOSES_MESSAGES = {MODULES["recorder"], "planar_push.record"}  # if it waits for too long
BRIDGES = {MODULES["bridge"], MODULES["lab_bridge"]}


def source(module):
    return Path(importlib.util.find_spec(module).origin).read_text()


@pytest.mark.parametrize(
    "module", sorted({*MODULES.values(), "planar_push.view", "planar_push.record"})
)
def test_what_is_between_poses_and_commands_goes_first_and_what_computes_gives_way(module):
    (words,) = re.findall(r"run_node\((.*)\)", source(module))
    if module in BRIDGES:
        expected = Urgency.WORLD
    elif module in BETWEEN_POSES_AND_COMMANDS:
        expected = Urgency.CONTROL
    else:
        expected = Urgency.ORDINARY if module in LOSES_MESSAGES else Urgency.BACKGROUND
    (found,) = re.findall(r"urgency=Urgency\.(\w+)", words) or ["ORDINARY"]
    assert found == expected.name
