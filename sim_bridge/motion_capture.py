"""Motion-capture emulation: what a tracking system would have reported, and when."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from push_model.arrays import Array
from sim_bridge.settings import MotionCaptureSettings


@dataclass(frozen=True)
class Frame:
    """stamp: tick number of the measurement; poses: name to ``(3,)`` for the bodies seen."""

    stamp: int
    poses: dict[str, Array]


class MotionCapture:
    """White noise, per-body drop-outs and a fixed latency. All randomness comes from the seed."""

    def __init__(self, settings: MotionCaptureSettings, seed: int) -> None:
        self._settings = settings
        self._delay = round(settings.latency * settings.rate)
        self.reset(seed)

    def reset(self, seed: int) -> None:
        """Forget what is under way and start the noise anew."""
        self._random = np.random.default_rng(seed)
        self._pending: deque[Frame] = deque()

    def observe(self, tick: int, truth: Mapping[str, Array]) -> Frame | None:
        """Measure at a tick; returns the frame that is published at this tick, if there is one."""
        s = self._settings
        scale = np.array([s.position_noise, s.position_noise, s.orientation_noise])
        poses: dict[str, Array] = {}
        for name, pose in truth.items():
            noise = self._random.standard_normal(3) * scale
            seen = self._random.random() >= s.dropout
            if seen:
                poses[name] = pose + noise
        self._pending.append(Frame(tick, poses))
        if self._pending[0].stamp <= tick - self._delay:
            return self._pending.popleft()
        return None
