"""Shared by all tests: small scenarios, and ROS contexts that leave nothing behind."""

import itertools
import os

import pytest
from hypothesis import HealthCheck, settings

from push_ros.process import prepare_environment
from push_ros.scenario import load_scenario

os.environ["ROS_DOMAIN_ID"] = str(1 + os.getpid() % 90)
prepare_environment()
# The same examples every time, on a machine of any speed.
settings.register_profile(
    "repeatable", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("repeatable")
_domains = itertools.count()


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
def ros(monkeypatch):
    """A ROS context on a domain of its own."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    domain = 1 + (os.getpid() * 7 + next(_domains)) % 100
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    yield
    rclpy.try_shutdown()
