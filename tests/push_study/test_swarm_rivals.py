"""Other people's swarms, and the experiment that sets them beside ours."""

import math
from dataclasses import replace

import numpy as np
import pytest

from push_job.open_room import OpenRoom
from push_model import se2
from push_model.outlines import distance, inside
from push_model.settings import SettingsError
from push_scenario.bodies import load_object
from push_study.experiments import rival_papers, swarm_rivals
from push_study.reproductions import gibbs as paper_of_gibbs
from push_study.reproductions import global_input as paper
from push_study.reproductions import occlusion as paper_of_occlusion
from push_study.rivals.gibbs import Gibbs, _add_walls, _neighbours, _reach
from push_study.rivals.global_input import GlobalInput
from push_study.rivals.occlusion import Occlusion
from push_study.study import StudyOptions
from push_study.swarm.contest import RIVALS, TARGET, RivalTask, run
from push_study.swarm.figures import draw_figures
from tests.samples import slice_and_study

SQUARE = load_object("transport_square")
ARENA = OpenRoom((3.0, 3.0), SQUARE, 0.05, 0.128, np.array(TARGET), 1)
HERE = np.array([-0.7, -0.7, 0.0])


def test_the_global_input_is_the_same_for_all_and_regroups_a_scattered_swarm():
    rival = GlobalInput(ARENA)
    random = np.random.default_rng(1)
    wide = np.column_stack([random.uniform(-1.3, 1.3, (20, 2)), np.zeros(20)])
    u = rival.velocities(0.0, HERE, wide)
    assert np.ptp(u, axis=0) == pytest.approx([0.0, 0.0], abs=1e-12)
    assert np.hypot(*u[0]) == pytest.approx(0.128, rel=1e-6)
    corner = 1.5 * np.sign(wide[:, :2].mean(axis=0))
    way = corner - wide[:, :2].mean(axis=0)
    assert u[0] @ way == pytest.approx(0.128 * np.hypot(*way))
    behind = np.array([-1.1, -1.1, 0.0]) + 0.02 * random.normal(size=(20, 3))
    pushed = GlobalInput(ARENA).velocities(0.0, HERE, behind)
    assert (pushed @ (TARGET - HERE[:2]) > 0.0).all()


def test_its_policy_leads_from_everywhere_to_the_target_away_from_walls():
    rival = GlobalInput(ARENA)
    for start in np.random.default_rng(2).uniform(-1.2, 1.2, (50, 2)):
        at = start.copy()
        for _ in range(200):
            way = rival._way(at / rival._unit)
            at = at + 0.03 * way / np.hypot(*way)
            if np.hypot(*(at - TARGET)) < 0.1:
                break
        assert np.hypot(*(at - TARGET)) < 0.1 and np.abs(at).max() < 1.3


def _swarm(middle, deviation: float, seed: int = 3) -> np.ndarray:
    places = deviation * np.random.default_rng(seed).normal(size=(20, 2))
    places = deviation * (places - places.mean(axis=0)) / places.std(axis=0)
    return np.column_stack([np.array(middle) + places, np.zeros(20)])


def test_the_global_input_regroups_with_hysteresis_and_drops_it_after_five_seconds():
    """Variances in lengths of theirs: above 0.48 n r on, below 0.18 n r off; and off when the mean
    moves."""
    rival = GlobalInput(ARENA)
    scale = rival._unit * math.sqrt(20 * 0.05 / rival._unit)
    spread = {part: scale * math.sqrt(part) for part in (0.15, 0.21, 0.46, 0.5)}
    corner = np.array([-1.5, -1.5])

    def regroups(time: float, middle, part: float) -> bool:
        u = rival.direction(time, HERE, _swarm(middle, spread[part]))
        way = corner - middle
        return bool(u @ way > 0.999 * np.hypot(*way))

    place = np.array([-0.2, -0.9])
    assert not regroups(0.0, place, 0.46) and regroups(0.5, place, 0.5)
    assert regroups(1.0, place, 0.46) and regroups(1.5, place, 0.21)
    assert not regroups(2.0, place, 0.15) and not regroups(2.5, place, 0.46)
    assert regroups(3.0, place, 0.5)
    assert not regroups(5.1, place + 0.1, 0.46), "it has moved"


