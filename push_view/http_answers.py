"""What the servers of the page share: its files, answers, and a server in a thread."""

import errno
import io
import json
import mimetypes
import socket
import threading
import time
from collections.abc import Callable, Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, ClassVar

from push_model.settings import SettingsError
from push_view.who_may_ask import EVERYWHERE

PATIENCE = 5.0
"""[s] until a page that does not read, a silent connection, or one whose request is not whole, is
dropped."""

CONNECTIONS = 128
"""Connections that are served at a time. A page needs a few while it loads."""

SAFETY = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "default-src 'self'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
}
"""Headers of every answer."""

_NONE: Mapping[str, str] = {}


def page_files() -> dict[str, tuple[str, bytes]]:
    """Type and contents of the page's files by the path of a request."""
    files = {}
    folder = Path(__file__).parent / "page"
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        kind = mimetypes.guess_type(path.name)[0] or "application/octet-stream"
        if kind.startswith("text/"):
            kind += "; charset=utf-8"
        name = path.relative_to(folder).as_posix()
        files["/" if name == "index.html" else f"/{name}"] = (kind, path.read_bytes())
    return files


class _Incoming(io.RawIOBase):
    """What comes in on a connection; raises TimeoutError if one request takes longer than it may.

    limit: [s] until its first byte, and from then on until it is whole.
    """

    def __init__(self, connection: socket.socket, limit: float) -> None:
        self._connection, self._limit = connection, limit
        self._end: float | None = None

    def begin(self) -> None:
        """Wait for the next request."""
        self._end = None

    def readable(self) -> bool:
        """See ``io.RawIOBase``."""
        return True

    def readinto(self, buffer: Any) -> int:
        """See ``io.RawIOBase``."""
        left = self._limit if self._end is None else self._end - time.monotonic()
        if left <= 0.0:
            raise TimeoutError("the request is not whole")
        self._connection.settimeout(left)
        try:
            return self._connection.recv_into(buffer)
        finally:
            self._connection.settimeout(self._limit)
            if self._end is None:
                self._end = time.monotonic() + self._limit


class Answers(BaseHTTPRequestHandler):
    """A request handler with answers; a connection that is silent or too slow is dropped."""

    protocol_version = "HTTP/1.1"
    timeout: ClassVar[float] = PATIENCE

    def setup(self) -> None:
        """See ``StreamRequestHandler``."""
        super().setup()
        self.rfile.close()
        self._incoming = _Incoming(self.connection, self.timeout)
        self.rfile = io.BufferedReader(self._incoming)

    def handle_one_request(self) -> None:
        """See ``BaseHTTPRequestHandler``."""
        self._incoming.begin()
        super().handle_one_request()

    def log_message(self, *_: Any) -> None:
        """Do not log each request."""

    def json(self, code: int, data: Any) -> None:
        """Answer with JSON."""
        self.answer(code, "application/json", json.dumps(data).encode())

    def refuse(self, code: int, why: str) -> None:
        """Answer with a sentence of text."""
        self.answer(code, "text/plain; charset=utf-8", f"{why}\n".encode())

    def answer(self, code: int, kind: str, body: bytes, headers: Mapping[str, str] = _NONE) -> None:
        """Answer with a body of a content type, and further headers."""
        self.send_response(code)
        for name, value in (("Content-Type", kind), ("Content-Length", str(len(body)))):
            self.send_header(name, value)
        for name, value in (*SAFETY.items(), *headers.items()):
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    request_queue_size = 64

    def __init__(self, *arguments: Any) -> None:
        self._free = threading.BoundedSemaphore(CONNECTIONS)
        super().__init__(*arguments)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve a connection in a thread; drop it if there are too many."""
        if not self._free.acquire(blocking=False):
            self.shutdown_request(request)
            return
        try:
            super().process_request(request, client_address)
        except RuntimeError:  # no thread could be started
            self._free.release()
            raise

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """See ``ThreadingMixIn``."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, *_: Any) -> None:
        """A broken connection is not reported."""


def page_address(host: str, port: int) -> str:
    """The address of a page to open; that of a server for all addresses names the computer."""
    shown = socket.gethostname() if host in EVERYWHERE else host
    return f"http://[{shown}]:{port}/" if ":" in shown else f"http://{shown}:{port}/"


def _unbound(host: str, port: int, error: OSError | UnicodeError) -> str:
    why = (error.strerror if isinstance(error, OSError) else None) or str(error)
    numbers = (errno.EADDRNOTAVAIL, errno.EAFNOSUPPORT)
    foreign = isinstance(error, OSError) and error.errno in numbers
    if foreign or isinstance(error, socket.gaierror | UnicodeError):
        return (
            f"--host {host}: {why}; give an address of this computer, or 0.0.0.0 for all addresses"
        )
    return f"port {port}: {why}; try --port 0"


class BackgroundServer:
    """Answers requests in threads of its own. port: the one that is bound.

    Raises
    ------
    SettingsError: host and port cannot be bound; says which option is wrong.
    """

    def __init__(
        self, host: str, port: int, handler: Callable[..., BaseHTTPRequestHandler]
    ) -> None:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        server = type("_BoundServer", (_Server,), {"address_family": family})
        try:
            self._server: ThreadingHTTPServer = server((host, port), handler)
        except (OSError, UnicodeError) as error:
            raise SettingsError(_unbound(host, port, error)) from None
        self.port = int(self._server.server_address[1])
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop answering."""
        self._server.shutdown()
        self._server.server_close()
