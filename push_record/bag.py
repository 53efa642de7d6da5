"""Bags: rosbag2 folders with one MCAP file, written in small chunks so that a killed writer loses
little, readable by rosbag2, Foxglove, the ``rosbags`` and the ``mcap`` libraries."""

import contextlib
import struct
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from mcap.exceptions import McapError
from mcap.records import Channel, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

from push_record.interfaces import typestore
from push_record.older_messages import OlderMessages

_CHUNK = 64 * 1024  # [bytes]
_FLUSH_EVERY = 1.0  # [s] wall time
_MAGIC = b"\x89MCAP0\r\n"  # at both ends of a finished file
_MAXIMUM = {"sec": 9223372036, "nsec": 854775807}


@dataclass
class _Topic:
    type: str
    channel: int
    latched: bool
    count: int = 0


class BagWriter:
    """Writes one bag. ``metadata`` (scenario, seed, revision) goes inside the file."""

    def __init__(self, folder: Path, metadata: Mapping[str, str]) -> None:
        """Raises FileExistsError if the folder exists already."""
        folder.mkdir(parents=True)
        self.folder = folder
        self._file = (folder / f"{folder.name}_0.mcap").open("wb")
        self._writer = Writer(self._file, chunk_size=_CHUNK, compression=CompressionType.NONE)
        self._writer.start("ros2", "planar-push")
        self._writer.add_metadata("planar_push", dict(metadata))
        self._metadata = dict(metadata)
        self._store = typestore()
        self._topics: dict[str, _Topic] = {}
        self._first = self._last = 0
        self._flushed = time.monotonic()
        self._sequence = 0
        self.closed = False

    def add_topic(self, topic: str, message_type: str, latched: bool) -> None:
        """Register a topic, e.g. type ``push_msgs/msg/Poses``."""
        definition, _ = self._store.generate_msgdef(message_type, ros_version=2)
        schema = self._writer.register_schema(message_type, "ros2msg", definition.encode())
        qos = yaml.safe_dump([_qos(latched)])
        channel = self._writer.register_channel(topic, "cdr", schema, {"offered_qos_profiles": qos})
        self._topics[topic] = _Topic(message_type, channel, latched)

    def write(self, topic: str, stamp: int, data: bytes) -> None:
        """Append a serialised message with its log time [ns]."""
        entry = self._topics[topic]
        self._sequence += 1
        self._writer.add_message(entry.channel, stamp, data, stamp, self._sequence)
        entry.count += 1
        self._first = min(self._first, stamp) if self._sequence > 1 else stamp
        self._last = max(self._last, stamp)
        now = time.monotonic()
        if now - self._flushed > _FLUSH_EVERY:
            self._flushed = now
            self._writer.flush()
            self._file.flush()
            self._write_metadata()

    def attach(self, name: str, media_type: str, data: bytes) -> None:
        """Put a file into the bag."""
        self._writer.add_attachment(0, self._last, name, media_type, data)

    @property
    def last(self) -> int:
        """[ns] greatest log time so far."""
        return self._last

    def count(self, topic: str) -> int:
        """Messages of a topic so far."""
        return self._topics[topic].count

    def close(self) -> None:
        """Finish the file; safe to call twice."""
        if self.closed:
            return
        self.closed = True
        self._writer.finish()
        self._file.close()
        self._write_metadata()

    def abandon(self) -> None:
        """Stop writing when nothing more can be written; complete chunks stay readable."""
        self.closed = True
        with contextlib.suppress(OSError):
            self._file.close()

    def _write_metadata(self) -> None:
        topics = [
            {
                "topic_metadata": {
                    "name": name,
                    "type": t.type,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": [_qos(t.latched)],
                    "type_description_hash": self._store.hash_rihs01(t.type),
                },
                "message_count": t.count,
            }
            for name, t in self._topics.items()
        ]
        total = sum(t.count for t in self._topics.values())
        duration = {"nanoseconds": max(0, self._last - self._first)}
        start = {"nanoseconds_since_epoch": self._first}
        name = f"{self.folder.name}_0.mcap"
        information = {
            "version": 9,
            "storage_identifier": "mcap",
            "duration": duration,
            "starting_time": start,
            "message_count": total,
            "topics_with_message_count": topics,
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [name],
            "files": [
                {"path": name, "starting_time": start, "duration": duration, "message_count": total}
            ],
            "custom_data": self._metadata,
            "ros_distro": "jazzy",
        }
        text = yaml.safe_dump({"rosbag2_bagfile_information": information}, sort_keys=False)
        temporary = self.folder / ".metadata.yaml"
        temporary.write_text(text)
        temporary.replace(self.folder / "metadata.yaml")


