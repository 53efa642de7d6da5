"""The leaderboard: equal problems, ranks only among equals, honest intervals."""

import csv
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom
from shapely import Polygon

from planar_push.main import main
from push_model import se2
from push_model.jobs import JobError
from push_model.outlines import distance, inside
from push_model.se2 import transform
from push_model.settings import SettingsError
from push_scenario.scenario import load_scenario
from push_study.experiments import leaderboard
from push_study.leaderboard.contests import CONTESTS
from push_study.leaderboard.entries import ENTRIES, PLATES, POSES, POSITIONS, entries
from push_study.leaderboard.entry import Entry, Reproduction, Told
from push_study.leaderboard.match import Match, entry_of, play
from push_study.leaderboard.standings import cells, leads, mean_interval
from push_study.pool import guarded
from push_study.study import StudyOptions
from push_study.team_run import Outcome, TeamTrace

ALL, RADIUS = Told("exact", "all poses", "central"), Told("radius", "all poses", "central")
KIND = frozenset({POSITIONS})

OUTSIDER = Entry("outsider", "swarm", RADIUS, KIND, "a file of somebody else")
"""As a user's file brings one."""
AGAIN, LOST = replace(OUTSIDER, source="x"), replace(OUTSIDER, name="lost", system="nowhere")
REFUSER = Entry("refuser", "gibbs", ALL, frozenset({POSES}))
"""It takes no headings, and contests of poses have some."""


def row(method, success, value, contest="open-square", seed=1):
    found = {"scenario": contest, "method": method, "seed": seed, "success": success}
    found |= {"cpu_s": 1.0}
    reached = {"lambda": value, "charged_s": value, "path_ratio": 1.0, "clearance_m": 0.1}
    reached["robot_path_m"] = 3.0
    return found | (reached if success else {})


def corners(size):
    x, y = 0.5 * np.array(size)
    return [(-x, -y), (x, -y), (x, y), (-x, y)]


def named(*rows):
    return {entry.name: entry for entry in rows}


def test_every_kind_has_contests_and_at_least_two_methods():
    for kind in (POSITIONS, POSES, PLATES):
        assert sum(c.kind == kind for c in CONTESTS.values()) >= 2
        assert sum(kind in e.kinds for e in ENTRIES) >= 2
    rebuilt = {e.name for e in ENTRIES if e.reconstructed}
    assert rebuilt == {"global input", "occlusion", "Gibbs field", "NMPC", "Dubins push"}
    ranked = {e.name for e in ENTRIES if e.name in rebuilt and e.ranked}
    assert ranked == {"global input", "Dubins push"}, "update docs/rivals.md"


@pytest.mark.parametrize("name", CONTESTS)
def test_problems_depend_on_the_seed_alone_and_nothing_overlaps(name):
    contest, seen = CONTESTS[name], set()
    for seed in range(1, 13):
        one, two = contest.draw(seed), contest.draw(seed)
        assert all(
            np.array_equal(getattr(one, f), getattr(two, f), equal_nan=True)
            for f in ("start", "goal", "robots")
        )
        seen.add((*one.start, *one.goal, *one.robots.ravel()))
        outline = transform(one.start, one.item.outline)
        radius, places = one.robot.footprint_radius, one.robots[:, :2]
        assert not inside(outline, places).any()
        # A single robot stands as the thesis puts it: its bumper is what reaches farthest.
        least = radius if contest.kind != POSES else one.robot.body_radius
        assert (distance(outline, places) > least).all()
        apart = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
        assert (apart + 10.0 * np.eye(len(places)) > 2.0 * radius).all()
    assert len(seen) >= 12


def test_contests_of_positions_have_the_room_that_methods_need():
    for contest in CONTESTS.values():
        if contest.kind == POSITIONS:
            assert min(contest.draw(1).environment.size) >= 5.0


