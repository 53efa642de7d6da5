"""Files inside a bag: a report and its pictures as MCAP attachments."""

import shutil
from collections.abc import Sequence
from pathlib import Path

from mcap.reader import make_reader

from push_model.settings import SettingsError
from push_record.bag import BagWriter, bag_file, ending, read_channels, read_metadata, read_raw

_TYPES = {
    ".html": "text/html",
    ".pdf": "application/pdf",
    ".png": "image/png",
    ".gif": "image/gif",
}


def attach(bag: Path, files: Sequence[Path]) -> None:
    """Put files into a bag; one of the same name is replaced. The messages stay as they are.

    Raises
    ------
    SettingsError: the bag is cut off or damaged.
    """
    trouble = ending(bag).text
    if trouble:
        raise SettingsError(f"{bag}: {trouble}; copy it first with planar-push recover")
    beside = bag_file(bag).parent / ".attaching"
    shutil.rmtree(beside, ignore_errors=True)
    writer = BagWriter(beside, read_metadata(bag))
    try:
        for topic, kind, latched in read_channels(bag):
            writer.add_topic(topic, kind, latched)
        for record in read_raw(bag):
            writer.write(record.topic, record.stamp, record.data)
        own = {file.name for file in files}
        for name, kind, data in attachments(bag):
            if name not in own:
                writer.attach(name, kind, data)
        for file in files:
            kind = _TYPES.get(file.suffix, "application/octet-stream")
            writer.attach(file.name, kind, file.read_bytes())
        writer.close()
        bag_file(beside).replace(bag_file(bag))
    finally:
        writer.close()
        shutil.rmtree(beside, ignore_errors=True)


def attachments(bag: Path) -> list[tuple[str, str, bytes]]:
    """Name, media type and contents of the files in a bag."""
    with bag_file(bag).open("rb") as file:
        return [(a.name, a.media_type, a.data) for a in make_reader(file).iter_attachments()]