def test_the_global_input_goes_to_another_corner_when_the_mean_has_stopped():
    rival, swarm = GlobalInput(ARENA), _swarm([1.2, -1.2], 0.2)
    times = np.arange(0.0, 21.0, 0.5)
    found = [rival.direction(t, np.zeros(3), swarm) for t in times]
    corners = []
    for u in found[11:]:
        ways = np.array([[1.5, 1.5], [-1.5, 1.5], [-1.5, -1.5], [1.5, -1.5]]) - [1.2, -1.2]
        corners.append(int((ways @ u / np.hypot(*ways.T)).argmax()))
    assert corners[0] == 3 and set(corners) == {3, 0, 1}


def test_the_global_input_keeps_a_direction_for_a_second():
    rival, found = GlobalInput(ARENA), []
    for k in range(150):
        place = [-1.1 + 0.002 * k, -0.9]
        found.append(rival.direction(0.02 * k, HERE, _swarm(place, 0.05)))
    changes = np.any(np.diff(found, axis=0) != 0.0, axis=1)
    assert changes.sum() == 2


@pytest.mark.long
def test_the_global_input_leads_the_mean_round_the_object():
    """From in front of it to behind it, without running into it, from six places."""
    toward = (np.array(TARGET) - HERE[:2]) / np.hypot(*(np.array(TARGET) - HERE[:2]))
    for angle in np.linspace(-0.4, 0.4, 6):
        c, s = math.cos(angle), math.sin(angle)
        mean = HERE[:2] + 0.45 * np.array(
            [c * toward[0] - s * toward[1], s * toward[0] + c * toward[1]]
        )
        rival, nearest = GlobalInput(ARENA), math.inf
        for k in range(4000):
            mean = mean + 0.02 * 0.128 * rival.direction(0.02 * k, HERE, _swarm(mean, 0.02))
            nearest = min(nearest, np.hypot(*(mean - HERE[:2])))
            if (HERE[:2] - mean) @ toward > 0.9 * np.hypot(*(HERE[:2] - mean)):
                break
        assert k < 3999 and nearest > 0.2


def test_only_robots_in_the_region_of_the_object_count():
    """In the room of the paper: the object is at the bottom, most robots are at the top."""
    law = GlobalInput(
        OpenRoom((18.0, 18.0), paper.hexagon(), 0.15, 1.0, np.array([6.0, -7.0]), 1), paper.floor()
    )
    bottom, top = np.array([-5.0, 7.5]), np.array([6.0, -7.0])
    many = np.vstack([_swarm(bottom, 0.3), _swarm(bottom, 0.3, 4), _swarm(top, 0.3)])
    alone = GlobalInput(law._arena, paper.floor()).direction(0.0, np.array([-3, 5.5, 0]), many[:40])
    assert law.direction(0.0, np.array([-3.0, 5.5, 0.0]), many) == pytest.approx(alone)
    few = np.vstack([_swarm(bottom, 0.3), _swarm(top, 0.3), _swarm(top, 0.3, 4)])
    way = np.array([9.0, 9.0]) - bottom  # where robots of all regions meet
    told = law.direction(0.1, np.array([-3.0, 5.5, 0.0]), few)
    assert told @ way == pytest.approx(np.hypot(*way), rel=1e-3)
    none = np.vstack([_swarm(top, 0.3), _swarm(top, 0.3, 4)])
    way = np.array([9.0, 9.0]) - top
    told = law.direction(0.2, np.array([-3.0, 5.5, 0.0]), none)
    assert told @ way == pytest.approx(np.hypot(*way), rel=1e-3)


def test_the_policy_of_the_paper_leads_round_both_walls():
    law = GlobalInput(
        OpenRoom((18.0, 18.0), paper.hexagon(), 0.15, 1.0, np.array([6.0, -7.0]), 1), paper.floor()
    )
    random, cells, tried = np.random.default_rng(5), np.argwhere(~paper.floor().blocked), 0
    for cell in random.permutation(cells)[:100]:
        at = cell.copy()
        for _ in range(80):
            if np.abs(at - [16, 3]).max() < 2:
                break
            at = at + law._ways[tuple(at)].astype(int)
            assert not paper.floor().blocked[tuple(at)]
        assert np.abs(at - [16, 3]).max() < 2
        tried += 1
    assert tried == 100


