"""The page over HTTP: its files, the map, a stream of events, and its requests.

``who_may_ask`` decides which requests are answered. Streams are server-sent events: the contents of
``EventBoard``, and a ``suite`` event five times a second, by which page and server know that the
other one is alive. The number of streams is bounded. A stream whose page is closed or does not read
is dropped.
"""

import json
import math
import mimetypes
import socket
import threading
import time
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from push_view.event_board import EventBoard
from push_view.viewer_node import PERIOD, NotTaken, ViewerNode
from push_view.who_may_ask import WhoMayAsk, who_may_ask

STREAMS = 16
"""Pages that can be open at a time."""

_BEAT = 0.2  # [s] between two suite events
_PATIENCE = 5.0  # [s] until a page that does not read, or a silent connection, is dropped
_LONGEST = 10_000  # [bytes] of a request
_BUFFER = 1 << 16  # [bytes] that may be in transit to a page
_SAFETY = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "default-src 'self'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
}


def page_files() -> dict[str, tuple[str, bytes]]:
    """Type and contents of the page's files by the path of a request."""
    files = {}
    for path in sorted((Path(__file__).parent / "page").iterdir()):
        kind = mimetypes.guess_type(path.name)[0] or "application/octet-stream"
        if kind.startswith("text/"):
            kind += "; charset=utf-8"
        files["/" if path.name == "index.html" else f"/{path.name}"] = (kind, path.read_bytes())
    return files


class _Shared:
    """Data that all requests share."""

    def __init__(self, node: ViewerNode, rule: WhoMayAsk, streams: int) -> None:
        self.node, self.rule = node, rule
        self.board: EventBoard = node.board
        self.files = page_files()
        self.stopping = threading.Event()
        self.limit = streams
        self.streams = threading.BoundedSemaphore(streams)


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    timeout = _PATIENCE

    def __init__(self, shared: _Shared, *arguments: Any) -> None:
        self._shared = shared
        super().__init__(*arguments)

    def log_message(self, *_: Any) -> None:
        """Do not log each request."""

    def do_GET(self) -> None:
        """A file of the page, the map, the suite, or the events."""
        path = self.path.split("?")[0]
        refusal = self._shared.rule.refusal(self.headers, page=path == "/")
        if refusal:
            self._refuse(403, refusal)
        elif path in self._shared.files:
            self._answer(200, *self._shared.files[path])
        elif path == "/map.png":
            image = self._shared.node.map_image()
            if image is None:
                self._refuse(404, "no map yet")
            else:
                self._answer(200, "image/png", image)
        elif path == "/suite":
            self._json(200, self._shared.node.suite())
        elif path == "/events":
            self._events()
        else:
            self._refuse(404, f"nothing is at {path}")

    def do_POST(self) -> None:
        """A goal, or a cancel."""
        refusal = self._shared.rule.refusal(self.headers, acts=True)
        lengths = self.headers.get_all("Content-Length") or [""]
        plain = len(lengths) == 1 and lengths[0].isascii() and lengths[0].isdigit()
        if not plain or int(lengths[0]) > _LONGEST or "Transfer-Encoding" in self.headers:
            refusal = refusal or "a request of known and small length was expected"
        if refusal:
            # the rest of this connection is not read
            self.close_connection = True
            self._refuse(403, refusal)
            return
        body = self.rfile.read(int(lengths[0]))
        try:
            if self.path == "/goal":
                space, x, y, theta = _goal(body)
                self._json(202, {"stamp": self._shared.node.send_goal(space, x, y, theta)})
            elif self.path == "/cancel":
                self._shared.node.cancel(_space(json.loads(body or b"{}")))
                self._json(202, {})
            else:
                self._refuse(404, f"nothing is at {self.path}")
        except NotTaken as error:
            self._refuse(409, str(error))
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            what = f"{type(error).__name__} {error}"
            self._refuse(400, f"expected x, y, theta, and a team perhaps: {what}")

    def _json(self, code: int, data: Any) -> None:
        self._answer(code, "application/json", json.dumps(data).encode())

    def _refuse(self, code: int, why: str) -> None:
        self._answer(code, "text/plain; charset=utf-8", f"{why}\n".encode())

    def _answer(self, code: int, kind: str, body: bytes) -> None:
        self.send_response(code)
        for name, value in (("Content-Type", kind), ("Content-Length", str(len(body)))):
            self.send_header(name, value)
        for name, value in _SAFETY.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)

    def _events(self) -> None:
        shared = self._shared
        if not shared.streams.acquire(blocking=False):
            self._refuse(503, f"{shared.limit} pages are open already; close one")
            return
        try:
            self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER)
            if hasattr(socket, "TCP_USER_TIMEOUT"):  # a machine that is gone acknowledges nothing
                limit = round(1e3 * _PATIENCE)
                self.connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, limit)
            self.send_response(200)
            self.send_header("Content-Type", "text/event-stream")
            for name, value in _SAFETY.items():
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


def _space(values: Any) -> str:
    space = values.get("space", "")
    if not isinstance(space, str):
        raise TypeError(f"space must be text, got {space!r}")
    return space


def _goal(body: bytes) -> tuple[str, float, float, float]:
    """Team and pose of a request; raises ValueError, KeyError, TypeError or AttributeError."""
    values = json.loads(body)
    space = _space(values)
    x, y, theta = (float(values[k]) for k in ("x", "y", "theta"))
    if not all(math.isfinite(v) for v in (x, y, theta)):
        raise ValueError("not finite")
    return space, x, y, theta


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def handle_error(self, *_: Any) -> None:
        """A broken connection is not reported."""


class PageServer:
    """Serves a viewer node's page from a thread. port 0 chooses a free one.

    Raises
    ------
    OSError: host and port cannot be bound.
    """

    def __init__(self, node: ViewerNode, host: str, port: int, streams: int = STREAMS) -> None:
        self._shared = _Shared(node, who_may_ask(host), streams)
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        server = type("_BoundServer", (_Server,), {"address_family": family})
        self._server: ThreadingHTTPServer = server((host, port), partial(_Handler, self._shared))
        self.port = int(self._server.server_address[1])
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop serving."""
        self._shared.stopping.set()
        self._server.shutdown()
        self._server.server_close()
