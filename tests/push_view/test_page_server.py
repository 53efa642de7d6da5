"""Who is answered, and how many at a time."""

import contextlib
import http.client
import json
import socket
import threading
import time

import numpy as np
import pytest

from push_view.http_answers import CONNECTIONS
from push_view.who_may_ask import WhoMayAsk, host_name
from tests.push_view.page_client import Page, Suite

GOAL = json.dumps({"x": 1.0, "y": 0.5, "theta": 0.3})
PATHS = ("/", "/page.js", "/map.png", "/suite", "/events")


@pytest.fixture
def page(ros, scenario):
    page = Page(scenario, Suite())
    assert page.ready()
    yield page
    page.close()


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://evil.example:8080", "Host": "evil.example:8080"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Content-Type": "text/plain"},
        {"Content-Length": "many"},
        {"Transfer-Encoding": "chunked"},
    ],
)
def test_other_sites_cannot_move_the_robot(page, headers):
    """Also where a name of theirs leads here, or where their form is sent without asking."""
    assert page.ask("POST", "/goal", GOAL, headers)[0] == 403
    own = {"Origin": f"http://127.0.0.1:{page.server.port}"}
    assert page.ask("POST", "/goal", GOAL, own)[0] == 202
    assert page.until(lambda: page.suite.goals["/"]) and len(page.suite.goals["/"]) == 1


@pytest.mark.parametrize("path", PATHS)
def test_a_name_of_somebody_elses_sees_nothing(page, path):
    for headers in ({"Host": "evil.example"}, {"Host": f"evil.example:{page.server.port}"}):
        status, _, body = page.ask("GET", path, headers=headers)
        assert status == 403 and b"evil.example" in body
    if path != "/":  # a picture or a script on another site
        assert page.ask("GET", path, headers={"Sec-Fetch-Site": "cross-site"})[0] == 403


def test_a_server_for_all_addresses_serves_its_own_page(ros, scenario):
    """Under the addresses that it is reached by, and no other name."""
    page = Page(scenario, Suite(), host="0.0.0.0")
    try:
        assert page.ready()
        for host in ("127.0.0.1", "192.168.1.7", "localhost", socket.gethostname()):
            headers = {"Host": f"{host}:{page.server.port}"}
            assert page.ask("GET", "/", headers=headers)[0] == 200
            assert page.ask("GET", "/events", headers=headers)[0] == 200
            own = {**headers, "Origin": f"http://{host}:{page.server.port}"}
            assert page.ask("POST", "/goal", GOAL, own)[0] == 202
        assert page.ask("GET", "/", headers={"Host": "evil.example"})[0] == 403
    finally:
        page.close()


def test_the_rule():
    """Random names and addresses: what is a number is known, what is a name is not."""
    random = np.random.default_rng(4)
    everywhere, local = WhoMayAsk("0.0.0.0", "Lab-7"), WhoMayAsk("127.0.0.1", "lab-7")
    one = WhoMayAsk("192.168.1.7", "lab-7")
    for _ in range(500):
        port = random.choice(["", f":{random.integers(1, 65536)}"])
        number = ".".join(str(n) for n in random.integers(0, 256, 4))
        words = ":".join(f"{n:x}" for n in random.integers(0, 65536, 8))
        letters = "".join(random.choice(list("abcdefghijklmnop-"), random.integers(1, 9)))
        for address in (number, f"[{words}]"):
            assert everywhere.knows(address + port)
            assert not local.knows(address + port) or number == "127.0.0.1"
            assert not one.knows(address + port) or number == "192.168.1.7"
        for name in (
            f"x{letters}.example",
            f"{number}.example",
            f"localhost.{letters}.x",
            "x" + letters,
        ):
            for rule in (everywhere, local, one):
                assert not rule.knows(name + port)
        for rule in (everywhere, local, one):
            assert all(
                rule.knows(n + port) for n in ("localhost", "LOCALHOST", "127.0.0.1", "[::1]")
            )
        assert everywhere.knows(f"lab-7{port}") and everywhere.knows(f"LAB-7{port}")
        assert everywhere.knows(f"lab-7.local{port}") and everywhere.knows(f"Lab-7.local.{port}")
        assert WhoMayAsk("::", "mac.local").knows(f"mac.local{port}")
        for foreign in (f"x{letters}.local", "lab-7.local.example", "lab-7.local.local"):
            assert not everywhere.knows(foreign + port)
        assert not local.knows(f"lab-7.local{port}") and not one.knows(f"lab-7.local{port}")
        assert one.knows(f"192.168.1.7{port}")
    for nonsense in (
        "",
        ":",
        ":80",
        "a:b",
        "127.0.0.1:80:80",
        "[::1",
        "[::1]x",
        "::1:80x",
        "1.2.3.4@x",
    ):
        assert not everywhere.knows(nonsense)
    assert host_name("[FE80::1]:8080") == "fe80::1" and host_name("localhost.:80") == "localhost"


def test_the_body_of_a_refused_request_is_not_taken_for_another(page):
    length = f"Content-Length: {len(GOAL)}"
    own = f"Host: 127.0.0.1:{page.server.port}\r\nContent-Type: application/json"
    inner = f"POST /goal HTTP/1.1\r\n{own}\r\n{length}\r\n\r\n{GOAL}"
    for trick in (
        f"Origin: http://evil.example\r\n{own}\r\nContent-Length: {len(inner)}",
        f"{own}\r\nContent-Length: 0\r\nContent-Length: {len(inner)}",
        f"{own}\r\nContent-Length: 0\r\nTransfer-Encoding: chunked",
        f"Content-Length: {len(inner)}",
        f"Host: 127.0.0.1\r\n{own}\r\nContent-Length: {len(inner)}",
    ):
        with socket.create_connection(("127.0.0.1", page.server.port), timeout=5) as connection:
            connection.sendall(f"POST /goal HTTP/1.1\r\n{trick}\r\n\r\n{inner}".encode())
            answers = b""
            while chunk := connection.recv(4096):
                answers += chunk
        assert answers.count(b"HTTP/1.1") == 1 and b"403" in answers
    page.until(lambda: bool(page.suite.goals["/"]), 0.3)
    assert page.suite.goals["/"] == []


