"""Shared by all tests: small scenarios, and ROS contexts that leave nothing behind."""

import signal

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from PIL import Image

from push_ros.claims import own_domain
from push_ros.process import prepare_environment
from push_scenario.scenario import config_directory, load_scenario

prepare_environment()
# The same examples every time, on a machine of any speed.
settings.register_profile(
    "repeatable", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("repeatable")


@pytest.fixture(autouse=True, scope="session")
def session_domain():
    """What is set up for several tests has a ROS domain that no other process has."""
    with own_domain() as number:
        yield number


@pytest.fixture(autouse=True)
def domain():
    """Every test has a ROS domain of its own."""
    with own_domain() as number:
        yield number


@pytest.fixture(scope="session")
def scenario():
    return load_scenario("env1-target1")


@pytest.fixture(scope="session")
def robot(scenario):
    return scenario.robot()[1]


@pytest.fixture(scope="session")
def box(scenario):
    return scenario.object()[1]


@pytest.fixture
def signal_handlers():
    """Handlers of SIGINT and SIGTERM are put back."""
    before = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.fixture
def ros():
    """A ROS context."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    yield
    rclpy.try_shutdown()


@pytest.fixture
def room(tmp_path):
    """A scenario file beside a map of map_server: ``short``, in a room of 2 m x 0.7 m."""
    pixels = np.full((60, 110), 254, dtype=np.uint8)
    pixels[:, :4] = pixels[:, -4:] = pixels[:12, :] = pixels[-12:, :] = 0
    Image.fromarray(pixels).save(tmp_path / "room.pgm")
    (tmp_path / "room.yaml").write_text(
        "image: room.pgm\nresolution: 0.02\norigin: [-1.1, -0.6, 0.0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.25\n"
    )
    text = (config_directory() / "scenarios" / "short.yaml").read_text()
    (tmp_path / "in_a_room.yaml").write_text(text.replace(": open", ": room.yaml"))
    return str(tmp_path / "in_a_room.yaml")
