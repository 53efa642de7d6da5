"""The verbs of a lab: what is wrong is said before anything moves; a calibration is told."""

import os

import pytest
import rclpy
import yaml

from planar_push.main import main
from push_msgs.msg import Belief
from push_ros.claims import claim_world
from push_ros.process import Spinner
from push_ros.qos import BELIEF
from push_scenario.scenario import load_scenario
from tests.lab_bridge.stand_in import FOLDER

LAB = str(FOLDER / "lab-single.yaml")


@pytest.mark.parametrize(
    ("line", "what"),
    [
        (["doctor", "robots", "--scenario", "short"], "not for a lab"),
        (["doctor", "--scenario", "atlantis"], "no scenarios called"),
        (["calibrate", "--scenario", "short"], "not for a lab"),
        (["calibrate", "--scenario", LAB, "--robot", "r2"], "unknown robot 'r2'"),
        (["calibrate", "--scenario", LAB, "--out", "/no/such/folder/f.yaml"], "there is no folder"),
        (["launch", "single", "--scenario", LAB, "--factor", "2"], "a lab runs in real time"),
        (["belief", "--from", "/no/such/file.yaml"], "cannot be read"),
        (["belief"], "no values are given"),
    ],
)
def test_what_is_wrong_is_said(line, what, domain, capsys):
    assert main(line) == 2
    assert what in capsys.readouterr().err


@pytest.mark.parametrize("line", [["calibrate"], ["doctor", "--drive"]])
def test_no_robot_is_driven_beside_a_suite(line, domain, capsys):
    claim = claim_world(os.environ["ROS_DOMAIN_ID"], "/")
    try:
        assert main([*line, "--scenario", LAB]) == 2
    finally:
        claim.close()
    assert "`calibrate` or `doctor --drive` already runs" in capsys.readouterr().err


def test_a_calibration_is_told_to_the_nodes(ros, domain, tmp_path, monkeypatch, capsys):
    file = tmp_path / "c.yaml"
    numbers = {"value": 0.21, "low": 0.2, "high": 0.23}
    file.write_text(yaml.safe_dump({"values": {"box.contact_friction": numbers}}))
    monkeypatch.setattr("push_record.recorder.heard_scenario", lambda *_: load_scenario(LAB))
    heard = []
    node = rclpy.create_node("listener")
    node.create_subscription(Belief, "/belief", heard.append, BELIEF)
    spinner = Spinner([node])
    try:
        assert main(["belief", "--from", str(file), "latency=0.03"]) == 0
        assert spinner.until(lambda: heard, 5.0)
        assert capsys.readouterr().out.splitlines() == [
            "box.contact_friction = 0.21, between 0.2 and 0.23",
            "latency = 0.03, between 0.03 and 0.03",
        ]
        assert main(["belief", "bx.mass=1"]) == 2
        assert "unknown object 'bx'; the scenario has: box" in capsys.readouterr().err
    finally:
        spinner.close()
    (message,) = heard
    assert message.source == "calibration"
    assert list(message.quantities) == ["contact_friction", "latency"]
    assert [message.values[0], message.lows[0], message.highs[0]] == [0.21, 0.2, 0.23]
