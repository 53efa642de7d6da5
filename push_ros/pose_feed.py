"""The pose stream as a node uses it: validated, gated, watched."""

import struct
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from rclpy._rclpy_pybind11 import RCLError
from rclpy.node import Node
from rclpy.serialization import deserialize_message

from push_estimation.pose_gate import PoseGate, PoseGateSettings, Stamp
from push_model.arrays import Array
from push_msgs.msg import Poses
from push_ros.conversions import poses_from_ros, time_from_ros
from push_ros.diagnostics import Diagnostics
from push_ros.names import Names
from push_ros.pace_feed import LivenessClock
from push_ros.qos import STREAM
from push_ros.validation import FRAME, InvalidMessage


@dataclass(frozen=True)
class Frame:
    """stamp: of the message; verdict on it; seen: accepted poses ``(3,)`` by name, in the order of
    the message; elapsed [s] since the frame before, 0 where that is not known."""

    stamp: Any
    verdict: Stamp
    seen: Mapping[str, Array]
    elapsed: float


class PoseFeed:
    """Subscribes to ``poses``; calls ``on_frame`` for each frame, refused ones included.

    clock: measures silence, of the poses and of other nodes; see ``LivenessClock``.
    """

    def __init__(
        self,
        node: Node,
        names: Names,
        settings: PoseGateSettings,
        bodies: Collection[str],
        diagnostics: Diagnostics,
        on_frame: Callable[[Frame], None],
        period: float = 0.0,
        meet: Callable[[Collection[str]], Collection[str]] = lambda names: (),
    ) -> None:
        """bodies: whose poses are wanted; others are not kept. period: [s] frames that follow the
        last one sooner are not even deserialised. meet: called when a frame names other bodies than
        the one before; those that it returns are wanted too, from the next frame on."""
        self.gate = PoseGate(settings, bodies)
        self.topic = names.world("poses")
        self.clock = LivenessClock(node, names, lambda: self.gate.stamp)
        self._node = node
        self._diagnostics = diagnostics
        self._on_frame = on_frame
        self._period, self._meet = period, meet
        self._names: list[str] = []
        self._last = self.clock.now
        node.create_subscription(
            Poses,
            self.topic,
            self._on_data,
            STREAM,
            event_callbacks=diagnostics.subscription_events(self.topic),
            raw=True,
        )
        diagnostics.watch_publishers(self.topic)

    @property
    def stamp(self) -> float:
        """[s] of the last accepted frame."""
        return self.gate.stamp

    @property
    def paused(self) -> bool:
        """Whether the world stands still."""
        return self.clock.paused

    @property
    def silence(self) -> float:
        """[s] Wall time without a frame.

        Always 0 while the world is paused, and in lockstep, where the next frame may take any time.
        """
        if self.clock.paused or self.clock.lockstep:
            return 0.0
        return self.clock.now - self._last

    def pose(self, name: str) -> Array | None:
        """The last accepted pose ``(3,)``; None when there is none or it is stale."""
        return self.gate.pose(name)

    def discs(self, radii: Mapping[str, float]) -> Array:
        """``(k, 3)`` x, y, radius [m] of bodies that are seen, of radii [m] by name."""
        found = [[*p[:2], r] for name, r in radii.items() if (p := self.pose(name)) is not None]
        return np.array(found).reshape(-1, 3)

    def ages(self, names: Iterable[str], frame: Frame) -> dict[str, float]:
        """[s] since the last pose of each of the bodies that a frame does not show, by name."""
        return {name: self.gate.age(name) for name in names if name not in frame.seen}

    def _on_data(self, data: bytes) -> None:
        try:
            # CDR: four bytes of encapsulation, then the header's stamp.
            seconds, nanoseconds = struct.unpack_from("<iI", data, 4)
            if 0.0 <= seconds + 1e-9 * nanoseconds - self.gate.stamp < self._period:
                return
            message = deserialize_message(data, Poses)
        except (struct.error, RuntimeError, RCLError) as error:
            self._diagnostics.refuse(self.topic, f"the message cannot be read: {error}")
            return
        self.take(message)

    def take(self, message: Poses) -> None:
        """Judge a frame and hand it on."""
        if message.header.frame_id != FRAME:
            self._diagnostics.refuse(
                self.topic, f"its frame is '{message.header.frame_id}', expected '{FRAME}'"
            )
            return
        try:
            poses, refused = poses_from_ros(message, self.gate.bodies)
        except InvalidMessage as error:
            self._diagnostics.refuse(self.topic, str(error))
            return
        before = self.gate.stamp
        verdict = self.gate.begin(time_from_ros(message.header.stamp))
        seen: dict[str, Array] = {}
        if verdict is Stamp.REFUSED:
            self._diagnostics.refuse(self.topic, self.gate.refusal)
        else:
            self._last = self.clock.now
            for text in refused:
                self.gate.refused += 1
                self._diagnostics.refuse(self.topic, text)
            seen = {name: pose for name, pose in poses.items() if self.gate.accept(name, pose)}
            if message.names != self._names:
                self._names = list(message.names)
                self.gate.admit(self._meet(self._names))
        known = verdict is Stamp.OK and before > 0.0
        elapsed = self.gate.stamp - before if known else 0.0
        self._on_frame(Frame(message.header.stamp, verdict, seen, elapsed))
