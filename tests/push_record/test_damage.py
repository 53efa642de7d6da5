"""FAULTS 21: bags of which bytes are not what was written. The part before is read, and the rest is
named, never taken for what was recorded."""

import struct

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer

from planar_push.main import main
from push_model.settings import SettingsError
from push_record.attach import attach
from push_record.bag import bag_file, ending, read_raw, recover
from push_record.contents import load
from push_record.faults import faults_of
from tests.push_view.test_report import Bag, crowd

END = 40.0
"""[s] of the last poses."""

LAST = 0.123456789012345
"""[m] where the object is then."""


def written(scenario, folder):
    """A job whose object ends at a known place; several chunks."""
    bag = Bag(folder, crowd(scenario, 1, 1))
    for i in range(2001):
        t = 0.02 * i
        x = LAST if i == 2000 else 1e-4 * i
        bag.poses({"r0": np.zeros(3), "box0": np.array([x, 0.0, 0.0])}, t)
    bag.state("/", "IDLE", END, ("r0",), "box0", (LAST, 0.0, 0.0))
    return bag.close()


@pytest.fixture
def bag(scenario, tmp_path):
    return written(scenario, tmp_path / "bag")


def changed(bag, change):
    file = bag_file(bag)
    data = bytearray(file.read_bytes())
    change(data)
    file.write_bytes(data)
    return bag


def hole(data):
    middle = len(data) // 2
    data[middle : middle + 4096] = bytes(4096)


def flip(data):
    data[len(data) // 2] ^= 0x08


@pytest.mark.parametrize("change", [hole, flip])
def test_what_comes_before_the_damage_is_read_and_the_damage_named(bag, tmp_path, change, capsys):
    whole = [(r.topic, r.stamp, r.data) for r in read_raw(bag)]
    assert ending(bag).trouble == "" and ending(bag).time == END
    changed(bag, change)
    end = ending(bag)
    assert end.trouble == "damaged" and 5.0 < end.time < 30.0
    contents = load(bag)
    assert contents.time[-1] == pytest.approx(end.time, abs=0.021)
    (fault,) = [f for f in faults_of(bag, contents) if f.kind == "damaged"]
    assert fault.time == end.time and f"damaged at {end.time:.2f} s" in fault.text
    kept = recover(bag, tmp_path / "new")
    assert kept > 0
    assert [(r.topic, r.stamp, r.data) for r in read_raw(tmp_path / "new")] == whole[:kept]
    assert ending(tmp_path / "new").trouble == ""
    with pytest.raises(SettingsError, match=r"damaged at .* recover"):
        attach(bag, [])
    assert main(["report", str(bag), "--out", str(tmp_path / "out")]) == 0
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "the file is damaged at" in page


def test_a_flipped_bit_of_the_last_pose_is_no_final_error(bag):
    """The object would seem to be 31 mm off."""
    pattern = struct.pack("<d", LAST)

    def change(data):
        places = [k for k in range(len(data)) if data.startswith(pattern, k)]
        assert len(places) >= 2  # of the poses, and of the goal
        data[places[0] + 6] ^= 0x08

    changed(bag, change)
    contents = load(bag)
    assert ending(bag).trouble == "damaged"
    assert contents.time[-1] < END and contents.jobs == {}
    assert "damaged" in [f.kind for f in faults_of(bag, contents)]


def test_damage_outside_of_the_chunks_is_noticed(bag):
    """The scenario has no checksum of its own, only the file has."""

    def change(data):
        data[data.index(b"made")] ^= 0x01

    changed(bag, change)
    assert load(bag).time[-1] == pytest.approx(END)
    (fault,) = [f for f in faults_of(bag, load(bag)) if f.kind == "damaged"]
    assert "the checksum of the whole file is wrong" in fault.text


@pytest.mark.long
def test_random_damage_is_never_silent_and_never_a_traceback(bag, tmp_path):
    """Runs of random or zero bytes anywhere, also in a file that is cut off as well."""
    random = np.random.default_rng(5)
    whole = bag_file(bag).read_bytes()
    messages = [(r.topic, r.stamp, r.data) for r in read_raw(bag)]
    for k in range(25):
        data = bytearray(whole)
        begin = int(random.integers(0, len(data)))
        length = int(random.choice([1, 8, 300, 4096, 100_000]))
        piece = data[begin : begin + length]
        data[begin : begin + length] = bytes(len(piece)) if k % 2 else random.bytes(len(piece))
        if k % 5 == 0:
            del data[int(random.integers(0, len(data))) :]
        bag_file(bag).write_bytes(data)
        found = [(r.topic, r.stamp, r.data) for r in read_raw(bag)]
        end = ending(bag)
        assert end.trouble or found == messages
        assert set(found) <= set(messages)
        assert recover(bag, tmp_path / f"new{k}") == len(found)
        try:
            contents = load(bag)
        except ValueError:  # the scenario is not there, or is none
            continue
        assert end.trouble in [f.kind for f in faults_of(bag, contents)] or not end.trouble


def test_a_message_that_is_none_of_its_type_is_named(tmp_path, scenario, capsys):
    """Other programs write bags without checksums."""
    source = written(scenario, tmp_path / "bag")
    text = crowd(scenario, 1, 1).text
    with (tmp_path / "other.mcap").open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE, enable_crcs=False)
        writer.start("ros2", "somebody")
        writer.add_metadata("planar_push", {"scenario": text})
        schema = writer.register_schema("push_msgs/msg/Poses", "ros2msg", b"")
        channel = writer.register_channel("/ground_truth/poses", "cdr", schema)
        for k, record in enumerate(read_raw(source, {"/ground_truth/poses"})):
            data = record.data if k < 10 else record.data[:20] + b"\xff" * 60
            writer.add_message(channel, record.stamp, data, record.stamp)
        writer.finish()
    with pytest.raises(SettingsError, match=r"/ground_truth/poses at 0.20 s cannot be read"):
        load(tmp_path / "other.mcap")
    for verb in ("report", "play"):
        assert main([verb, str(tmp_path / "other.mcap")]) == 2
        assert "cannot be read" in capsys.readouterr().err


@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.LZ4])
def test_compressed_bags_of_other_recorders_are_read_up_to_the_damage_too(compression, tmp_path):
    file = tmp_path / "other.mcap"
    with file.open("wb") as stream:
        writer = Writer(stream, compression=compression, chunk_size=4096, enable_data_crcs=True)
        writer.start("ros2", "other")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/a", "cdr", schema)
        random, sent = np.random.default_rng(3), []
        for k in range(2000):
            data = bytes(random.integers(0, 256, 20, dtype=np.uint8)) + b"x" * 40
            sent.append(data)
            writer.add_message(channel, k * 10**7, data, k * 10**7)
        writer.finish()
    whole = file.read_bytes()
    for part in range(1, 21):
        damaged = bytearray(whole)
        at = len(whole) * part // 24
        damaged[at : at + 30] = bytes(30)
        file.write_bytes(damaged)
        assert ending(file).trouble == "damaged", part
        assert {r.data for r in read_raw(file)} <= set(sent), "nothing that was not recorded"
