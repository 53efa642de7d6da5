"""Message definitions for bags: the standard types of rosbags plus this project's own."""

import functools
import os
import sys
from pathlib import Path

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore


def interface_folder(package: str) -> Path:
    """share/<package> of an installed interface package."""
    prefixes = [p for p in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if p]
    for prefix in [*prefixes, sys.prefix]:
        folder = Path(prefix) / "share" / package
        if folder.is_dir():
            return folder
    raise FileNotFoundError(f"the interface package '{package}' is not installed; run make install")


@functools.cache
def typestore() -> Typestore:
    """Jazzy's types and those of push_msgs: one store for all, made at the first call (0.1 s)."""
    store = get_typestore(Stores.ROS2_JAZZY)
    types = {}
    for path in sorted((interface_folder("push_msgs") / "msg").glob("*.msg")):
        types.update(get_types_from_msg(path.read_text(), f"push_msgs/msg/{path.stem}"))
    store.register(types)
    return store