@pytest.mark.parametrize("count", slice_and_study([4, 8], 1))
def test_the_global_input_reaches_the_figure_of_its_authors_in_their_simulation(count):
    """90 s ± 35 s in ten trials; of their own code, 57 of 60 runs take less than 300 s, with a
    median of 69 s."""
    rows = [paper.run(seed, 300.0) for seed in range(1, count + 1)]
    assert rows[0] == paper.run(1, 300.0)
    assert sum(r["success"] for r in rows) >= 0.75 * count
    assert 45.0 < np.median([r["duration_s"] for r in rows]) < 130.0


def test_robots_push_where_the_object_hides_the_goal_and_go_along_it_elsewhere():
    toward = np.array(TARGET) - HERE[:2]
    toward /= np.hypot(*toward)
    robots = np.zeros((2, 3))
    robots[0, :2], robots[1, :2] = HERE[:2] - 0.36 * toward, HERE[:2] + 0.36 * toward
    moved = Occlusion(ARENA).velocities(0.0, HERE, robots)
    assert moved[0] @ toward > 0.6 * 0.128  # hidden from the goal: it pushes
    assert abs(moved[1] @ toward) < 0.9 * 0.128  # before it: along
    blocked = np.array([[*(HERE[:2] - away * toward), 0.0] for away in (0.34, 0.43)])
    assert Occlusion(ARENA).velocities(0.0, HERE, blocked)[1] @ toward < 0.9 * 0.128


def test_the_random_field_draws_robots_to_the_object_where_it_hides_the_target():
    toward = (np.array(TARGET) - HERE[:2]) / np.hypot(*(np.array(TARGET) - HERE[:2]))
    robots = np.array([[*(HERE[:2] - 0.40 * toward), 0.25 * math.pi]])
    gone = []
    for seed in range(20):
        rival = Gibbs(OpenRoom((3.0, 3.0), SQUARE, 0.05, 0.128, np.array(TARGET), seed))
        gone.append(rival.velocities(0.0, HERE, robots)[0])
    assert np.mean(np.array(gone) @ toward) > 0.02
    assert np.hypot(*np.array(gone).T).max() <= 0.128 + 1e-9


FAR = OpenRoom((9.0, 9.0), SQUARE, 0.05, 0.128, np.array([3.0, 3.0]), 1)  # nothing within reach
AT_THE_WALL = np.array([4.0, -4.0, 0.0])


@pytest.mark.parametrize(("speed", "pace"), [(0.128, 1.0), (0.25, 1.0), (0.06, 0.5)])
def test_robots_of_the_random_field_steer_as_in_the_code_of_its_authors(speed, pace):
    """Twice as fast as drawn, to a limit; the turn rate by how far the robot has to turn."""
    arena = replace(FAR, speed=speed)
    drawn = Gibbs(arena).velocities(0.0, AT_THE_WALL, np.zeros((1, 3)))[0]
    direction = math.atan2(drawn[1], drawn[0])
    for off in (-2.5, -0.5, -0.1, -0.08, 0.03, 0.08, 0.1, 1.5):
        robots = np.array([[0.0, 0.0, direction - off]])
        v, omega = Gibbs(arena).twists(0.0, AT_THE_WALL, robots)[0]
        far = abs(off) > math.pi / 36.0
        assert v == pytest.approx(pace * (0.06 if far else 0.12))  # it draws 0.3 m/s at first
        assert omega == pytest.approx(pace * (1.8 if far else 0.8) * off)


def test_the_random_field_decides_fifteen_times_a_second():
    rival, drawn = Gibbs(FAR), []
    for k in range(500):
        drawn.append(rival.velocities(0.02 * k, AT_THE_WALL, np.zeros((1, 3)))[0])
    changes = np.any(np.diff(drawn, axis=0) != 0.0, axis=1)
    assert changes.sum() == pytest.approx(150, abs=2)


def test_the_random_field_keeps_off_the_outline_at_the_goal_and_does_not_see_through_it():
    """Robots in front of an edge of that outline, 10 cm and 30 cm off."""
    goal, room = SQUARE.geometry.outline, np.array(FAR.size)
    extent = float(np.hypot(*goal.T).max())
    edge = goal[:, 0].max()
    tried = np.array([[1.0, 0.0], [0.0, 0.0], [-1.0, 0.0]])  # 10 ms ahead
    for off, some in ((0.10, True), (0.30, False)):
        robot = np.array([edge + off, 0.0, 0.0])
        U = np.zeros(3)
        _add_walls(U, robot, tried, room, goal, np.zeros(2), extent)
        assert (U[0] < U[1] < U[2]) if some else (U == 0.0).all()
    seen = _neighbours(
        np.array([[-0.22, 0.1], [0.22, 0.1], [0.3, 0.3]]),
        se2.transform(AT_THE_WALL, SQUARE.geometry.outline),
        goal,
    )
    assert not seen[0, 1] and not seen[1, 0] and seen[1, 2] and seen[2, 1]


