"""Motion-capture emulation: what a tracking system would have reported, and when."""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim_bridge.settings import MotionCaptureSettings
from sim_bridge.world import BodyPoses


@dataclass(frozen=True)
class Frame:
    """stamp: tick number of the measurement; poses: of the bodies seen."""

    stamp: int
    poses: BodyPoses


class MotionCapture:
    """White noise, per-body drop-outs and a fixed latency. All randomness comes from the seed.

    Frames come out at ticks: at the first one at which the latency has passed, never earlier.
    """

    def __init__(self, settings: MotionCaptureSettings, seed: int) -> None:
        self._settings = settings
        self.delay = math.ceil(settings.latency * settings.rate - 1e-6)
        """Ticks from measurement to publication."""
        self.reset(seed)

    def reset(self, seed: int) -> None:
        """Forget what is under way and start the noise anew."""
        self._random = np.random.default_rng(seed)
        self._pending: deque[Frame] = deque()
        self._hidden: dict[str, int] = {}

    def hide(self, names: Sequence[str], until: int) -> None:
        """Do not see some bodies before a tick."""
        for name in names:
            self._hidden[name] = max(until, self._hidden.get(name, 0))

    def observe(self, tick: int, truth: BodyPoses) -> Frame | None:
        """Measure at a tick; returns the frame that is published at this tick, if there is one."""
        s = self._settings
        scale = np.array([s.position_noise, s.position_noise, s.orientation_noise])
        keep = np.ones(len(truth), dtype=bool)
        table = np.empty((len(truth), 3))
        for i, pose in enumerate(truth.table):
            table[i] = pose + self._random.standard_normal(3) * scale
            keep[i] = self._random.random() >= s.dropout
        if self._hidden:
            self._hidden = {n: t for n, t in self._hidden.items() if t > tick}
            keep &= [n not in self._hidden for n in truth.names]
        self._pending.append(Frame(tick, BodyPoses(truth.names, table).only(keep)))
        if self._pending[0].stamp <= tick - self.delay:
            return self._pending.popleft()
        return None