@pytest.mark.parametrize("environment", [1, 2, 3])
def test_every_match_of_an_environment_has_its_own_start_and_goal(environment):
    """Near the start and one of the targets of the thesis, and free of obstacles."""
    draw, most = CONTESTS[f"env{environment}"].draw, np.array([0.1, 0.1, 0.3]) + 1e-12
    drawn = []
    for seed in range(1, 61):
        problem = draw(seed)
        scenario = load_scenario(f"env{environment}-target{1 + seed % 3}")
        ((item, start),) = scenario.objects.values()
        assert (np.abs(problem.start - start) < most).all()
        assert (np.abs(problem.goal - scenario.goal) < most).all()
        ((_, place),) = scenario.robots.values()
        behind = se2.between(problem.start, problem.robots[0])
        assert np.allclose(behind, se2.between(start, place), atol=1e-12)
        walls = [Polygon(p.vertices) for p in problem.environment.polygons]
        for pose in (problem.start, problem.goal):
            body = Polygon(transform(pose, item.outline))
            assert all(wall.distance(body) > 0.01 for wall in walls)
        again = draw(seed)
        assert np.array_equal(again.start, problem.start) and np.array_equal(
            again.goal, problem.goal
        )
        drawn.append(tuple(problem.goal))
    assert len(set(drawn)) == 60


def test_ranks_are_among_methods_that_are_told_the_same():
    a, b, c = (Entry(n, "x", t, KIND) for n, t in (("a", ALL), ("b", ALL), ("c", RADIUS)))
    rebuilt = Entry("d", "x", ALL, KIND, reconstructed=True)
    rows = [row("a", True, 2.0 + 0.01 * k, seed=k) for k in range(20)]
    rows += [row("b", True, 3.0 + 0.012 * k, seed=k) for k in range(20)]
    rows += [row("c", k < 1, 9.0) for k in range(20)]
    rows += [row("d", True, 1.0) for _ in range(20)]
    found = {x.entry.name: x for x in cells(rows, named(a, b, c, rebuilt), ["open-square"])}
    assert {n: x.rank for n, x in found.items()} == {"a": 1, "b": 2, "c": 0, "d": 0}
    assert found["a"].leads == ("b",) and not found["b"].leads and not found["c"].leads
    assert found["d"].leads == (), "what does not reproduce its paper leads nobody"
    holds = Reproduction("43 of 45", "44 of 45", True, "a test")
    ranked = replace(rebuilt, reproduction=holds)
    found = {x.entry.name: x for x in cells(rows, named(a, b, c, ranked), ["open-square"])}
    assert found["d"].rank == 1 and found["a"].rank == 2
    assert "no reproduction" in rebuilt.why_not and ranked.why_not == ""
    missed = replace(rebuilt, reproduction=replace(holds, ours="7 of 45", holds=False))
    assert not missed.ranked and "43 of 45" in missed.why_not and "7 of 45" in missed.why_not


def test_a_lead_is_seldom_chance():
    """300 pairs of equal methods: hardly any leads the other; clearly better ones do."""
    random = np.random.default_rng(1)

    def cell(name, p, mean):
        entry = Entry(name, "x", ALL, KIND)
        made = [
            row(name, random.random() < p, random.normal(mean, 0.5), seed=seed)
            for seed in range(20)
        ]
        return cells(made, named(entry), ["open-square"])[0]

    pairs = [(cell("a", 0.9, 3.0), cell("b", 0.9, 3.0)) for _ in range(300)]
    assert sum(leads(a, b) or leads(b, a) for a, b in pairs) < 0.03 * 300
    better = sum(leads(cell("a", 1.0, 3.0), cell("b", 0.3, 3.0)) for _ in range(100))
    faster = sum(leads(cell("a", 1.0, 2.0), cell("b", 1.0, 3.5)) for _ in range(100))
    assert better > 95 and faster > 95


def test_lambda_is_compared_at_the_problems_that_both_solve():
    """Some problems take longer than others; a method that only solves short ones is no faster."""
    long = np.random.default_rng(3).uniform(1.0, 9.0, 20)

    def cell(name, solves, factor):
        entry = Entry(name, "x", ALL, KIND)
        made = [row(name, solves(w), factor * w, seed=k) for k, w in enumerate(long)]
        return cells(made, named(entry), ["open-square"])[0]

    def always(_):
        return True

    mine, slower = cell("a", always, 1.0), cell("b", always, 1.1)
    assert leads(mine, slower) and not leads(slower, mine)
    assert mine.lambda_interval[1] > slower.lambda_interval[0], "the intervals overlap all the same"
    short = cell("c", lambda w: w < 6.0, 1.0)
    assert short.lambda_ < mine.lambda_ and 12 <= short.successes <= 17
    assert not leads(short, mine) and not leads(mine, short)
    fast = cell("d", lambda w: w < 6.0, 0.9)
    assert not leads(fast, mine), "it reaches fewer goals"
    assert leads(fast, short)
    five = sorted(long)[4]
    for most, known in ((five, True), (five - 1e-9, False)):
        few = cell("e", lambda w, most=most: w <= most, 1.1)
        assert leads(cell("f", lambda w, most=most: w <= most, 1.0), few) == known