def test_robots_of_the_paper_start_apart_from_each_other_and_from_the_object():
    outline = se2.transform(np.array(paper_of_gibbs.START), paper_of_gibbs._OBJECT.outline)
    for seed in range(50):
        places = paper_of_gibbs.starts(np.random.default_rng(seed), 20)[:, :2]
        assert not inside(outline, places).any() and distance(outline, places).min() > 0.04
        gaps = np.hypot(*(places[:, None] - places).transpose(2, 0, 1)) + np.eye(20)
        assert gaps.min() > 0.2 and np.abs(places).max() <= 1.8


def test_robots_of_the_other_paper_start_apart_from_each_other_the_object_and_the_goal():
    for seed in range(50):
        places = paper_of_occlusion.starts(np.random.default_rng(seed), 20)[:, :2]
        gaps = np.hypot(*(places[:, None] - places).transpose(2, 0, 1)) + np.eye(20)
        assert gaps.min() >= 0.12 and np.abs(places).max() < 1.41
        assert np.hypot(*(places - [1.0, 1.0]).T).min() >= 0.28
        assert np.hypot(*(places + [1.0, 1.0]).T).min() >= 0.36
    assert pytest.approx(0.533, abs=5e-4) == paper_of_occlusion.REACHED


@pytest.mark.long
def test_equal_seeds_give_equal_runs_in_the_setting_of_the_other_paper(tmp_path, capsys):
    task = rival_papers.PaperTask("occlusion-20", 3, str(tmp_path), "planar", "mild", 20.0)
    rows = [rival_papers.trial(task) for _ in range(2)]
    assert rows[0] == rows[1] and rows[0]["nearest_m"] < 2.5
    rival_papers.conclude(StudyOptions(("occlusion-20",), 2, 1, tmp_path), [task], rows)
    assert "of 2 " in capsys.readouterr().out


def test_a_study_with_a_simulation_of_its_own_refuses_the_options_of_ours(tmp_path):
    for name in ("world", "uncertainty"):
        options = StudyOptions(("global-100",), 1, 1, tmp_path, asked=frozenset({name}))
        with pytest.raises(SettingsError, match=f"--{name}"):
            rival_papers.tasks(options)
        mixed = replace(options, scenarios=("global-100", "gibbs-2"))
        assert [t.scenario for t in rival_papers.tasks(mixed)] == ["global-100", "gibbs-2"]


def test_the_speed_of_an_object_is_that_towards_the_goal():
    """It stands for a second, goes at 1 cm/s for ten and at 5 cm/s for two, then back."""
    step = 0.2 * np.repeat([0.0, 0.01, 0.05, -0.02], [5, 50, 10, 15])
    away = 1.7 - np.concatenate([[0.0], step.cumsum()])
    found = paper_of_gibbs.paces(away)
    assert found["pace_m_s"] == pytest.approx(0.01)
    assert found["fastest_m_s"] == pytest.approx((0.05 * 5 + 0.01 * 5) / 10)
    assert paper_of_gibbs.paces(away[:10]) == {}


@pytest.mark.long
def test_equal_seeds_give_equal_runs_in_the_setting_of_the_paper(tmp_path, capsys):
    task = rival_papers.PaperTask("gibbs-4", 1, str(tmp_path), "planar", "mild", 60.0)
    rows = [rival_papers.trial(task) for _ in range(2)]
    assert rows[0] == rows[1] and not rows[0]["success"]
    assert 5.0 < rows[0]["first_motion_s"] < 60.0 and 0.1 < rows[0]["nearest_m"] < 1.69
    assert 0.0 <= rows[0]["pace_m_s"] < rows[0]["fastest_m_s"] < 0.12, "the speed of a robot"
    reached = rows[0] | {"success": True, "duration_s": 400.0}
    statistics = rival_papers.statistics([rows[0], reached])["gibbs-4"]
    assert statistics["reached"] == 1 and statistics["of"] == 2
    assert statistics["time_mean_s"] == 400.0 and statistics["published_mean_s"] == 446
    options = StudyOptions(("gibbs-4",), 2, 1, tmp_path)
    rival_papers.conclude(options, [task], [rows[0], reached])
    assert "1 of 2" in capsys.readouterr().out


