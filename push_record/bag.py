"""Bags: rosbag2 folders with one MCAP file, written in small chunks so that a killed writer loses
little, readable by rosbag2, Foxglove, the ``rosbags`` and the ``mcap`` libraries."""

import contextlib
import math
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from mcap.exceptions import RecordLengthLimitExceeded
from mcap.records import Channel, DataEnd, Message, Metadata, Schema
from mcap.stream_reader import CRCValidationError, StreamReader
from mcap.writer import CompressionType, Writer
from rosbags.serde import SerdeError

from push_model.settings import SettingsError
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
        self._writer = Writer(
            self._file,
            chunk_size=_CHUNK,
            compression=CompressionType.NONE,
            enable_data_crcs=True,
        )
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
    for record in _Records(bag):
        if isinstance(record, Metadata) and record.name == "planar_push":
            return dict(record.metadata)
    return {}


@dataclass(frozen=True)
class Ending:
    """Where the reading of a bag ends.

    time: [s] of the last message that can be read; nan if there is none. trouble: ``cut off`` or
    ``damaged``, empty if the file is whole; text: the same in a sentence.
    """

    time: float
    trouble: str
    text: str


def ending(bag: Path) -> Ending:
    """Read a bag to its end, or to where it is cut off or damaged."""
    records, time = _Records(bag), math.nan
    for record in records:
        if isinstance(record, Message):
            time = 1e-9 * record.log_time
    where = "before its first message" if math.isnan(time) else f"at {time:.2f} s"
    text = ""
    if records.trouble == "cut off":
        text = f"the file is cut off {where}, for example because the recorder was killed"
    elif records.somewhere:
        text = "a part of the file is damaged or missing: the checksum of the whole file is wrong"
    elif records.trouble:
        text = f"the file is damaged {where}; what follows is not read"
    return Ending(time, records.trouble, text)


class _Records:
    """All records of a file, up to where it is cut off or damaged.

    trouble: as that of ``Ending``, when all records have been read. somewhere: whether the place of
    the damage is not known.
    """

    def __init__(self, bag: Path) -> None:
        self._path = bag_file(bag)
        self.trouble = ""
        self.somewhere = False

    def __iter__(self) -> Iterator[Any]:
        with self._path.open("rb") as file:
            size = file.seek(0, 2)
            file.seek(max(0, size - len(_MAGIC)))
            finished = size >= 2 * len(_MAGIC) and file.read() == _MAGIC
            file.seek(0)
            reader = StreamReader(file, validate_crcs=True, record_size_limit=size)
            try:
                yield from _known(reader.records)
            except OSError:
                raise
            except Exception as error:  # of the format, or of what decompresses it
                long = isinstance(error, RecordLengthLimitExceeded)
                cut = not finished and (long or not file.read(1))
                self.trouble = "cut off" if cut else "damaged"
                record = error.record if isinstance(error, CRCValidationError) else None
                self.somewhere = isinstance(record, DataEnd)


def _known(records: Iterator[Any]) -> Iterator[Any]:
    """Records whose schema and channel are there; raises KeyError at another one."""
    schemas: set[int] = set()
    channels: set[int] = set()
    for record in records:
        if isinstance(record, Schema):
            schemas.add(record.id)
        elif isinstance(record, Channel):
            if record.schema_id not in schemas:
                raise KeyError(record.schema_id)
            channels.add(record.id)
        elif isinstance(record, Message) and record.channel_id not in channels:
            raise KeyError(record.channel_id)
        yield record


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
    for record in _Records(bag):
        if isinstance(record, Schema):
            schemas[record.id] = record.name
        elif isinstance(record, Channel):
            latched = "transient_local" in record.metadata.get("offered_qos_profiles", "")
            found.setdefault(record.topic, (record.topic, schemas[record.schema_id], latched))
    return list(found.values())


def read_bag(bag: Path, topics: set[str] | None = None) -> Iterator[Record]:
    """Messages in file order; of a truncated or damaged bag, those of the complete chunks before
    that. Those of another version of this project are converted (older_messages.py).

    Raises
    ------
    SettingsError: a message is none of its type.
    """
    store = typestore()
    for raw in read_raw(bag, topics):
        with _readable(bag, raw.topic, raw.stamp):
            message = store.deserialize_cdr(raw.data, raw.type)
        yield Record(raw.topic, raw.stamp, message)


def read_raw(bag: Path, topics: set[str] | None = None) -> Iterator[RawRecord]:
    """As ``read_bag``, without deserialising messages of the present version."""
    older = OlderMessages()
    schemas: dict[int, str] = {}
    channels: dict[int, tuple[str, str]] = {}
    for record in _Records(bag):
        if isinstance(record, Schema):
            schemas[record.id] = record.name
            older.define(record.name, record.data.decode(errors="replace"))
        elif isinstance(record, Channel):
            channels[record.id] = (record.topic, schemas[record.schema_id])
        elif isinstance(record, Message):
            topic, kind = channels[record.channel_id]
            if topics is None or topic in topics:
                with _readable(bag, topic, record.log_time):
                    data = older.present(kind, record.data)
                yield RawRecord(topic, kind, record.log_time, data)


@contextlib.contextmanager
def _readable(bag: Path, topic: str, stamp: int) -> Iterator[None]:
    try:
        yield
    except (SerdeError, IndexError, OverflowError, MemoryError) as error:
        raise SettingsError(
            f"{bag}: the message on {topic} at {1e-9 * stamp:.2f} s cannot be read: {error}"
        ) from None


def older_types(bag: Path) -> list[str]:
    """Message types whose definition in the bag is not the present one."""
    older = OlderMessages()
    for record in _Records(bag):
        if isinstance(record, Schema):
            older.define(record.name, record.data.decode(errors="replace"))
    return sorted(older.types)


def recover(bag: Path, folder: Path) -> int:
    """Copy the readable part of a truncated or damaged bag into a new one; returns the message
    count."""
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
