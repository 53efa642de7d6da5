"""A suite that is started on request: what is refused before anything starts, and how it ends."""

import time

import pytest

from push_bringup.background_suite import BackgroundSuite
from push_bringup.failures import DomainInUse
from tests.system.processes import children_of, running


@pytest.fixture
def suite():
    suite = BackgroundSuite()
    yield suite
    suite.close()


@pytest.mark.parametrize(
    ("system", "scenario", "why"),
    [
        ("single", "nowhere", "no scenario 'nowhere'"),
        ("single", "../scenarios/short", "no scenario"),
        ("nothing", "short", "no system 'nothing'"),
        ("group", "short", "needs"),
    ],
)
def test_what_cannot_be_started_is_refused_and_says_why(suite, system, scenario, why):
    before = children_of_this()  # other tests of this process may have some
    with pytest.raises(ValueError, match=why):
        suite.start(system, scenario)
    assert suite.options()["running"] == "" and children_of_this() == before


def test_a_suite_beside_another_one_is_refused_in_words(suite, monkeypatch):
    def busy(namespace):
        raise DomainInUse("a bridge already runs in domain 7; stop it")

    monkeypatch.setattr("push_bringup.background_suite.check_domain", busy)
    before = children_of_this()
    with pytest.raises(ValueError, match="a bridge already runs in domain 7"):
        suite.start("single", "short")
    assert suite.options()["running"] == "" and children_of_this() == before


def test_nothing_can_be_stopped_that_was_not_started(suite):
    with pytest.raises(ValueError, match="no suite runs"):
        suite.stop()


@pytest.mark.live
def test_a_suite_outlives_the_thread_that_asked_for_it_and_ends_with_its_owner(suite):
    import threading

    before = children_of_this()
    asked = threading.Thread(target=lambda: suite.start("single", "short"))
    asked.start()
    asked.join()
    time.sleep(1.0)
    children = [child for child in children_of_this() if child not in before]
    assert len(children) == 4 and suite.options()["running"] == "single, short"
    suite.close()
    assert not running(children)


def children_of_this():
    import os

    return running(children_of(os.getpid()))