def test_streams_are_bounded_and_those_of_closed_pages_are_given_back(ros, scenario):
    page = Page(scenario, Suite(), streams=3)
    try:
        assert page.ready()
        port = page.server.port
        streams = [http.client.HTTPConnection("127.0.0.1", port, timeout=5) for _ in range(3)]

        def open_all():
            for stream in streams:
                stream.request("GET", "/events")
            answers = [stream.getresponse() for stream in streams]
            assert all(answer.readline().startswith(b"event: ") for answer in answers)
            return answers

        answers = page.away(open_all)
        status, _, body = page.ask("GET", "/events")
        assert status == 503 and b"3 pages are open already" in body
        assert page.ask("GET", "/")[0] == 200  # only streams are bounded
        answers[1].close()
        assert page.until(lambda: page.ask("GET", "/events")[0] == 200)
        for answer in answers:
            answer.close()
    finally:
        page.close()


def test_a_page_that_does_not_read_is_dropped(ros, scenario, monkeypatch):
    monkeypatch.setattr("push_view.page_server.PATIENCE", 0.3)
    monkeypatch.setattr("push_view.page_server._Handler.timeout", 0.3)
    page = Page(scenario, Suite(), streams=1)
    try:
        assert page.ready()
        with socket.socket() as connection:
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
            connection.connect(("127.0.0.1", page.server.port))
            host = f"Host: 127.0.0.1:{page.server.port}"
            connection.sendall(f"GET /events HTTP/1.1\r\n{host}\r\n\r\n".encode())
            assert page.until(lambda: page.ask("GET", "/events")[0] == 503)
            for i in range(400):  # more than fits between two machines
                page.node.board.put("log", "log", {"space": "/", "entries": [i, "x" * 60_000]})
                page.until(lambda: False, 0.02)
                if i % 20 == 19 and page.ask("GET", "/events")[0] == 200:
                    return
        raise AssertionError("the stream was never given back")
    finally:
        page.close()


def test_a_slow_page_is_told_the_newest_only(page):
    """Events that were overtaken are not sent; order is kept."""
    board = page.node.board
    version, _ = board.since(0)
    for i in range(1000):
        board.put("path /", "path", {"space": "/", "number": i})
        board.put("map", "map", {"number": i})
    later, news = board.since(version)
    assert news.count(b"event: ") == 2 and news.count(b"999") == 2
    assert news.index(b"path") < news.index(b"map")
    board.put("map", "map", {"number": 999})  # nothing new
    assert board.since(later) == (later, b"")
    with pytest.raises(ValueError):
        board.put("map", "map", {"number": float("nan")})


def test_an_idle_connection_is_not_kept_for_ever(page, monkeypatch):
    monkeypatch.setattr("push_view.page_server._Handler.timeout", 0.2)

    def silent():
        with socket.create_connection(("127.0.0.1", page.server.port), timeout=5) as connection:
            return connection.recv(1)

    assert page.away(silent) == b""


def test_clients_that_dribble_keep_no_thread(page, monkeypatch):
    """More connections than are served, each of which sends a byte now and then and never a whole
    request: neither in its head nor in its body."""
    monkeypatch.setattr("push_view.page_server._Handler.timeout", 1.0)
    before = threading.active_count()
    host = f"Host: 127.0.0.1:{page.server.port}\r\nContent-Type: application/json"
    body = f"POST /goal HTTP/1.1\r\n{host}\r\nContent-Length: 9000\r\n\r\n{{"
    address = "127.0.0.1", page.server.port
    clients = [socket.create_connection(address, timeout=5) for _ in range(CONNECTIONS + 20)]
    stop, counts = threading.Event(), []

    def dribble():
        for k, client in enumerate(clients):
            with contextlib.suppress(OSError):
                client.sendall(body.encode() if k % 2 else b"GET / HT")
        while not stop.wait(0.2):
            counts.append(threading.active_count())
            for client in clients:
                with contextlib.suppress(OSError):
                    client.send(b"x")

    sender = threading.Thread(target=dribble)
    sender.start()
    try:
        page.until(lambda: False, 3.0)
        assert page.ask("GET", "/suite")[0] == 200
        assert max(counts) <= before + 1 + CONNECTIONS
        assert page.until(lambda: threading.active_count() <= before + 2)
    finally:
        stop.set()
        sender.join()
        for client in clients:
            client.close()


def test_a_connection_that_is_used_slowly_goes_on(page, monkeypatch):
    """Each request has its own time, which begins with its first byte."""
    monkeypatch.setattr("push_view.page_server._Handler.timeout", 1.0)

    def ask_slowly():
        connection = http.client.HTTPConnection("127.0.0.1", page.server.port, timeout=5)
        found = []
        for _ in range(4):
            time.sleep(0.6)
            connection.request("GET", "/suite")
            found.append(connection.getresponse())
            found[-1].read()
        connection.close()
        return [answer.status for answer in found]

    assert page.away(ask_slowly) == [200] * 4
