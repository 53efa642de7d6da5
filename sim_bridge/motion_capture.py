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
_AT_A_TICK = 1e-6
"""[ticks] Instants that are nearer to a tick are at it."""
_LEAST_STEP = 0.05
"""[ticks] Between the instants that two frames show, at least."""


@dataclass(frozen=True)
class Frame:
    """stamp: instant of the measurement, in ticks; poses: of the bodies seen."""

    stamp: float
    poses: BodyPoses


class MotionCapture:
    """White noise, drop-outs and a latency with jitter.

    A frame comes out at every tick. It shows the instant that lies the latency before that tick:
    between two ticks the poses are interpolated. No frame shows an instant before that of an
    earlier frame: where the jitter would have it overtaken, it shows an instant shortly after.

    All randomness comes from the seed, and each body has its own: what becomes of one does not
    change with who else is there.
    """

    def __init__(self, settings: MotionCaptureSettings, seed: int) -> None:
        self._settings = settings
        self._jitter = min(settings.latency_jitter, settings.latency) * settings.rate
        self._latency = settings.latency * settings.rate
        self._noisy = settings.position_noise > 0.0 or settings.orientation_noise > 0.0
        p, o = settings.position_noise, settings.orientation_noise
        self._scale = np.array([p, p, o])
        self.reset(seed)

    @property
    def longest_latency(self) -> float:
        """[s]"""
        return (self._latency + self._jitter) / self._settings.rate

    @property
    def applied_latency(self) -> tuple[float, float]:
        """[s] Mean and standard deviation of the latency of the frames so far; nan before one."""
        if not self._frames:
            return math.nan, math.nan
        spread = math.sqrt(max(0.0, self._squares / self._frames))
        return self._mean / self._settings.rate, spread / self._settings.rate

    def reset(self, seed: int) -> None:
        """Drop the frames that are delayed, and restart the random numbers."""
        self._noise = _Draws(seed, "noise", 3)
        self._chance = _Draws(seed, "dropout", 1)
        self._late = np.random.default_rng([seed, _number("latency")])
        self._past: deque[tuple[int, BodyPoses]] = deque()
        self._shown: float | None = None  # [ticks] instant of the last frame
        self._hidden: dict[str, list[tuple[int, int]]] = {}
        self._frames, self._mean, self._squares = 0, 0.0, 0.0

    def hide(self, names: Sequence[str], until: int) -> None:
        """Hide some bodies until a tick."""
        now = self._past[-1][0] if self._past else 0
        for name in names:
            self._hidden.setdefault(name, []).append((now, until))

    def observe(self, tick: int, truth: BodyPoses) -> Frame | None:
        """Store the true poses of a tick, and return the frame that it publishes, if any."""
        self._past.append((tick, truth))
        instant = self._instant(tick)
        if instant < self._past[0][0]:
            return None
        true = self._at(instant)
        table = true.table
        if self._noisy:
            table = table + self._noise.next(true.names) * self._scale
        seen, keep = BodyPoses(true.names, table), self._kept(instant, true.names)
        self._shown = instant
        self._count(tick - instant)
        return Frame(instant, seen if keep is None else seen.only(keep))

    def _instant(self, tick: int) -> float:
        """[ticks] What the frame that is published at a tick shows."""
        latency = self._latency
        if self._jitter > 0.0:
            latency += self._jitter * float(self._late.uniform(-1.0, 1.0))
        instant = tick - latency
        if abs(instant - round(instant)) < _AT_A_TICK:
            instant = float(round(instant))
        if self._shown is not None:
            instant = max(instant, self._shown + _LEAST_STEP)
        return instant

    def _at(self, instant: float) -> BodyPoses:
        """The truth at an instant [ticks]; what is older is forgotten."""
        past = self._past
        while len(past) > 1 and past[1][0] <= instant:
            past.popleft()
        tick, before = past[0]
        if instant == tick or len(past) == 1:
            return before
        part, after = instant - tick, past[1][1]
        if before.names != after.names:  # somebody was removed or added in between
            before, after = _common(before, after)
        step = after.table - before.table
        step[:, 2] = _wrapped(step[:, 2])
        table = before.table + part * step
        table[:, 2] = _wrapped(table[:, 2])
        return BodyPoses(after.names, table)

    def _count(self, latency: float) -> None:
        self._frames += 1
        off = latency - self._mean
        self._mean += off / self._frames
        self._squares += off * (latency - self._mean)

    def _kept(self, instant: float, names: tuple[str, ...]) -> Mask | None:
        """The bodies that are seen at an instant [ticks]; None if all are."""
        keep: Mask | None = None
        if self._settings.dropout > 0.0:
            keep = self._chance.next(names)[:, 0] >= self._settings.dropout
        if self._hidden:
            self._hidden = {
                name: left
                for name, spans in self._hidden.items()
                if (left := [span for span in spans if span[1] > instant])
            }
            gone = {n for n, spans in self._hidden.items() if any(a < instant for a, _ in spans)}
            visible = np.array([n not in gone for n in names], dtype=bool)
            keep = visible if keep is None else keep & visible
        return keep


def _common(first: BodyPoses, second: BodyPoses) -> tuple[BodyPoses, BodyPoses]:
    """The bodies that are in both, in the order of the second."""
    names = tuple(n for n in second.names if n in first)
    tables = (np.array([p[n] for n in names]).reshape(-1, 3) for p in (first, second))
    one, two = (BodyPoses(names, table) for table in tables)
    return one, two


def _wrapped(angle: Array) -> Array:
    result: Array = np.pi - (np.pi - angle) % (2.0 * np.pi)
    return result


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
