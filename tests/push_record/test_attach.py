"""Files inside a bag: the messages stay, the files come back."""

import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from push_model.settings import SettingsError
from push_record.attach import attach, attachments
from push_record.bag import bag_file, read_metadata, read_raw
from tests.push_record.test_bag import META, write


def test_files_are_attached_and_messages_stay(tmp_path):
    write(tmp_path / "bag", 500).close()
    before = list(read_raw(tmp_path / "bag"))
    page, picture = tmp_path / "report.html", tmp_path / "trajectory.png"
    page.write_text("first")
    picture.write_bytes(b"\x89PNG" + bytes(1000))
    attach(tmp_path / "bag", [page, picture])
    page.write_text("second")
    attach(tmp_path / "bag", [page])
    found = {name: (kind, data) for name, kind, data in attachments(tmp_path / "bag")}
    assert found["report.html"] == ("text/html", b"second")
    assert found["trajectory.png"] == ("image/png", picture.read_bytes()) and len(found) == 2
    assert list(read_raw(tmp_path / "bag")) == before
    assert read_metadata(tmp_path / "bag") == META
    assert sorted(p.name for p in (tmp_path / "bag").iterdir()) == ["bag_0.mcap", "metadata.yaml"]
    with AnyReader([tmp_path / "bag"]) as reader:
        assert sum(1 for _ in reader.messages()) == 500
    with bag_file(tmp_path / "bag").open("rb") as file:
        assert make_reader(file).get_header().profile == "ros2"


def test_a_bag_that_is_cut_off_is_left_alone(tmp_path):
    write(tmp_path / "bag", 500).close()
    file = bag_file(tmp_path / "bag")
    file.write_bytes(file.read_bytes()[:-100])
    before = file.read_bytes()
    with pytest.raises(SettingsError, match="recover"):
        attach(tmp_path / "bag", [])
    assert file.read_bytes() == before
