"""Two bags, message by message: equal to the bit, or the first difference."""

import struct
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from push_record.bag import RawRecord, read_raw
from push_record.interfaces import typestore
from push_ros.services import CALLS, RESTARTS
from push_scenario.files import parse_yaml

WALL_TOPICS = ("diagnostics",)
"""Topics whose messages are sent by a timer of wall time; they are not compared."""
COSTS = ("solve_time", "plan_time")
"""Fields that measure CPU or wall time, in any message; they are not compared."""
WALL_STAMPS = ("push_msgs/msg/PushPlan", "push_msgs/msg/GroupPlan", "nav_msgs/msg/Path")
"""Types whose stamps are wall time, because a plan belongs to no frame of poses."""

_CLOCK = "clock"
_SCENARIO = "scenario"
_SHORT = 120  # characters of a text that are shown


@dataclass(frozen=True)
class Difference:
    """Where two bags differ.

    time: [s] log time. index: number of the message on its topic, from 0 at the first tick;
    -1 before it. field: e.g. ``poses[3].x``; empty where one bag lacks the message.
    """

    topic: str
    time: float
    index: int
    field: str
    first: str
    second: str

    def __str__(self) -> str:
        which = f"message {self.index}" if self.index >= 0 else "before the first tick"
        where = f"{self.topic} at {self.time:.3f} s ({which})"
        what = f"{where}, {self.field}" if self.field else where
        return f"{what}: {self.first} in the first bag, {self.second} in the second"


@dataclass
class TopicCount:
    """Messages of a topic: compared pairs, unequal ones, and those that only one bag has."""

    pairs: int = 0
    unequal: int = 0
    only_first: int = 0
    only_second: int = 0
    difference: Difference | None = None
    place: int = 0

    @property
    def equal(self) -> bool:
        """Whether nothing differs."""
        return self.difference is None


@dataclass
class Comparison:
    """What two bags have in common. topics: by name. settings: differences of the scenario texts,
    a line each. beyond: messages of the second bag after the end of the first."""

    topics: dict[str, TopicCount] = field(default_factory=dict)
    settings: list[str] = field(default_factory=list)
    beyond: int = 0

    @property
    def equal(self) -> bool:
        """Whether every compared message is equal to the bit."""
        return not self.settings and all(t.equal for t in self.topics.values())

    @property
    def messages(self) -> int:
        """Number of compared pairs."""
        return sum(t.pairs for t in self.topics.values())

    @property
    def first(self) -> Difference | None:
        """The difference that comes first in the first bag."""
        found = [t for t in self.topics.values() if t.difference is not None]
        return min(found, key=lambda t: t.place).difference if found else None


def compare_bags(first: Path, second: Path) -> Comparison:
    """Compare all messages, topic by topic, in order.

    Before the first tick, only the last message of a topic counts: until then the nodes discover
    each other. Messages of the second bag at or after the last log time of the first count only as
    partners, because the recording of the first had ended.
    """
    return _Comparer(first, second).run()


class _Comparer:
    def __init__(self, first: Path, second: Path) -> None:
        self._bags = first, second
        self._store = typestore()
        self._result = Comparison()
        self._queues: tuple[dict[str, deque[Any]], ...] = ({}, {})
        self._end = 0

    def run(self) -> Comparison:
        starts: tuple[dict[str, RawRecord], ...] = ({}, {})
        sources = [_after_start(bag, start) for bag, start in zip(self._bags, starts, strict=True)]
        heads = [next(source, None) for source in sources]
        self._compare_starts(*starts)
        place = 0
        while heads[0] is not None or heads[1] is not None:
            place += 1
            for side in (0, 1):
                record = heads[side]
                if record is not None:
                    self._take(side, place, record)
                    heads[side] = next(sources[side], None)
        self._finish()
        return self._result

    def _compare_starts(self, first: dict[str, RawRecord], second: dict[str, RawRecord]) -> None:
        for topic in first.keys() & second.keys():
            a, b = first[topic], second[topic]
            if topic.rpartition("/")[2] == _SCENARIO and a.data != b.data:
                texts = (str(self._message(r).data) for r in (a, b))
                self._result.settings += changed_settings(*texts)
                continue
            count = self._result.topics.setdefault(topic, TopicCount())
            count.pairs += 1
            self._compare(count, -1, 0, a, b)

    def _take(self, side: int, place: int, record: RawRecord) -> None:
        if side == 0:
            self._end = max(self._end, record.stamp)
        mine = self._queues[side].setdefault(record.topic, deque())
        theirs = self._queues[1 - side].setdefault(record.topic, deque())
        mine.append((place, record))
        while mine and theirs:
            (place, a), (_, b) = (mine.popleft(), theirs.popleft())
            a, b = (a, b) if side == 0 else (b, a)
            count = self._result.topics.setdefault(record.topic, TopicCount())
            count.pairs += 1
            self._compare(count, count.pairs - 1, place, a, b)

    def _finish(self) -> None:
        for side, queues in enumerate(self._queues):
            for topic, queue in queues.items():
                if not queue:
                    continue
                count = self._result.topics.setdefault(topic, TopicCount())
                late = [q for q in queue if side == 1 and q[1].stamp >= self._end]
                self._result.beyond += len(late)
                missing = [q for q in queue if not (side == 1 and q[1].stamp >= self._end)]
                if not missing:
                    continue
                if side == 0:
                    count.only_first = len(missing)
                else:
                    count.only_second = len(missing)
                place, record = missing[0]
                words = ("a message", "none") if side == 0 else ("none", "a message")
                self._note(
                    count,
                    place,
                    Difference(topic, 1e-9 * record.stamp, count.pairs, "", *words),
                )

    def _compare(
        self, count: TopicCount, index: int, place: int, a: RawRecord, b: RawRecord
    ) -> None:
        if a.data == b.data and a.type == b.type:
            return
        if a.type != b.type:
            found: tuple[str, str, str] | None = ("type", a.type, b.type)
        else:
            skip = COSTS + (("stamp",) if a.type in WALL_STAMPS else ())
            found = first_difference(self._message(a), self._message(b), skip)
        if found is None:
            return
        count.unequal += 1
        self._note(count, place, Difference(a.topic, 1e-9 * a.stamp, index, *found))

    def _note(self, count: TopicCount, place: int, difference: Difference) -> None:
        if count.difference is None or place < count.place:
            count.difference, count.place = difference, place

    def _message(self, record: RawRecord) -> Any:
        return self._store.deserialize_cdr(record.data, record.type)