def _qos(latched: bool) -> dict[str, Any]:
    return {
        "history": "keep_last",
        "depth": 1 if latched else 10,
        "reliability": "reliable",
        "durability": "transient_local" if latched else "volatile",
        "deadline": _MAXIMUM,
        "lifespan": _MAXIMUM,
        "liveliness": "automatic",
        "liveliness_lease_duration": _MAXIMUM,
        "avoid_ros_namespace_conventions": False,
    }


@dataclass(frozen=True)
class Record:
    """A message of a bag: topic, log time [ns], message as a rosbags dataclass."""

    topic: str
    stamp: int
    message: Any


def bag_file(bag: Path) -> Path:
    """The MCAP file of a bag folder, or the path itself."""
    if bag.is_file():
        return bag
    if not bag.is_dir():
        raise FileNotFoundError(f"{bag}: no such bag")
    files = sorted(bag.glob("*.mcap"))
    if not files:
        raise FileNotFoundError(f"{bag}: no .mcap file in it")
    return files[0]


def read_metadata(bag: Path) -> dict[str, str]:
    """Scenario, seed and revision of a bag."""
    for record in _records(bag):
        if isinstance(record, Metadata) and record.name == "planar_push":
            return dict(record.metadata)
    return {}


def is_complete(bag: Path) -> bool:
    """Whether the file was finished; not if its writer was killed."""
    with bag_file(bag).open("rb") as file:
        file.seek(0, 2)
        if file.tell() < 2 * len(_MAGIC):
            return False
        file.seek(-len(_MAGIC), 2)
        return file.read() == _MAGIC


def _records(bag: Path) -> Iterator[Any]:
    """All records, up to the end of a truncated file."""
    with bag_file(bag).open("rb") as file:
        try:
            yield from StreamReader(file).records
        except (McapError, EOFError, ValueError, struct.error):
            return


@dataclass(frozen=True)
class RawRecord:
    """A serialised message of a bag: topic, type, log time [ns], CDR bytes."""

    topic: str
    type: str
    stamp: int
    data: bytes


def read_channels(bag: Path) -> list[tuple[str, str, bool]]:
    """Name, type, and whether it is latched, of each topic, in the order of the file."""
    schemas: dict[int, str] = {}
    found: dict[str, tuple[str, str, bool]] = {}
    for record in _records(bag):
        if isinstance(record, Schema):
            schemas[record.id] = record.name
        elif isinstance(record, Channel):
            latched = "transient_local" in record.metadata.get("offered_qos_profiles", "")
            found.setdefault(record.topic, (record.topic, schemas[record.schema_id], latched))
    return list(found.values())


def read_bag(bag: Path, topics: set[str] | None = None) -> Iterator[Record]:
    """Messages in file order; of a truncated bag, those of its complete chunks. Those of another
    version of this project are converted (older_messages.py)."""
    store = typestore()
    for raw in read_raw(bag, topics):
        yield Record(raw.topic, raw.stamp, store.deserialize_cdr(raw.data, raw.type))


def read_raw(bag: Path, topics: set[str] | None = None) -> Iterator[RawRecord]:
    """As ``read_bag``, without deserialising."""
    older = OlderMessages()
    schemas: dict[int, str] = {}
    channels: dict[int, tuple[str, str]] = {}
    for record in _records(bag):
        if isinstance(record, Schema):
            schemas[record.id] = record.name
            older.define(record.name, record.data.decode(errors="replace"))
        elif isinstance(record, Channel):
            channels[record.id] = (record.topic, schemas[record.schema_id])
        elif isinstance(record, Message):
            topic, kind = channels[record.channel_id]
            if topics is None or topic in topics:
                data = older.present(kind, record.data)
                yield RawRecord(topic, kind, record.log_time, data)


def older_types(bag: Path) -> list[str]:
    """Message types whose definition in the bag is not the present one."""
    older = OlderMessages()
    for record in _records(bag):
        if isinstance(record, Schema):
            older.define(record.name, record.data.decode(errors="replace"))
    return sorted(older.types)


def recover(bag: Path, folder: Path) -> int:
    """Copy the readable part of a truncated bag into a new one; returns the message count."""
    if folder.exists():
        raise FileExistsError(f"{folder} exists already; choose another folder for the bag")
    writer = BagWriter(folder, read_metadata(bag))
    count = 0
    try:
        for topic, kind, latched in read_channels(bag):
            writer.add_topic(topic, kind, latched)
        for record in read_raw(bag):
            writer.write(record.topic, record.stamp, record.data)
            count += 1
    finally:
        writer.close()
    return count
