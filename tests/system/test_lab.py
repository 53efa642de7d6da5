"""A lab without hardware: two programs that know nothing of the suite, and jobs that end within
5 mm by configuration alone. The truth comes from the programs, not from the suite."""

import json
import signal
import socket
import threading
import time

import numpy as np
import pytest

from push_bringup.failures import SuiteFailed
from push_bringup.suite import Suite, scenario_goals
from tests.lab_bridge.stand_in import StandIn

pytestmark = [pytest.mark.live, pytest.mark.long]
SYSTEMS = {"single": "lab-single.yaml", "group": "lab-group.yaml"}


class Cameras:
    """What the table looks like, by the datagrams that the robots' program sends for the cameras;
    a thread passes them on to motion capture."""

    def __init__(self, capture):
        """capture: port of motion capture."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(0.2)
        self.port = self._socket.getsockname()[1]
        self.poses = {}
        self._capture, self._open = capture, True
        self._thread = threading.Thread(target=self._pass_on)
        self._thread.start()

    def _pass_on(self):
        while self._open:
            try:
                data = self._socket.recv(65536)
            except TimeoutError:
                continue
            self.poses = {n: np.array(p) for n, p in json.loads(data)["poses"].items()}
            self._socket.sendto(data, ("127.0.0.1", self._capture))

    def close(self):
        self._open = False
        self._thread.join()
        self._socket.close()

    def still(self, robots, limit, span=0.5):
        """Whether the robots come to stand within limit [s]."""
        end = time.monotonic() + limit
        while time.monotonic() < end:
            before = self.poses
            time.sleep(span)
            if all(np.abs(self.poses[r] - before[r]).max() < 1e-3 for r in robots):
                return True
        return False


@pytest.fixture
def watched(tmp_path):
    """Starts the two programs with a view of the truth between them."""
    open_ones = []

    def start(file):
        lab = StandIn(file, tmp_path)
        cameras = Cameras(lab.light)
        lab.shines_to = cameras.port
        open_ones.extend([cameras.close, lambda: lab.__exit__(None, None, None)])
        lab.__enter__()
        return lab, cameras

    yield start
    for close in reversed(open_ones):
        close()


@pytest.mark.parametrize("system", SYSTEMS)
def test_a_goal_is_reached_by_configuration_alone(domain, system, tmp_path):
    """Done-when 5: other axes, names, millimetres, 15-30 ms late, 1 % lost; e-puck2 packets."""
    with (
        StandIn(SYSTEMS[system], tmp_path) as lab,
        Suite(str(lab.scenario), system=system) as suite,
    ):
        goal = scenario_goals(suite.scenario)[""][0]
        result = suite.reach(*goal, timeout=240.0)
    assert result.success and result.position_error <= 0.005, result


def drive(suite, cameras):
    """Send the goal, and wait until the robot has moved."""
    monitor = suite.monitor()
    start = cameras.poses["epuck1"]
    monitor.send_goal(scenario_goals(suite.scenario)[""][0])
    assert monitor.wait(60.0, lambda: np.hypot(*(cameras.poses["epuck1"] - start)[:2]) > 0.05)


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_robots_stand_when_the_bridge_dies_at_work(domain, watched, number):
    lab, cameras = watched("lab-single.yaml")
    with Suite(str(lab.scenario)) as suite:
        drive(suite, cameras)
        (child,) = [c for c in suite._launcher.children if c.name == "bridge"]
        child.process.send_signal(number)
        assert cameras.still(lab.robots, 8.0)
        assert suite.monitor().wait(5.0, lambda: child.process.poll() is not None)
        with pytest.raises(SuiteFailed, match="bridge died"):
            suite.check()


def test_robots_stand_when_motion_capture_dies_at_work(domain, watched):
    lab, cameras = watched("lab-single.yaml")
    with Suite(str(lab.scenario)) as suite:
        drive(suite, cameras)
        lab.capture_process.kill()
        assert cameras.still(lab.robots, 4.0)
