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
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from push_msgs.msg import PushPlan, PushSegment, Trajectory
from push_record.bag import BagWriter, bag_file, older_types, read_bag, read_metadata, recover
from push_record.contents import load
from push_record.faults import faults_of
from push_record.interfaces import interface_folder, typestore
from push_record.older_messages import OlderMessages
from push_ros.conversions import poses_to_ros
from push_scenario.scenario import load_scenario

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


@pytest.mark.parametrize("length", [0, 5, 8, 9, 20, 100, 1000])
def test_a_file_that_is_cut_anywhere_is_read_as_far_as_it_goes(tmp_path, length):
    write(tmp_path / "bag", 50).close()
    file = bag_file(tmp_path / "bag")
    file.write_bytes(file.read_bytes()[:length])
    assert list(read_bag(tmp_path / "bag")) == [] or length == 1000
    assert recover(tmp_path / "bag", tmp_path / "new") >= 0
    with pytest.raises(FileExistsError, match="exists already; choose another folder"):
        recover(tmp_path / "bag", tmp_path / "new")


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


def older_store():
    """The interfaces before plans told the bound of their cost, with a field that is gone and one
    that was a text."""
    store = typestore()
    folder = interface_folder("push_msgs") / "msg"
    text = (folder / "PushPlan.msg").read_text()
    assert "float64 cost_bound" in text
    lines = [line for line in text.splitlines() if not line.startswith("float64 cost_bound")]
    lines = [line.replace("float64 clearance", "string clearance") for line in lines]
    types = get_types_from_msg("\n".join(["uint8 mood", *lines]), "push_msgs/msg/PushPlan")
    older = get_typestore(Stores.ROS2_JAZZY)
    own = {
        name: ([], fields[1])
        for name, fields in store.fielddefs.items()
        if name.startswith("push_msgs/") and name != "push_msgs/msg/PushPlan"
    }
    older.register({**own, **types})
    return older


def test_a_bag_of_another_version_is_read_by_the_definitions_that_it_carries(tmp_path, monkeypatch):
    name, older, present = "push_msgs/msg/PushPlan", older_store(), typestore()
    plan = PushPlan(object="box", robot="e1", cost=1.5, length=1.25, clearance=0.02)
    driven = Trajectory(**{k: [0.5, 1.0] for k in ("time", "x", "y", "theta", "v", "omega")})
    plan.segments = [PushSegment(side=2, length=1.25, trajectory=driven)]
    new = present.deserialize_cdr(serialize_message(plan), name)
    kept = {field: getattr(new, field) for field, _ in older.fielddefs[name][1] if field != "mood"}
    kept["clearance"] = "wide"
    data = older.serialize_cdr(older.types[name](mood=3, **kept), name)
    monkeypatch.setattr("push_record.bag.typestore", lambda: older)
    about = {**META, "scenario": load_scenario("short").text}
    writer = BagWriter(tmp_path / "bag", about)
    writer.add_topic("/push_plan", name, True)
    writer.add_topic("/poses", "push_msgs/msg/Poses", False)
    for k in range(3):
        writer.write("/push_plan", k * 10**9, bytes(data))
        writer.write("/poses", k * 10**9, message(k))
    writer.close()
    monkeypatch.undo()
    assert older_types(tmp_path / "bag") == [name]
    recover(tmp_path / "bag", tmp_path / "anew")
    assert older_types(tmp_path / "anew") == []
    for bag in (tmp_path / "bag", tmp_path / "anew"):
        plans = [r.message for r in read_bag(bag, {"/push_plan"})]
        assert len(plans) == 3
        for found in plans:
            assert (found.object, found.robot, found.cost, found.length) == ("box", "e1", 1.5, 1.25)
            assert found.cost_bound == 0.0 and found.clearance == 0.0
            assert found.segments[0].side == 2
            assert found.segments[0].trajectory.x.tolist() == [0.5, 1.0]
        poses = [r.message.x[0] for r in read_bag(bag, {"/poses"})]
        assert poses == [0.0, 0.5, 1.0]
    told = faults_of(tmp_path / "bag", load(tmp_path / "bag"))
    assert [(f.kind, f.where) for f in told] == [("another version", name)]


@pytest.mark.parametrize("text", ["", "no definition", "float64 x\nmore", "Unknown what"])
def test_a_definition_that_cannot_be_read_counts_as_the_present_one(text):
    name, data = "push_msgs/msg/PushPlan", serialize_message(PushPlan(object="box", cost=1.5))
    older = OlderMessages()
    older.define(name, text)
    found = typestore().deserialize_cdr(older.present(name, data), name)
    assert (found.object, found.cost) == ("box", 1.5)
