"""The recorder node: the suite's topics into a bag."""

import subprocess
import time
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import OccupancyGrid
from nav_msgs.msg import Path as PathMessage
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Bool, Header, String
from visualization_msgs.msg import MarkerArray

from push_msgs.msg import Contacts, ControllerStatus, JobState, Poses, PushPlan
from push_record.bag import BagWriter
from push_ros.conversions import time_from_ros
from push_ros.qos import CLOCK, COMMAND, LATCHED, STATUS, STREAM
from push_scenario.scenario import Scenario
from tf2_msgs.msg import TFMessage


def revision() -> str:
    """The git revision of the source tree, with a mark when it was changed; empty without git."""
    here = Path(__file__).resolve().parent
    try:
        text = subprocess.run(
            ["git", "-C", str(here), "describe", "--always", "--dirty", "--abbrev=12"],
            capture_output=True,
            text=True,
            timeout=5,
            check=True,
        ).stdout
    except (OSError, subprocess.SubprocessError):
        return ""
    return text.strip()


def topics(scenario: Scenario) -> dict[str, tuple[Any, Any]]:
    """What is recorded: topic to message class and QoS."""
    result: dict[str, tuple[Any, Any]] = {
        "/clock": (Clock, CLOCK),
        "/poses": (Poses, STREAM),
        "/ground_truth/poses": (Poses, STREAM),
        "/contacts": (Contacts, STREAM),
        "/map": (OccupancyGrid, LATCHED),
        "/goal_pose": (PoseStamped, COMMAND),
        "/push_plan": (PushPlan, LATCHED),
        "/push_path": (PathMessage, LATCHED),
        "/job_state": (JobState, LATCHED),
        "/status_text": (String, LATCHED),
        "/paused": (Bool, LATCHED),
        "/tf": (TFMessage, STATUS),
        "/visualization": (MarkerArray, STATUS),
        "/diagnostics": (DiagnosticArray, STATUS),
    }
    for robot in scenario.robots:
        result[f"/{robot}/cmd_vel"] = (TwistStamped, COMMAND)
        result[f"/{robot}/heartbeat"] = (Header, STREAM)
        result[f"/{robot}/controller/status"] = (ControllerStatus, STATUS)
    return result


def _type_name(message: Any) -> str:
    return f"{message.__module__.split('.')[0]}/msg/{message.__name__}"


class RecorderNode(Node):
    """Writes raw messages as they come. Log time is sim time once a clock has been seen."""

    def __init__(self, folder: Path, scenario: Scenario, seed: int) -> None:
        super().__init__("recorder")
        self.writer = BagWriter(
            folder,
            {
                "scenario": scenario.text,
                "scenario_name": scenario.name,
                "seed": str(seed),
                "revision": revision(),
            },
        )
        self._sim_time = 0
        for topic, (message, qos) in topics(scenario).items():
            self.writer.add_topic(topic, _type_name(message), qos is LATCHED)
            self.create_subscription(
                message, topic, lambda data, t=topic: self._on_message(t, data), qos, raw=True
            )
        self.create_subscription(Clock, "/clock", self._on_clock, CLOCK)

    def _on_clock(self, message: Clock) -> None:
        self._sim_time = round(1e9 * time_from_ros(message.clock))

    def _on_message(self, topic: str, data: bytes) -> None:
        if self.writer.closed:
            return
        simulated = self._sim_time > 0 or self.count_publishers("/clock") > 0
        try:
            self.writer.write(topic, self._sim_time if simulated else time.time_ns(), bytes(data))
        except OSError as error:  # e.g. the disk is full: what is written stays readable
            self.get_logger().error(f"recording ends: {error}")
            self.writer.abandon()

    def destroy_node(self) -> None:
        """Finish the bag too."""
        self.writer.close()
        super().destroy_node()