def test_intervals_cover_what_they_say():
    random = np.random.default_rng(2)
    hits = 0
    for _ in range(400):
        low, high = mean_interval(random.normal(5.0, 2.0, 12))
        hits += low < 5.0 < high
    assert 0.92 * 400 <= hits <= 0.98 * 400
    assert binom.cdf(hits, 400, 0.95) > 1e-3
    assert mean_interval(np.array([1.0])) == (-math.inf, math.inf)


def test_names_of_methods():
    assert tuple(entries().values()) == ENTRIES
    assert [e.name for e in entries(("crescent", "group")).values()] == ["crescent", "group"]
    name = "tests.push_study.test_leaderboard:OUTSIDER"
    assert entries((name,)) == {name: OUTSIDER}
    with pytest.raises(SettingsError, match="no method called 'cresent'"):
        entries(("cresent",))
    with pytest.raises(SettingsError, match="are called 'outsider'"):
        entries((name, name.replace("OUTSIDER", "AGAIN")))
    with pytest.raises(SettingsError, match=r"lost: .*nowhere"):
        entries((name.replace("OUTSIDER", "LOST"),))
    with pytest.raises(SettingsError, match="unknown kind 'position'"):
        replace(OUTSIDER, kinds=frozenset({"position"}))
    with pytest.raises(SettingsError, match=r"robots: expected .*, got 'rumours'"):
        Told("seen", "rumours", "central")
    with pytest.raises(SettingsError, match="not an Entry"):
        entry_of("tests.push_study.test_leaderboard:ALL")
    with pytest.raises(SettingsError, match="no contest"):
        leaderboard.tasks(StudyOptions(("nowhere",), 1, 1, "", methods=("crescent",)))
    with pytest.raises(SettingsError, match="'crescent' takes part in contests of positions"):
        leaderboard.tasks(StudyOptions(("env1",), 1, 1, "", methods=("crescent",)))


def test_the_parameters_of_an_entry_reach_its_method(monkeypatch):
    """The printed planner is not ours: it makes other plans."""
    seen = {}
    module = "push_study.leaderboard.match"

    def spy(system, scenario, *_, **__):
        seen[len(seen)] = dict(scenario.parameters.get(system, {}))
        raise InterruptedError

    monkeypatch.setattr(f"{module}.run_team", spy)
    for entry in ENTRIES:
        name = next(c.name for c in CONTESTS.values() if c.kind in entry.kinds)
        with pytest.raises(InterruptedError):
            play(Match(name, 1, "", entry.name, "planar", "mild"))
        told = seen[len(seen) - 1]
        for key, value in entry.parameters.get(entry.system, {}).items():
            flat = told[key]
            assert value.items() <= flat.items(), entry.name


def test_what_a_method_refuses_or_breaks_counts_against_it():
    name = "tests.push_study.test_leaderboard:REFUSER"
    match = Match("env1", 1, "", name, "planar", "mild")
    refused = leaderboard.trial(match)
    assert not refused["success"] and refused["reason"].startswith("refused: ")
    assert "crashed" not in refused and "lambda" not in refused
    good = row(name, True, 2.0, "env1")
    broken = guarded(lambda task: 1 / 0, match)
    assert broken["crashed"] and "ZeroDivisionError" in broken["reason"]
    (cell,) = cells([good, refused, broken], {name: REFUSER}, ["env1"])
    assert (cell.successes, cell.trials) == (1, 3)
    assert leaderboard.statistics([good, refused, broken])["env1, refuser"]["trials"] == 3


