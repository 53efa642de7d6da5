"""The page over HTTP: its files, the map, a stream of events, and its requests.

``who_may_ask`` decides which requests are answered. Streams are server-sent events: the contents of
``EventBoard``, and a ``suite`` event five times a second, by which page and server know that the
other one is alive. The number of streams is bounded. A stream whose page is closed or does not read
is dropped.
"""

import json
import math
import socket
import threading
import time
from functools import partial
from typing import Any

from push_view.event_board import EventBoard
from push_view.http_answers import PATIENCE, SAFETY, Answers, BackgroundServer, page_files
from push_view.page_requests import PageRequests, Starter
from push_view.viewer_node import PERIOD, NotTaken, ViewerNode
from push_view.who_may_ask import WhoMayAsk, who_may_ask

STREAMS = 16
"""Pages that can be open at a time."""

_BEAT = 0.2  # [s] between two suite events
_LONGEST = 10_000  # [bytes] of a request
_BUFFER = 1 << 16  # [bytes] that may be in transit to a page


class _Shared:
    """Data that all requests share."""

    def __init__(
        self, node: ViewerNode, rule: WhoMayAsk, streams: int, starter: Starter | None
    ) -> None:
        self.node, self.rule = node, rule
        self.requests = PageRequests(node, starter)
        self.board: EventBoard = node.board
        self.files = page_files()
        self.stopping = threading.Event()
        self.limit = streams
        self.streams = threading.BoundedSemaphore(streams)


class _Handler(Answers):
    def __init__(self, shared: _Shared, *arguments: Any) -> None:
        self._shared = shared
        super().__init__(*arguments)

    def do_GET(self) -> None:  # noqa: N802  (the name is that of the base class)
        """A file of the page, the map, the suite, or the events."""
        path = self.path.split("?")[0]
        refusal = self._shared.rule.refusal(self.headers, page=path == "/")
        if refusal:
            self.refuse(403, refusal)
        elif path in self._shared.files:
            self.answer(200, *self._shared.files[path])
        elif path == "/map.png":
            image = self._shared.node.map_image()
            if image is None:
                self.refuse(404, "no map yet")
            else:
                self.answer(200, "image/png", image)
        elif path == "/suite":
            self.json(200, self._shared.node.suite())
        elif path == "/mode":
            self.json(200, {"playback": False})
        elif path == "/options":
            self.json(200, self._shared.requests.options())
        elif path == "/events":
            self._events()
        else:
            self.refuse(404, f"nothing is at {path}")

    def do_POST(self) -> None:  # noqa: N802  (the name is that of the base class)
        """A request of the page, see ``PageRequests``."""
        refusal = self._shared.rule.refusal(self.headers, acts=True)
        lengths = self.headers.get_all("Content-Length") or [""]
        plain = len(lengths) == 1 and lengths[0].isascii() and lengths[0].isdigit()
        if not plain or int(lengths[0]) > _LONGEST or "Transfer-Encoding" in self.headers:
            refusal = refusal or "a request of known and small length was expected"
        if refusal:
            # the rest of this connection is not read
            self.close_connection = True
            self.refuse(403, refusal)
            return
        body = self.rfile.read(int(lengths[0]))
        try:
            self.json(202, self._shared.requests.answer(self.path, body))
        except NotTaken as error:
            self.refuse(409, str(error))
        except KeyError:
            self.refuse(404, f"nothing is at {self.path}")
        except ValueError as error:
            self.refuse(400, str(error))

    def _events(self) -> None:
        shared = self._shared
        if not shared.streams.acquire(blocking=False):
            self.refuse(503, f"{shared.limit} pages are open already; close one")
            return
        try:
            self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER)
            if hasattr(socket, "TCP_USER_TIMEOUT"):  # a machine that is gone acknowledges nothing
                limit = round(1e3 * PATIENCE)
                self.connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, limit)
            self.send_response(200)
            self.send_header("Content-Type", "text/event-stream")
            for name, value in SAFETY.items():
                self.send_header(name, value)
            self.end_headers()
            self._stream()
        except OSError:
            pass  # the page was closed, or does not read
        finally:
            shared.streams.release()
            self.close_connection = True

    def _stream(self) -> None:
        """Send each new event, and the suite's at least every beat, until the page is closed."""
        shared = self._shared
        version, before, beat = 0, b"", -math.inf
        while not shared.stopping.is_set():
            version, news = shared.board.since(version)
            suite = json.dumps(shared.node.suite()).encode()
            now = time.monotonic()
            if suite != before or now - beat >= _BEAT:
                news = b"event: suite\ndata: " + suite + b"\n\n" + news
                before, beat = suite, now
            if news:
                self.wfile.write(news)
            shared.stopping.wait(PERIOD)


class PageServer:
    """Serves a viewer node's page from a thread. port 0 chooses a free one.

    Raises
    ------
    SettingsError: host and port cannot be bound.
    """

    def __init__(
        self,
        node: ViewerNode,
        host: str,
        port: int,
        streams: int = STREAMS,
        starter: Starter | None = None,
    ) -> None:
        """starter: starts suites for the page; without it, the page starts none."""
        self._shared = _Shared(node, who_may_ask(host), streams, starter)
        self._server = BackgroundServer(host, port, partial(_Handler, self._shared))
        self.port = self._server.port

    def close(self) -> None:
        """Stop serving."""
        self._shared.stopping.set()
        self._server.close()
