"""Poses from a motion-capture server by the Python package ``motioncapture``.

The package has no stamps of capture: a frame counts for the time of its arrival.
"""

import threading
import time
from collections import deque
from typing import Any

import numpy as np
from rclpy.clock import Clock, ClockType

from lab_bridge.marker_mapping import Marker
from lab_bridge.pose_drivers import PoseHost
from push_model.settings import SettingsError
from push_scenario.lab import MotionCaptureSource

_POLL = 0.002  # [s] between two looks at what the thread has heard
_AGAIN = 2.0  # [s] until the next try; robots have been stopped by then
_MOST = 8  # frames that wait


class MotionCaptureDriver:
    """See PoseDriver. A thread waits for frames; the node takes them from a queue."""

    def __init__(self, host: PoseHost, source: MotionCaptureSource) -> None:
        try:
            import motioncapture
        except ImportError as error:
            raise SettingsError(
                f"lab.poses: the package motioncapture is needed: pip install 'planar-push[lab]' "
                f"({error})"
            ) from None
        self._host, self._source = host, source
        self._connect = motioncapture.connect
        self.sources = (f"{source.system} {source.options.get('hostname', '')}".strip(),)
        self._heard: deque[dict[str, Marker]] = deque(maxlen=_MOST)
        self._troubles: deque[str] = deque(maxlen=_MOST)
        self._open = True
        self._timer = host.node.create_timer(
            _POLL, self._on_timer, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        """On the thread."""
        while self._open:
            try:
                server = self._connect(self._source.system, dict(self._source.options))
                while self._open:
                    server.waitForNextFrame()
                    self._heard.append({n: _marker(b) for n, b in server.rigidBodies.items()})
            except Exception as error:
                self._troubles.append(str(error) or type(error).__name__)
                time.sleep(_AGAIN)

    def _on_timer(self) -> None:
        while self._troubles:
            self._host.sink.refuse(self.sources[0], self._troubles.popleft())
        while self._heard:
            self._host.sink.frame(self._heard.popleft(), None)

    def close(self) -> None:
        """See PoseDriver."""
        self._open = False
        self._host.node.destroy_timer(self._timer)


def _marker(body: Any) -> Marker:
    q = body.rotation
    return Marker(np.array(body.position, dtype=np.float64), np.array([q.x, q.y, q.z, q.w]))


DRIVER = MotionCaptureDriver