def _after_start(bag: Path, start: dict[str, RawRecord]) -> Iterator[RawRecord]:
    """Messages from the first tick on; the last one of each topic before it goes into ``start``.

    They end where time begins anew, because somebody reset the world or loaded another scenario.
    """
    begun, now = False, -1
    for record in read_raw(bag):
        last = record.topic.rpartition("/")[2]
        if last in WALL_TOPICS:
            continue
        if last == _CLOCK:
            begun, before, now = True, now, _time(record)
            if now < before:
                return
        if last == CALLS and any(kind.encode() in bytes(record.data) for kind in RESTARTS):
            return
        if begun:
            yield record
        else:
            start[record.topic] = record


def _time(record: RawRecord) -> int:
    """[ns] that a message of the clock tells; it lies behind the four bytes of the CDR header."""
    seconds, nanoseconds = struct.unpack_from("<iI", record.data, 4)
    return 1_000_000_000 * int(seconds) + int(nanoseconds)


def first_difference(
    a: Any, b: Any, skip: tuple[str, ...] = (), path: str = ""
) -> tuple[str, str, str] | None:
    """The first field in which two messages differ to the bit, with both values as text.

    skip: names of fields that are not compared, at any depth.
    """
    if is_dataclass(a):
        for item in fields(a):
            if item.name in skip or item.name.startswith("__"):
                continue
            inner = f"{path}.{item.name}" if path else item.name
            found = first_difference(getattr(a, item.name), getattr(b, item.name), skip, inner)
            if found is not None:
                return found
        return None
    if isinstance(a, np.ndarray):
        return _array_difference(a, np.asarray(b), path)
    if isinstance(a, (list, tuple)):
        if len(a) != len(b):
            return f"{path} (length)", str(len(a)), str(len(b))
        for k, (one, other) in enumerate(zip(a, b, strict=True)):
            found = first_difference(one, other, skip, f"{path}[{k}]")
            if found is not None:
                return found
        return None
    if isinstance(a, float):
        same = np.float64(a).tobytes() == np.float64(b).tobytes()
        return None if same else (path, repr(float(a)), repr(float(b)))
    return None if a == b else (path, _shown(a), _shown(b))


def _array_difference(a: Any, b: Any, path: str) -> tuple[str, str, str] | None:
    if a.shape != b.shape:
        return f"{path} (length)", str(len(a)), str(len(b))
    if a.tobytes() == b.tobytes():
        return None
    width = a.dtype.itemsize
    bits = [np.frombuffer(x.tobytes(), dtype=np.uint8).reshape(-1, width) for x in (a, b)]
    k = int(np.flatnonzero((bits[0] != bits[1]).any(axis=1))[0])
    values = [repr(x.reshape(-1)[k].item()) for x in (a, b)]
    return f"{path}[{k}]", values[0], values[1]


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= _SHORT else text[: _SHORT - 1] + "…"


def changed_settings(first: str, second: str) -> list[str]:
    """Values in which two scenario texts differ, a line each."""
    pairs = [_flat(parse_yaml(text, "scenario")) for text in (first, second)]
    found = []
    for key in dict.fromkeys((*pairs[0], *pairs[1])):
        one, other = (_shown(p[key]) if key in p else "nothing" for p in pairs)
        if one != other:
            found.append(f"{key}: {one} in the first bag, {other} in the second")
    return found


def _flat(value: Any, path: str = "") -> dict[str, Any]:
    """Nested values by dotted keys, e.g. ``parameters.planner.push_speed``."""
    if isinstance(value, Mapping) and value:
        pairs = [(f"{path}.{key}" if path else str(key), v) for key, v in value.items()]
    elif isinstance(value, list) and value:
        pairs = [(f"{path}[{k}]", v) for k, v in enumerate(value)]
    else:
        return {path: value}
    return {k: v for name, inner in pairs for k, v in _flat(inner, name).items()}
