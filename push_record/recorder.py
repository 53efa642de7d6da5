"""The recorder node: records the topics of a world and its teams into a bag."""

import json
import sys
import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path

from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from push_model.settings import SettingsError
from push_record.bag import BagWriter
from push_record.revision import revision, versions
from push_record.topics import recorded_topics
from push_ros.conversions import time_from_ros
from push_ros.latched import hear_latched
from push_ros.names import names_of
from push_ros.process import Spinner, run_node
from push_ros.qos import CLOCK, deep
from push_ros.scheduling import Urgency
from push_scenario.scenario import Scenario, load_scenario, scenario_from_text

LIVE = {"pace": "live"}
"""Metadata of a bag that a recorder in a process of its own writes."""

_PATIENCE = 5.0  # [s] wall time to receive the scenario
_QUIET, _TAIL = 0.2, 2.0  # [s] wall time without a message after which a bag is closed; at most


def heard_scenario(namespace: str = "", limit: float | None = None) -> Scenario:
    """The scenario that the bridge of a namespace publishes.

    Raises
    ------
    SettingsError: none is received within limit [s] of wall time (default: a few seconds); says
        what to do.
    """
    topic = names_in(namespace)
    message = hear_latched(String, topic, _PATIENCE if limit is None else limit)
    if message is None:
        raise SettingsError(
            f"no node publishes a scenario on {topic}; start a suite, or give the scenario "
            "by --scenario"
        )
    return scenario_from_text(str(message.data), "scenario", topic)


def names_in(namespace: str) -> str:
    """Full name of the latched topic with the scenario of a world."""
    return f"/{namespace.strip('/')}/scenario".replace("//", "/")


class RecorderNode(Node):
    """Writes raw messages as they arrive. Log time is simulated time once a clock was received."""

    def __init__(
        self,
        folder: Path | None = None,
        scenario: Scenario | None = None,
        seed: int | None = None,
        namespace: str = "",
        about: Mapping[str, str] | None = None,
    ) -> None:
        """Open the bag and subscribe.

        Parameters
        ----------
        folder: of the bag, which must not exist; default: parameter ``out``.
        scenario: the running one; default: parameter ``scenario`` (a name or path), or the one
            that is published on ``scenario`` if that is empty.
        seed: of the run; default: the scenario's. namespace: the world's.
        about: further metadata of the bag, see ``push_record/run_of_bag.py``.

        Raises
        ------
        FileExistsError: the folder exists. SettingsError: no scenario is known.
        """
        super().__init__("recorder", namespace=namespace)
        names = names_of(self)
        folder = Path(str(self.declare_parameter("out", str(folder or "bag")).value))
        name = str(self.declare_parameter("scenario", "").value)
        system = str(self.declare_parameter("system", "").value)
        world = names.world_space
        if scenario is None:
            scenario = load_scenario(name) if name else heard_scenario(world)
        if seed is None:
            seed = int(scenario.parameters.get("bridge", {}).get("seed", 1))
        self._clock_topic = names.world("clock")
        self.writer = BagWriter(
            folder,
            {
                "scenario": scenario.text,
                "scenario_name": scenario.name,
                "seed": str(seed),
                "revision": revision(),
                "versions": json.dumps(versions()),
                "namespace": world,
                **({"system": system} if system else {}),
                **(about or {}),
            },
        )
        self._sim_time = 0
        self._last = 0.0  # [s] when a message arrived, by the monotonic clock
        for topic, kind in recorded_topics(scenario, world).items():
            self.writer.add_topic(topic, kind.type_name, kind.latched)
            self.create_subscription(
                kind.message,
                topic,
                lambda data, t=topic: self._on_message(t, data),
                deep(kind.qos),
                raw=True,
            )
        self.create_subscription(Clock, self._clock_topic, self._on_clock, CLOCK)

    def _on_clock(self, message: Clock) -> None:
        time = time_from_ros(message.clock)
        if time < 0.0:  # a bag knows no such times
            self.get_logger().warning(
                f"ignored {self._clock_topic}: {time:.3f} s is before 0", throttle_duration_sec=5.0
            )
            return
        self._sim_time = round(1e9 * time)

    def _on_message(self, topic: str, data: bytes) -> None:
        self._last = time.monotonic()
        if self.writer.closed:
            return
        simulated = self._sim_time > 0 or self.count_publishers(self._clock_topic) > 0
        try:
            self.writer.write(topic, self._sim_time if simulated else time.time_ns(), bytes(data))
        except OSError as error:  # e.g. the disk is full; written chunks stay readable
            self.get_logger().error(f"recording ends: {error}")
            self.writer.abandon()

    def finish(self, spinner: Spinner) -> None:
        """Record what was published before the suite was stopped and is still under way."""
        self._last = time.monotonic()
        spinner.until(lambda: time.monotonic() > self._last + _QUIET, _TAIL)

    def destroy_node(self) -> None:
        """Finish the bag too."""
        self.writer.close()
        super().destroy_node()


def main() -> int:
    """Entry point of the process: ``--ros-args`` on its command line."""
    return int(run_node(partial(RecorderNode, about=LIVE), urgency=Urgency.ORDINARY))


if __name__ == "__main__":
    sys.exit(main())