@pytest.mark.long
def test_with_a_drag_the_object_of_the_random_field_creeps_as_recorded(tmp_path):
    """With Coulomb friction it stands, or moves with the robots."""
    recorded, rows = paper_of_gibbs.PUBLISHED["gibbs-4"], {}
    for world in ("planar", "viscous"):
        task = rival_papers.PaperTask("gibbs-4", 1, str(tmp_path), world, "mild", 150.0)
        rows[world] = rival_papers.trial(task)
    assert rows["planar"]["pace_m_s"] < 0.2 * recorded.pace
    assert rows["planar"]["fastest_m_s"] > 5.0 * recorded.fastest
    assert 0.5 * recorded.pace < rows["viscous"]["pace_m_s"] < 2.0 * recorded.pace
    assert rows["viscous"]["fastest_m_s"] < 2.0 * recorded.fastest


def test_rays_of_the_random_field_end_at_the_outline():
    """300 rays about random places: none passes through the outline, and none stops before it."""
    random = np.random.default_rng(4)
    corners = se2.transform(np.array([0.2, -0.1, 0.6]), SQUARE.geometry.outline)
    met = 0
    while met < 300:
        start = random.uniform(-1.0, 1.0, 2)
        if inside(corners, start[None])[0]:
            continue
        way = random.normal(size=2)
        reach = _reach(*start, *way, corners)
        line = start + np.linspace(0.0, min(reach, 1.0), 200, endpoint=False)[:, None] * way
        assert not inside(corners, line).any()
        if math.isfinite(reach):
            met += 1
            beyond = start + (reach + 1e-6) * way
            assert inside(corners, beyond[None])[0] or distance(corners, beyond[None])[0] < 1e-5
        else:
            assert not inside(corners, start + np.linspace(0, 1, 200)[:, None] * way).any()


@pytest.mark.long
@pytest.mark.parametrize("method", list(RIVALS))
def test_equal_seeds_give_equal_runs(tmp_path, method):
    rows = [
        run(RivalTask("transport_square", 3, str(tmp_path), method, 8, "planar", "mild", 20.0))
        for _ in range(2)
    ]
    assert rows[0] == rows[1] and rows[0]["nearest_m"] < 2.0
    ways = np.load(tmp_path / "ways" / f"transport_square-{method}-3.npz")["ways"]
    assert np.hypot(*(ways[-1, 1:, :2] - ways[0, 1:, :2]).T).max() > 0.3  # they move


@pytest.mark.long
def test_a_slice_of_the_experiment_prints_its_table(tmp_path, capsys):
    options = StudyOptions(("transport_triangle",), 1, 1, tmp_path, world="planar")
    tasks = swarm_rivals.tasks(options)
    assert [t.method for t in tasks] == ["crescent", "thesis", "global-input", "occlusion", "gibbs"]
    rows = [swarm_rivals.trial(tasks[0])]
    assert rows[0]["success"] and rows[0]["lambda"] < 4.0
    swarm_rivals.conclude(options, tasks[:1], rows)
    printed = capsys.readouterr().out
    assert "1 of 1" in printed and (tmp_path / "lambda.png").is_file()


def test_the_object_in_the_rivals_frame_is_where_it_is():
    """A robot that touches the turned square pushes square to its side."""
    pose = np.array([-0.7, -0.7, 0.6])
    robot = se2.transform(pose, np.array([[-0.25, 0.05]]))
    moved = Occlusion(ARENA).velocities(0.0, pose, np.column_stack([robot, [0.0]]))
    direction = moved[0] / np.hypot(*moved[0])
    assert direction @ [math.cos(0.6), math.sin(0.6)] > 0.99


def test_the_figures_of_chapter_4_are_drawn(tmp_path):
    draw_figures(tmp_path)
    assert (tmp_path / "field.png").stat().st_size > 10_000
    assert (tmp_path / "coverage.png").stat().st_size > 10_000
