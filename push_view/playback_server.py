"""The page with bags instead of a running suite. It needs no ROS graph."""

import gzip
import json
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from push_view.http_answers import Answers, BackgroundServer, page_files
from push_view.playback import playback_json
from push_view.who_may_ask import WhoMayAsk, who_may_ask

_LEVEL = 3  # of compression


class _Bags:
    """What all requests share: the page's files, and compressed JSON by path."""

    def __init__(self, bags: Sequence[Path], rule: WhoMayAsk) -> None:
        names = [bag.name for bag in bags]
        self.rule, self.files = rule, page_files()
        self.data: dict[str, bytes] = {}
        for i, bag in enumerate(bags):
            short = f"{bag.absolute().parent.name}/{bag.name}"
            name = bag.name if names.count(bag.name) == 1 else short
            text = json.dumps(playback_json(bag, name), allow_nan=False, separators=(",", ":"))
            self.data[f"/bag/{i}"] = gzip.compress(text.encode(), _LEVEL)


class _Handler(Answers):
    def __init__(self, bags: _Bags, *arguments: Any) -> None:
        self._bags = bags
        super().__init__(*arguments)

    def do_GET(self) -> None:  # noqa: N802  (the name is that of the base class)
        """A file of the page, the list of bags, or one of them."""
        path, bags = self.path.split("?")[0], self._bags
        refusal = bags.rule.refusal(self.headers, page=path == "/")
        if refusal:
            self.refuse(403, refusal)
        elif path in bags.files:
            self.answer(200, *bags.files[path])
        elif path == "/mode":
            self.json(200, {"playback": True, "bags": [p.removeprefix("/") for p in bags.data]})
        elif path in bags.data:
            self.answer(200, "application/json", bags.data[path], {"Content-Encoding": "gzip"})
        else:
            self.refuse(404, f"nothing is at {path}")


class PlaybackServer:
    """Serves the page with bags from a thread. port 0 chooses a free one.

    Raises
    ------
    ValueError: a bag holds no scenario. FileNotFoundError: there is none.
    SettingsError: host and port cannot be bound.
    """

    def __init__(self, bags: Sequence[Path], host: str, port: int) -> None:
        handler = partial(_Handler, _Bags(bags, who_may_ask(host)))
        self._server = BackgroundServer(host, port, handler)
        self.port = self._server.port

    def close(self) -> None:
        """Stop serving."""
        self._server.close()
