"""FAULTS 19: bags that others can read, and bags whose writer was killed."""

import os
import signal
import subprocess
import sys

import numpy as np
import pytest
from mcap.reader import make_reader
from rclpy.serialization import serialize_message
from rosbags.highlevel import AnyReader

from push_record.bag import BagWriter, bag_file, read_bag, read_metadata, recover
from push_ros.conversions import poses_to_ros

META = {"scenario": "a: 1", "seed": "7"}


def message(k):
    return bytes(serialize_message(poses_to_ros({"box": np.array([0.5 * k, 0.0, 0.0])}, k)))


def write(folder, count):
    writer = BagWriter(folder, META)
    writer.add_topic("/poses", "push_msgs/msg/Poses", False)
    writer.add_topic("/text", "std_msgs/msg/String", True)
    for k in range(count):
        writer.write("/poses", k * 10**7, message(k))
    return writer


def test_bag_opens_in_rosbags_and_mcap(tmp_path):
    write(tmp_path / "bag", 100).close()
    with AnyReader([tmp_path / "bag"]) as reader:
        (connection,) = [c for c in reader.connections if c.topic == "/poses"]
        assert connection.msgtype == "push_msgs/msg/Poses" and connection.msgcount == 100
        values = [
            reader.deserialize(d, c.msgtype).x[0] for c, _, d in reader.messages([connection])
        ]
        assert values == [0.5 * k for k in range(100)]
    with bag_file(tmp_path / "bag").open("rb") as file:
        reader = make_reader(file)
        assert reader.get_summary().statistics.message_count == 100
        assert next(iter(reader.iter_metadata())).metadata["seed"] == "7"
    assert read_metadata(tmp_path / "bag") == META
    assert [r.message.header.stamp.sec for r in read_bag(tmp_path / "bag")] == list(range(100))


def test_an_existing_bag_is_not_overwritten(tmp_path):
    write(tmp_path / "bag", 1).close()
    with pytest.raises(FileExistsError):
        write(tmp_path / "bag", 1)


def test_killed_writer_keeps_its_whole_chunks(tmp_path):
    code = (
        "import sys, os, signal; sys.path.insert(0, sys.argv[2]);\n"
        "from tests.push_record.test_bag import write\n"
        "from pathlib import Path\n"
        "w = write(Path(sys.argv[1]), 5000); w._file.flush(); os.kill(os.getpid(), signal.SIGKILL)"
    )
    root = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    done = subprocess.run([sys.executable, "-c", code, str(tmp_path / "bag"), root], check=False)
    assert done.returncode == -signal.SIGKILL
    kept = [r.message.header.stamp.sec for r in read_bag(tmp_path / "bag")]
    assert len(kept) > 3000 and kept == list(range(len(kept)))
    assert recover(tmp_path / "bag", tmp_path / "whole") == len(kept)
    with AnyReader([tmp_path / "whole"]) as reader:
        assert sum(1 for _ in reader.messages()) == len(kept)


def test_full_disk_ends_the_recording_and_nothing_else(tmp_path, monkeypatch):
    writer = write(tmp_path / "bag", 3000)

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(writer._writer, "add_message", full)
    with pytest.raises(OSError, match="No space"):
        writer.write("/poses", 1, message(1))
    writer.abandon()
    writer.close()  # safe afterwards
    assert len(list(read_bag(tmp_path / "bag"))) > 1000
