"""Poses that arrive one by one become frames: one for each instant of measurement."""

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Generic, TypeVar

T = TypeVar("T")


@dataclass(frozen=True)
class Assembled(Generic[T]):
    """A frame. stamp: [s] of its first measurement. arrived: [s] of the last part, monotonic."""

    stamp: float
    parts: dict[str, T]
    arrived: float


@dataclass
class _Open(Generic[T]):
    stamp: float
    since: float
    arrived: float
    parts: dict[str, T] = field(default_factory=dict)


class FrameAssembler(Generic[T]):
    """Collects the parts of a frame until all wanted names are there, or one comes again, or a part
    is of a later instant, or the frame has waited long enough.

    Times are passed in. ``hold``: [s] that a frame waits, and that its stamps may differ.
    """

    def __init__(self, wanted: Collection[str], hold: float) -> None:
        self._wanted, self._hold = frozenset(wanted), hold
        self._open: _Open[T] | None = None

    def add(self, name: str, part: T, stamp: float, now: float) -> list[Assembled[T]]:
        """A part of a stamp [s] arrived at a monotonic time now [s]; frames that are complete."""
        done: list[Assembled[T]] = []
        held = self._open
        if held is not None and (name in held.parts or abs(stamp - held.stamp) > self._hold):
            done += self._close()
            held = None
        if held is None:
            held = self._open = _Open(stamp, now, now)
        held.parts[name] = part
        held.arrived = now
        if held.parts.keys() >= self._wanted:
            done += self._close()
        return done

    def poll(self, now: float) -> list[Assembled[T]]:
        """The frame that has waited long enough at a monotonic time now [s]."""
        if self._open is None or now - self._open.since < self._hold:
            return []
        return self._close()

    def _close(self) -> list[Assembled[T]]:
        held, self._open = self._open, None
        return [] if held is None else [Assembled(held.stamp, held.parts, held.arrived)]
