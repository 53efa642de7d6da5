"""The newest event of each name, for any number of streams to pages.

A slow stream gets fewer events, never outdated ones. Thread-safe.
"""

import json
import threading
from typing import Any


class EventBoard:
    """Newest server-sent event by name. An event equal to the previous one is dropped."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._events: dict[str, tuple[int, bytes]] = {}
        self._version = 0

    def put(self, name: str, kind: str, data: Any) -> None:
        """Replace the event of a name; raises ValueError for values that are not JSON, e.g. nan.

        kind: the type of the event for the page.
        """
        text = json.dumps(data, allow_nan=False, separators=(",", ":"))
        event = f"event: {kind}\ndata: {text}\n\n".encode()
        with self._lock:
            before = self._events.get(name)
            if before is None or before[1] != event:
                self._version += 1
                self._events[name] = (self._version, event)

    def drop(self, name: str) -> None:
        """Forget the event of a name, if there is one."""
        with self._lock:
            self._events.pop(name, None)

    def since(self, version: int) -> tuple[int, bytes]:
        """The current version, and all events newer than a version, in order of arrival."""
        with self._lock:
            newer = sorted(e for e in self._events.values() if e[0] > version)
            return self._version, b"".join(event for _, event in newer)
