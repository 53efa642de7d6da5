"""Who is in a team: bodies that the scenario does not name are obstacles until they are robots."""

import pytest

from push_model.settings import SettingsError
from push_ros.roster import MOST, Roster, RosterSettings

KNOWN = {"other": 0.3}


def roster(open_team=True, **settings):
    return Roster(RosterSettings(**settings), ("e0", "e1"), KNOWN, 0.05, open_team)


def test_a_body_that_nobody_knows_is_an_obstacle_as_large_as_a_robot_or_as_is_said():
    for settings, radius in (({}, 0.05), ({"unknown_radius": 0.4}, 0.4)):
        team = roster(**settings)
        assert team.meet(["e0", "e1", "box", "other", "x"], "box")
        assert team.robots == ("e0", "e1") and team.obstacles == {"other": 0.3, "x": radius}
        assert not team.meet(["x", "box"], "box")


def test_a_pattern_takes_robots_in_and_releases_them():
    team = roster(further=("x?",))
    team.meet(["x1", "y1", "x10"], "box")
    assert team.robots == ("e0", "e1", "x1") and set(team.obstacles) == {"other", "y1", "x10"}
    team.change(RosterSettings(further=("y*", "x10")))
    assert team.robots == ("e0", "e1", "y1", "x10")
    assert team.released() == ("x1",) and team.released() == ()
    assert set(team.obstacles) == {"other", "x1"}


def test_what_the_scenario_names_is_never_taken_in():
    team = roster(further=("*",))
    team.meet(["e0", "box", "other"], "box")
    assert team.robots == ("e0", "e1") and team.obstacles == KNOWN


def test_a_team_of_a_fixed_number_takes_nobody():
    with pytest.raises(SettingsError, match="takes no further robots; got x"):
        roster(open_team=False, further=("x*",))
    team = roster(open_team=False)
    with pytest.raises(SettingsError):
        team.change(RosterSettings(further=("x*",)))
    team.meet(["x"], "box")
    assert "x" in team.obstacles and team.robots == ("e0", "e1")


def test_names_without_end_are_bounded():
    team = roster()
    for k in range(30):
        team.meet([f"n{100 * k + i}" for i in range(100)], "box")
    assert len(team.obstacles) == MOST + 1
