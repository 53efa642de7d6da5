"""Motion-capture emulation: what a tracking system would have reported, and when."""

import math
import zlib
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from push_model.arrays import Array, Mask
from sim_bridge.settings import MotionCaptureSettings
from sim_bridge.world import BodyPoses

_BLOCK = 64
"""Frames whose random numbers are drawn at once."""


@dataclass(frozen=True)
class Frame:
    """stamp: tick number of the measurement; poses: of the bodies seen."""

    stamp: int
    poses: BodyPoses


class MotionCapture:
    """White noise, drop-outs and a fixed latency.

    All randomness comes from the seed, and each body has its own: what becomes of one does not
    change with who else is there. Frames come out at ticks: at the first one at which the latency
    has passed, never earlier.
    """

    def __init__(self, settings: MotionCaptureSettings, seed: int) -> None:
        self._settings = settings
        self.delay = math.ceil(settings.latency * settings.rate - 1e-6)
        """Ticks from measurement to publication."""
        self._noisy = settings.position_noise > 0.0 or settings.orientation_noise > 0.0
        p, o = settings.position_noise, settings.orientation_noise
        self._scale = np.array([p, p, o])
        self.reset(seed)

    def reset(self, seed: int) -> None:
        """Forget what is under way and start the noise anew."""
        self._noise = _Draws(seed, "noise", 3)
        self._chance = _Draws(seed, "dropout", 1)
        self._pending: deque[Frame] = deque()
        self._hidden: dict[str, int] = {}

    def hide(self, names: Sequence[str], until: int) -> None:
        """Do not see some bodies before a tick."""
        for name in names:
            self._hidden[name] = max(until, self._hidden.get(name, 0))

    def observe(self, tick: int, truth: BodyPoses) -> Frame | None:
        """Measure at a tick; returns the frame that is published at this tick, if there is one."""
        table = truth.table
        if self._noisy:
            table = table + self._noise.next(truth.names) * self._scale
        seen = BodyPoses(truth.names, table)
        keep = self._kept(tick, truth.names)
        self._pending.append(Frame(tick, seen if keep is None else seen.only(keep)))
        if self._pending[0].stamp <= tick - self.delay:
            return self._pending.popleft()
        return None

    def _kept(self, tick: int, names: tuple[str, ...]) -> Mask | None:
        """Who is seen; None for everybody."""
        keep: Mask | None = None
        if self._settings.dropout > 0.0:
            keep = self._chance.next(names)[:, 0] >= self._settings.dropout
        if self._hidden:
            self._hidden = {n: t for n, t in self._hidden.items() if t > tick}
            visible = np.array([n not in self._hidden for n in names], dtype=bool)
            keep = visible if keep is None else keep & visible
        return keep


class _Draws:
    """Random numbers for named bodies, tick by tick; each body's come from a stream of its own."""

    def __init__(self, seed: int, purpose: str, width: int) -> None:
        """purpose: ``noise``, standard normal, or ``dropout``, uniform in [0, 1)."""
        self._seed, self._purpose, self._width = seed, purpose, width
        self._names: tuple[str, ...] | None = None
        self._asked: tuple[str, ...] = ()
        self._rows = np.zeros(0, dtype=np.intp)
        self._at = _BLOCK

    def next(self, names: tuple[str, ...]) -> Array:
        """``(n, width)`` for the next tick. The first call names everybody that there will be."""
        if self._names is None:
            self._names = names
            self._streams = [
                np.random.default_rng([self._seed, *map(_number, (name, self._purpose))])
                for name in names
            ]
        if self._at == _BLOCK:
            self._at = 0
            size = (_BLOCK, self._width)
            normal = self._purpose == "noise"
            blocks = [s.standard_normal(size) if normal else s.random(size) for s in self._streams]
            self._block = np.stack(blocks, axis=1) if blocks else np.zeros((_BLOCK, 0, self._width))
        drawn: Array = self._block[self._at]
        self._at += 1
        if names is self._names or names == self._names:
            return drawn
        if names != self._asked:
            index = {name: row for row, name in enumerate(self._names)}
            self._asked = names
            self._rows = np.array([index[n] for n in names], dtype=np.intp)
        return drawn[self._rows]


def _number(text: str) -> int:
    return zlib.crc32(text.encode())