@pytest.mark.parametrize(("name", "method"), [("env2", "one robot"), ("open-square", "crescent")])
def test_who_touches_an_obstacle_has_not_reached_the_goal(name, method, monkeypatch):
    """Swarms may touch the walls of their empty room."""
    problem = CONTESTS[name].draw(1)
    ways = np.array([problem.start, problem.start + [0.0, 0.02, 0.0]])
    robots = np.broadcast_to(problem.robots, (2, *problem.robots.shape))

    def told(ticks):
        trace = TeamTrace(obstacle_ticks=ticks, ways=list(np.hstack([ways[:, None], robots])))
        outcome = Outcome(1, JobError.NONE, "", 30.0, 1.0, 1.0, (0.001, 0.01), trace, {})
        monkeypatch.setattr("push_study.leaderboard.match.run_team", lambda *_, **__: outcome)
        return play(Match(name, 1, "", method, "planar", "mild"))

    clean, touched = told(0), told(3)
    assert clean["success"] and touched["obstacle_ticks"] == 3
    room = Polygon(corners(problem.environment.size)).exterior
    walls = [Polygon(p.vertices) for p in problem.environment.polygons] + [room]
    outlines = [Polygon(transform(pose, problem.item.outline)) for pose in ways]
    exact = min(wall.distance(outline) for wall in walls for outline in outlines)
    cell = problem.environment.resolution
    assert exact - 1.5 * cell < clean["clearance_m"] < exact + 1e-9
    if name == "env2":
        assert not touched["success"] and "touched obstacles, in 3 ticks" in touched["reason"]
        assert "lambda" not in touched and "clearance_m" not in touched
    else:
        assert touched["success"] and touched["clearance_m"] == clean["clearance_m"]


def test_only_settings_that_a_method_has_are_set(monkeypatch):
    seen = []

    def spy(system, scenario, *_, **__):
        seen.append(scenario.parameters.get(system, {}))
        raise InterruptedError

    monkeypatch.setattr("push_study.leaderboard.match.run_team", spy)
    for method in ("crescent", "occlusion", "global input"):
        with pytest.raises(InterruptedError):
            play(Match("open-square", 7, "", method, "planar", "mild"))
    rules = {"position_tolerance": 0.1, "orientation": False, "stalled": 180.0}
    assert rules.items() <= seen[0].items() and "seed" not in seen[0]
    assert seen[1] == seen[2] == {**rules, "seed": 7}


def test_a_changed_file_of_somebody_else_is_played_again(tmp_path, monkeypatch):
    """The rows of the suite are known by its revision."""
    file = tmp_path / "a_rival_from_outside.py"
    text = "from tests.push_study.test_leaderboard import OUTSIDER\n"
    file.write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    options = StudyOptions(
        scenarios=("open-square",), out=tmp_path / "x", seed=5, trials=1,
        methods=("crescent", "a_rival_from_outside:OUTSIDER"),
    )  # fmt: skip
    first, same = leaderboard.tasks(options), leaderboard.tasks(options)
    file.write_text(text + "# another version\n")
    ours, theirs = leaderboard.tasks(options)
    assert first == same and ours == first[0] and ours.source == ""
    assert theirs != first[1] and theirs.source != first[1].source


@pytest.mark.long
def test_one_command_makes_the_page_with_a_method_from_outside(tmp_path, monkeypatch, capsys):
    """A short slice: two methods of the suite and one of somebody else; equal seeds, equal rows."""
    rows = []
    for out in (tmp_path / "a", tmp_path / "b"):
        words = ["leaderboard", "--contests", "open-square", "--trials", "1", "--seed", "5"]
        words += ["--methods", "crescent,tests.push_study.test_leaderboard:OUTSIDER"]
        assert main([*words, "--out", str(out), "--workers", "2"]) == 0
        with (out / "leaderboard.csv").open() as file:
            table = list(csv.DictReader(file))
        rows.append([{k: v for k, v in r.items() if k != "cpu_s"} for r in table])
    strip = [{k: v for k, v in r.items() if not k.startswith("lambda")} for r in rows[0]]
    assert rows[0][0]["method"] == "crescent" and rows[0][0]["successes"] == "1"
    assert {r["method"] for r in rows[0]} == {"crescent", "outsider"}
    again = [{k: v for k, v in r.items() if not k.startswith("lambda")} for r in rows[1]]
    assert strip == again
    page = (tmp_path / "a" / "leaderboard.html").read_text()
    assert "outsider" in page and "Leaderboard" in page and "http" not in page.split("<body")[1]
    assert "open-square" in capsys.readouterr().out
