"""GCo and our group in its simulator, where its environment is installed (make gco)."""

import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from planar_push.main import main
from push_model.drives import HolonomicDrive
from push_model.settings import SettingsError
from push_model.specs import EnvironmentSpec
from push_study.by_scenario import Episode
from push_study.experiments import gco
from push_study.gco import room, team
from push_study.gco.problems import ROOMS, problem
from push_study.other_python import OtherPython
from push_study.study import StudyOptions
from sim_bridge.planar_world import PlanarSettings, PlanarWorld
from tests.push_study.test_bench_push import installed


def test_without_its_environment_the_study_says_what_to_do(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv(room.PYTHON, str(tmp_path / "nowhere"))
    out = tmp_path / "out"
    assert main(["experiment", "gco", "--trials", "1", "--out", str(out)]) == 2
    assert "make gco" in " ".join(capsys.readouterr().err.split()) and not out.exists()


def test_an_unknown_scenario_is_refused(tmp_path):
    with pytest.raises(SettingsError, match="no scenario called 'open'"):
        gco.tasks(StudyOptions(("open",), 1, 1, tmp_path))


def test_a_room_that_does_not_start_says_why(monkeypatch):
    """A Python without GCo."""
    monkeypatch.setenv(room.PYTHON, sys.executable)
    with (
        room.Room(problem("open", 2, 1)) as made,
        pytest.raises(RuntimeError, match="No module named"),
    ):
        made.reset()


def test_random_problems_leave_room_and_do_not_depend_on_how_many_robots_there_are():
    shapes = set()
    for name in ("open", "pillar"):
        for seed in range(300):
            two, three = problem(name, 2, seed), problem(name, 3, seed)
            assert three.robots[:2] == two.robots and three.goal == two.goal
            shapes.add(two.shape)
            reach = two.size[0] if two.shape == "circle" else 0.5 * math.hypot(*two.size)
            start, goal = two.start[:2], two.goal[:2]
            assert 0.5 <= math.dist(start, goal) <= 2.0 + 1e-9 and abs(two.goal[2]) <= 1.5
            for robot in three.robots:
                assert math.dist(robot, start) > reach + team.RADIUS + 0.05
                for x, y, radius in three.obstacles:
                    assert math.dist(robot, (x, y)) > radius + team.RADIUS + 0.05
            for x, y, radius in two.obstacles:
                assert min(math.dist(p, (x, y)) for p in (start, goal)) > radius + reach + 0.1
                assert 2.0 * math.dist(start, (x, y)) == pytest.approx(math.dist(start, goal))
    assert shapes == {"circle", "rectangle"}


def test_given_problems_are_those_of_the_authors():
    """Ways, turns and obstacles of the evaluation script of yoraish/gco (afc27db)."""
    told = {(p.goal, p.obstacles) for p in (problem("given", 3, seed) for seed in range(8))}
    assert told == {
        ((0.0, 2.0, 0.0), ()), ((0.0, 0.0, 0.0), ()),
        ((-1.0, 1.0, 0.0), ()), ((1.0, 1.0, 0.0), ()),
        ((0.0, 3.0, 2.0), ((0.0, 2.0, 0.1),)), ((0.0, -1.0, -2.0), ((0.0, 0.0, 0.1),)),
        ((-2.0, 1.0, 2.0), ((-1.0, 1.0, 0.1),)), ((2.0, 1.0, -2.0), ((1.0, 1.0, 0.1),)),
    }  # fmt: skip


def test_errors_are_of_the_heading_modulo_a_turn():
    what = problem("given", 2, 5)
    off = what.errors(what.target + [0.03, -0.04, 2.0 * math.pi - 0.1])
    assert off == pytest.approx((0.05, 0.1))


def test_discs_are_dragged_as_robots_on_wheels_would_drive():
    told = {"time_s": 0.0, "object": [0.0, 0.0, 0.0], "robots": [[0.0, 0.0], [1.0, 0.0]]}
    discs = team.Discs(told, ["a", "b"])
    turn = 0.25 * math.pi / room.TICK  # faster than the wheels allow
    discs.drive(told, [(0.0, turn), (0.1, 0.0)])
    seen = discs.seen(told)
    most = team.ROBOT.max_turn_rate * room.TICK
    assert seen.robots["a"][2] == pytest.approx(most) and seen.robots["b"][2] == 0.0
    assert discs._targets[1] == pytest.approx([1.0 + 0.1 * room.TICK, 0.0])
    for _ in range(100):  # a disc that stands is not dragged farther and farther away from itself
        targets = discs.drive(told, [(0.2, 0.0), (0.2, 0.0)])
    assert np.hypot(*(targets - told["robots"]).T) == pytest.approx([0.02, 0.02])


class PlanarRoom:
    """In the place of GCo's simulator: the planar world, in which discs are dragged by a spring."""

    def __init__(self, what):
        drive = HolonomicDrive(max_speed=2.0, max_turn_rate=1.0, max_force=40.0)
        disc = replace(team.ROBOT, drive=drive, casters=())
        self.what, self.names = what, [f"robot_{k}" for k in range(len(what.robots))]
        robots = {
            n: (disc, np.array([*place, 0.0]))
            for n, place in zip(self.names, what.robots, strict=True)
        }
        start = np.array(what.start) + [0.0, 0.0, 0.5 * math.pi]
        self.world = PlanarWorld(
            EnvironmentSpec((8.0, 8.0), resolution=0.05),
            robots,
            {"object": (team._item(what), start)},
            PlanarSettings(time_step=room.TICK / 7),
        )
        self.time = self.path = 0.0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def tell(self):
        poses = self.world.poses()
        robots = [poses[n][:2].tolist() for n in self.names]
        return {
            "time_s": self.time, "object": poses["object"].tolist(), "robots": robots,
            "path_m": self.path, "touched": False,
        }  # fmt: skip

    reset = tell

    def move(self, targets):
        here = np.array(self.tell()["robots"])
        twists = np.column_stack([(targets - here) / room.TICK, np.zeros(len(here))])
        self.world.command_all(self.names, twists, fixed_frame=True)
        self.world.step(7)
        self.time += room.TICK
        self.path += float(np.hypot(*(np.array(self.tell()["robots"]) - here).T).sum())
        return self.tell()

    def solve(self, away, turned):
        return {**self.tell(), "pushes": 0, "rounds": 0, "why": "", "cpu_s": 0.0}


@pytest.mark.parametrize("scenario", ["open-2-group-wide", "given-3-group-narrow"])
def test_our_group_reaches_the_goal_in_a_room_of_dragged_discs(monkeypatch, scenario):
    monkeypatch.setattr(gco, "Room", PlanarRoom)
    row = gco.trial(Episode(scenario, 4))
    away, turned = gco.TOLERANCES[scenario.split("-")[-1]]
    assert row["success"] and row["reason"] == "" and row["pushes"] >= 1
    assert row["error_m"] <= away and row["error_rad"] <= turned
    assert row["time_s"] > 5.0 and row["path_m"] > 1.0 and row["touched"] == 0


def test_a_goal_that_is_not_reached_is_told_with_the_error(monkeypatch):
    monkeypatch.setattr(gco, "Room", PlanarRoom)
    row = gco.trial(Episode("given-2-gco-wide", 0))
    assert (
        not row["success"] and row["reason"] == "the object is 1000 mm and 0.00 rad from the goal"
    )


def test_a_goal_in_an_obstacle_is_refused(monkeypatch):
    what = problem("pillar", 2, 1)
    blocked = replace(what, goal=(*what.obstacles[0][:2], 0.0))
    outcome = team.push(PlanarRoom(what), blocked, 0.02, 0.1)
    assert "overlap an obstacle" in outcome.reason and outcome.pushes == 0


def test_methods_are_compared_at_the_problems_that_both_solve(tmp_path, capsys):
    rows = []
    for seed in range(1, 6):
        for method, time in (("group", 30.0 + seed), ("gco", 20.0)):
            row = {"scenario": f"open-2-{method}-wide", "seed": seed, "success": True}
            row |= dict.fromkeys(gco.MEASURES, 1.0) | {"time_s": time}
            rows.append(row)
    rows[-1] |= {"success": False, "time_s": 600.0}
    found = gco.statistics(rows)
    low, high = found["time_s_less_than_gco_open-2-group-wide"]
    assert low + high == pytest.approx(2.0 * 12.5) and found["path_m_open-2-gco-wide"] == (1, 1)
    assert found["wilson_open-2-gco-wide"][1] < 1.0
    gco.conclude(StudyOptions(("open-2-gco-wide",), 5, 1, tmp_path), [], rows)
    assert "reached 4 of 5" in capsys.readouterr().out


def test_touches_count_also_where_the_goal_is_not_reached():
    rows = []
    for seed, good in ((1, True), (2, False), (3, False)):
        row = {"scenario": "open-2-gco-wide", "seed": seed, "success": good}
        rows.append(row | dict.fromkeys(gco.MEASURES, 1.0) | {"touched": int(not good)})
    low, high = gco.statistics(rows)["touched_open-2-gco-wide"]
    assert low + high == pytest.approx(4.0 / 3.0)


def test_a_script_that_hangs_is_ended(tmp_path):
    script = tmp_path / "hangs.py"
    script.write_text("import sys, time\nsys.stdin.readline()\ntime.sleep(600)\n")
    with OtherPython(Path(sys.executable), script) as other:
        process = other._process
        with pytest.raises(RuntimeError, match="no answer within 1 s"):
            other.ask({}, 1.0)
        process.kill()
    assert process.poll() is not None


@pytest.mark.skipif(not installed(room.python), reason="the environment of GCo is not installed")
def test_the_room_tells_time_ways_and_touches():
    """A robot is dragged past the object into the obstacle; the object's heading is as it was told,
    a quarter turn more than GCo counts it."""
    what = replace(problem("pillar", 2, 1), robots=((2.0, 2.0), (3.0, 3.0)))
    what = replace(what, obstacles=((2.3, 2.0, 0.1),), start=(0.0, 1.0, 0.4))
    with room.Room(what) as made:
        told, targets = made.reset(), np.array(what.robots)
        assert told["object"] == pytest.approx([0.0, 1.0, 0.4 + 0.5 * math.pi], abs=1e-6)
        assert told["time_s"] == told["path_m"] == 0.0 and not told["touched"]
        for k in range(100):
            if targets[0, 0] < 2.2:
                targets[0, 0] += 0.1 * room.TICK
            told = made.move(targets)
            assert told["time_s"] == pytest.approx((k + 1) * room.TICK)
            if told["robots"][0][0] < 2.145:
                assert not told["touched"]
        assert told["touched"] and told["path_m"] == pytest.approx(0.15, abs=0.01)
        with pytest.raises(RuntimeError, match="one room"):
            made.reset()


@pytest.mark.long
@pytest.mark.skipif(not installed(room.python), reason="the environment of GCo is not installed")
@pytest.mark.parametrize("name", ROOMS)
def test_both_reach_goals_and_equal_seeds_give_equal_rows(name):
    for method in gco.METHODS:
        tasks = [Episode(f"{name}-3-{method}-wide", seed) for seed in (2, 3)]
        rows = [gco.trial(task) for task in tasks]
        assert all(row["success"] and row["path_m"] > 1.0 for row in rows)
        again = gco.trial(tasks[0])
        assert {k: v for k, v in again.items() if k != "cpu_s"} == {
            k: v for k, v in rows[0].items() if k != "cpu_s"
        }
