"""Playback: publish the contents of a bag again, for the viewer, RViz and similar tools."""

import math
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from std_msgs.msg import String

from push_model.settings import SettingsError
from push_record.bag import RawRecord, read_raw
from push_record.contents import bag_scenario
from push_record.topics import Topic, shown_topics
from push_ros.names import names_of
from push_ros.process import run_node
from push_ros.scheduling import Urgency

_PERIOD = 0.005  # [s] wall time between checks of the clock
_LONGEST = 1e6  # [s] length of a bag; a stamp beyond it belongs to another clock
_LISTEN = 0.7  # [s] wall time before it begins, for subscribers to be discovered


class PlayerNode(Node):
    """Publishes poses, map, plans and states of a bag at the recorded pace.

    Commands, heartbeats and goals are not published, so that a playback moves no robot.
    finished: whether all has been published.
    """

    def __init__(
        self,
        bag: Path | None = None,
        factor: float = 1.0,
        namespace: str = "",
        moment: Callable[[], float] = time.monotonic,
    ) -> None:
        """Read the scenario and the topics of the bag.

        Parameters
        ----------
        bag: parameter ``bag`` when it is not given. factor: bag time over wall time; parameter.
        namespace: where to publish. moment: clock [s] of the playback.

        Raises
        ------
        ValueError: the bag holds no scenario. FileNotFoundError: there is none.
        SettingsError: the factor is not a positive number.
        """
        super().__init__("player", namespace=namespace)
        names = names_of(self)
        bag = Path(str(self.declare_parameter("bag", str(bag or "bag")).value))
        self._factor = float(self.declare_parameter("factor", float(factor)).value)
        if not (math.isfinite(self._factor) and self._factor > 0.0):
            raise SettingsError(f"factor: expected a positive number, got {self._factor}")
        scenario, metadata = bag_scenario(bag)
        recorded = shown_topics(scenario, metadata.get("namespace", ""))
        shown = shown_topics(scenario, names.world_space)
        self._outputs: dict[str, Any] = {
            source: self._output(topic, kind)
            for source, (topic, kind) in zip(recorded, shown.items(), strict=True)
        }
        self._records: Iterator[RawRecord] = read_raw(bag, set(recorded))
        self._next = next(self._records, None)
        poses = next(t for t in recorded if t.endswith("/poses"))
        first = next(read_raw(bag, {poses}), self._next)
        self._first = first.stamp if first is not None else 0
        self._moment = moment
        self._begin = moment() + _LISTEN
        self.played = 0
        topic = names.world("scenario")
        self._scenario_publisher = next(p for p in self._outputs.values() if p.topic_name == topic)
        self._scenario_publisher.publish(String(data=scenario.text))
        self._timer = self.create_timer(
            _PERIOD, self._on_timer, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def _output(self, topic: str, kind: Topic) -> Any:
        return self.create_publisher(kind.message, topic, kind.qos)

    @property
    def finished(self) -> bool:
        """Whether all has been published."""
        return self._next is None

    def _due(self, stamp: int) -> float:
        """[s] of bag time after the first poses; messages from before any clock are due at once."""
        due = 1e-9 * (stamp - self._first)
        return due if due < _LONGEST else 0.0

    def _on_timer(self) -> None:
        elapsed = self._factor * (self._moment() - self._begin)
        while self._next is not None and self._due(self._next.stamp) <= elapsed:
            self._outputs[self._next.topic].publish(bytes(self._next.data))
            self.played += 1
            self._next = next(self._records, None)


def main() -> int:
    """Entry point of the process: ``--ros-args`` on its command line."""
    return int(run_node(PlayerNode, urgency=Urgency.BACKGROUND))


if __name__ == "__main__":
    sys.exit(main())
