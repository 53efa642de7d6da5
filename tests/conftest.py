"""Shared by all tests: small scenarios, and ROS contexts that leave nothing behind."""

import pytest
from hypothesis import HealthCheck, settings

from push_ros.process import claim_domain, prepare_environment
from push_ros.scenario import load_scenario

claim_domain()  # every run of the tests has a domain of its own
prepare_environment()
# The same examples every time, on a machine of any speed.
settings.register_profile(
    "repeatable", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("repeatable")


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
def ros():
    """A ROS context on a domain of its own."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    claim_domain()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    yield
    rclpy.try_shutdown()
