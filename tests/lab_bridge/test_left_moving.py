"""Robots that go on with their last speeds when their link ends, as the maker's firmware does: what
becomes of them when the program that drives them ends without having reached them."""

import contextlib
import socket
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest

from lab_bridge.calibration_rig import LabRig, RigFailed
from lab_bridge.epuck2_packets import decode
from lab_bridge.guard import Guard
from lab_bridge.marker_mapping import Marker, MarkerMapping
from lab_bridge.observation import Observer
from lab_bridge.robot_drivers import RobotHost, make_robot_driver
from push_scenario.bodies import load_robot
from push_scenario.lab import EPuck2Link
from push_scenario.scenario import scenario_from_mapping
from tests.lab_bridge.test_node import Arena, lab

pytestmark = pytest.mark.live
UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])


class Robot:
    """One client at a time; keeps its speeds without one. away: it takes no client then."""

    def __init__(self):
        self._server = socket.socket()
        self._server.bind(("127.0.0.1", 0))
        self._server.listen(1)
        self._server.settimeout(0.02)
        self.port = self._server.getsockname()[1]
        self.speeds, self.clients = (0, 0), 0
        self.away = self._ended = False
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self):
        while not self._ended:
            with contextlib.suppress(OSError):
                client, _ = self._server.accept()
                with client:
                    self.clients += 1
                    client.settimeout(0.02)
                    self._serve(client)

    def _serve(self, client):
        data = b""
        while not (self._ended or self.away):
            with contextlib.suppress(TimeoutError):
                piece = client.recv(4096)
                if not piece:
                    return
                data += piece
            while len(data) >= 21:
                self.speeds, data = decode(data[:21]), data[21:]
                client.sendall(b"\x03")
        while self.away and not self._ended:
            time.sleep(0.01)

    def becomes(self, speeds, limit):
        end = time.monotonic() + limit
        while time.monotonic() < end and self.speeds != speeds:
            time.sleep(0.02)
        return self.speeds == speeds

    def close(self):
        self._ended = True
        self._thread.join()
        self._server.close()


@pytest.fixture
def robot():
    made = Robot()
    yield made
    made.close()


class Watcher(Observer):
    """An observer without a graph, that sees robot and box standing."""

    def __init__(self, port, orientation=UPRIGHT):
        lab = {
            "poses": {"kind": "tf"},
            "robots": {"one": {"kind": "epuck2", "host": "127.0.0.1", "port": port}},
        }
        values = {
            "environment": "open",
            "robots": {"one": {"type": "epuck", "start": [-0.5, 0, 0]}},
            "objects": {"box": {"type": "box9", "start": [0, 0, 0]}},
            "on": "lab",
            "lab": lab,
        }
        self.scenario = scenario_from_mapping(values, "made", "made.yaml")
        self.lab, self.bodies = self.scenario.lab, ("one", "box")
        self._mapping = MarkerMapping(self.lab, self.bodies)
        self.samples, self.robots, self._guard = [], {}, None
        self._node, self.orientation = None, orientation
        self._source = SimpleNamespace(close=lambda: None)
        self._spinner = SimpleNamespace(once=self._once)

    def _once(self, limit):
        time.sleep(limit)
        for name, x in (("one", -0.5), ("box", 0.0)):
            self.part(name, Marker(np.array([x, 0.0, 0.0]), self.orientation), time.time())


def test_a_calibration_that_loses_its_robot_does_not_leave_it_driving(robot):
    observer = Watcher(robot.port)
    observer.connect(["one"])
    observer.run(0.5)
    rig = LabRig(observer, "one", "box")
    threading.Timer(0.5, setattr, (robot, "away", True)).start()
    with pytest.raises(RigFailed):
        rig.run(0.05, 0.0, 5.0)
    assert robot.speeds != (0, 0)
    observer.close()
    assert robot.speeds != (0, 0)  # it could not be reached
    robot.away = False
    assert robot.becomes((0, 0), 10.0)


def test_a_calibration_that_ends_well_sends_its_guard_away(robot):
    observer = Watcher(robot.port)
    observer.connect(["one"])
    observer.run(0.5)
    observer.move("one", 0.05, 0.0, 0.2)
    guard = observer._guard._process
    observer.close()
    assert robot.speeds == (0, 0) and guard.poll() == 0 and robot.clients == 1


def test_a_robot_stands_once_it_has_answered_a_stop(robot):
    driver = make_robot_driver(
        RobotHost(None, "one", load_robot("epuck"), 50.0), EPuck2Link("127.0.0.1", robot.port)
    )

    def poll(seconds):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            driver.poll(time.monotonic())
            time.sleep(0.01)

    poll(0.3)
    assert driver.standing
    driver.command(np.array([0.05, 0.0, 0.0]), time.monotonic())
    assert not driver.standing
    poll(0.2)
    assert robot.speeds == (388, 388)
    driver.command(np.zeros(3), time.monotonic())
    assert not driver.standing  # not yet answered
    poll(0.2)
    assert driver.standing
    driver.command(np.array([0.05, 0.0, 0.0]), time.monotonic())
    poll(0.2)
    robot.away = True
    poll(0.1)
    driver.command(np.zeros(3), time.monotonic())
    poll(0.3)
    assert not driver.standing and robot.speeds == (388, 388)
    driver.close(time.monotonic())


def test_the_guard_reaches_a_robot_although_another_one_is_not_there(robot):
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))  # not listening
        guard = Guard([nobody.getsockname(), ("127.0.0.1", robot.port)])
        robot.speeds = (388, 388)
        guard.leave()
        assert robot.becomes((0, 0), 10.0)
        guard._process.kill()
        guard._process.wait()


@pytest.mark.parametrize("orientation", [np.full(4, np.nan), np.zeros(4)])
def test_poses_that_cannot_be_used_stop_the_robot(robot, orientation, monkeypatch):
    monkeypatch.setattr("lab_bridge.calibration_rig._AWAY", 0.5)
    observer = Watcher(robot.port)
    observer.connect(["one"])
    observer.run(0.5)
    rig = LabRig(observer, "one", "box")
    threading.Timer(0.3, setattr, (observer, "orientation", orientation)).start()
    begun = time.monotonic()
    with pytest.raises(RigFailed, match="no usable poses of"):
        rig.run(0.05, 0.0, 20.0)
    assert time.monotonic() - begun < 10.0 and robot.speeds == (0, 0)
    observer.close()


def test_an_observer_goes_on_seeing(monkeypatch):
    monkeypatch.setattr("lab_bridge.observation._KEPT", 100)
    observer = Watcher(1)
    observer.run(1.5)
    assert len(observer.samples) <= 100
    assert observer.pose("one") is not None and time.time() - observer.samples[-1].arrived < 0.5


def test_a_bridge_that_ends_while_a_robot_is_lost_leaves_it_to_its_guard(robot, ros):
    links = {
        "one": {"kind": "epuck2", "host": "127.0.0.1", "port": robot.port},
        "two": {"kind": "twist", "topic": "/robots/two"},
    }
    arena = Arena(lab(robots=links))

    def drive():
        arena.see()
        arena.drive("one")

    try:
        assert arena.until(lambda: robot.speeds != (0, 0), drive)
        robot.away = True
        assert arena.until(lambda: "one" in arena.bridge.fleet.troubles, drive)
        arena.bridge.stop()
        assert robot.speeds != (0, 0)
        robot.away = False
        assert robot.becomes((0, 0), 10.0)
    finally:
        arena.spinner.close()
