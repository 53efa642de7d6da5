"""Area clearing in the rooms of benchnpin, where its environment is installed (make benchpush)."""

import itertools
import math
import sys

import numpy as np
import pytest

from planar_push.main import main
from push_model.outlines import overlap
from push_model.settings import SettingsError
from push_study.bench_push import policies, room
from push_study.by_scenario import Episode
from push_study.experiments import bench_push, box_delivery
from push_study.study import StudyOptions


def installed(found=room.python):
    """Whether what a study needs is there: ``found`` is its function that returns the path."""
    try:
        found()
    except SettingsError:
        return False
    return True


@pytest.mark.parametrize("study", ["bench-push", "box-delivery"])
def test_without_its_environment_the_study_says_what_to_do(tmp_path, monkeypatch, capsys, study):
    monkeypatch.setenv(room.PYTHON, str(tmp_path / "nowhere"))
    out = tmp_path / "out"
    assert main(["experiment", study, "--trials", "1", "--out", str(out)]) == 2
    assert "make benchpush" in " ".join(capsys.readouterr().err.split()) and not out.exists()


@pytest.mark.parametrize("study", [bench_push, box_delivery])
def test_an_unknown_scenario_is_refused(tmp_path, study):
    with pytest.raises(SettingsError, match="no scenario called 'clear'"):
        study.tasks(StudyOptions(("clear",), 1, 1, tmp_path))


def test_a_room_that_does_not_start_says_why(tmp_path, monkeypatch):
    """A Python without benchnpin."""
    monkeypatch.setenv(room.PYTHON, sys.executable)
    with room.Room("clearing", "clear_env") as made, pytest.raises(RuntimeError, match="benchnpin"):
        made.reset(1)


SQUARE = np.array([[0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]])
SPEED, TURN, ACTION = 0.2, math.pi / 30, 0.2


def told(pose, boxes, pushes=()):
    area = [[-5.0, -5.0], [-5.0, 5.0], [5.0, 5.0], [5.0, -5.0]]
    edges = [[area[k], area[(k + 1) % 4]] for k in range(4)]
    return {
        "area": area, "limits": [7.9, 7.9], "edges": edges, "fixed": [], "speed": SPEED,
        "turn": TURN, "pose": np.round(pose, 2).tolist(), "boxes": [b.tolist() for b in boxes],
        "pushes": pushes,
    }  # fmt: skip


def moved(pose, action):
    """By one action, exactly; turn rates are halved, as benchnpin halves them."""
    theta = pose[2] + ACTION * action[1] * TURN / 2.0
    step = ACTION * action[0] * SPEED
    return np.array([pose[0] + step * math.cos(theta), pose[1] + step * math.sin(theta), theta])


def test_the_sweeping_robot_keeps_to_the_action_space_and_ends():
    """A robot that moves exactly; boxes that the front takes along move with it."""
    boxes = [SQUARE + [2.0, 1.0], SQUARE + [-2.0, 2.0]]
    pose = np.array([0.0, -4.0, 0.5 * math.pi])
    policy = policies.sweeping(told(pose, boxes))
    actions, action = [], next(policy)
    for _ in range(6000):
        actions.append(action)
        pose = moved(pose, action)
        ahead = np.array([math.cos(pose[2]), math.sin(pose[2])])
        for k, box in enumerate(boxes):
            front = float(((box - pose[:2]) @ ahead).min())
            beside = float((box.mean(axis=0) - pose[:2]) @ [-ahead[1], ahead[0]])
            if action[0] > 0.0 and abs(beside) < 1.2 and 0.0 < front < policies.FRONT.ahead:
                boxes[k] = box + (policies.FRONT.ahead - front) * ahead
        try:
            action = policy.send(told(pose, boxes))
        except StopIteration:
            break
    assert len(actions) < 6000 and np.abs(actions).max() <= 1.0
    assert not any(overlap(np.array(told(pose, boxes)["area"]), box) for box in boxes)


@pytest.mark.parametrize(("by", "plans"), [(0.1, 1), (0.6, 2)])
def test_a_box_that_is_pushed_on_the_way_is_planned_for_anew(by, plans, monkeypatch):
    """Before the sweep begins; the other box is not part of it."""
    made, planned = [], policies.AreaClearing.next_sweep

    def next_sweep(planner, pose, boxes):
        made.append(planned(planner, pose, boxes))
        return made[-1]

    monkeypatch.setattr(policies.AreaClearing, "next_sweep", next_sweep)
    boxes = [SQUARE + [0.0, 1.0], SQUARE + [-4.4, 4.4]]
    pose = np.array([4.0, -4.0, 0.5 * math.pi])
    policy = policies.sweeping(told(pose, boxes))
    action = next(policy)
    (first,) = made
    (taken,) = (k for k in range(2) if first[1].takes >> k & 1)
    for k in range(4000):
        pose = moved(pose, action)
        if k == 5:
            boxes[taken] = boxes[taken] + [by, 0.0]
            boxes[1 - taken] = boxes[1 - taken] + [0.9, 0.0]
        action = policy.send(told(pose, boxes))
        heading = made[-1][1].heading
        out = np.array([math.cos(heading), math.sin(heading)])
        sweeps = np.hypot(*(pose[:2] - made[-1][1].start)) < 0.5 and action[0] == 1.0
        if sweeps and (pose[:2] - made[-1][1].start) @ out > 0.2:
            break
    assert k < 3999 and len(made) == plans


def test_a_robot_that_does_not_move_backs_off_and_tries_again():
    """Whatever it is told to do, it stands: no command is repeated for long."""
    pose, boxes = np.array([0.0, -4.0, 0.5 * math.pi]), [SQUARE + [2.0, 1.0]]
    policy = policies.sweeping(told(pose, boxes))
    actions = [next(policy)]
    actions += [policy.send(told(pose, boxes)) for _ in range(200)]
    changes = np.flatnonzero(np.any(np.diff(actions, axis=0) != 0.0, axis=1)) + 1
    assert np.diff([0, *changes, 201]).max() <= 15
    first, back = actions[0], actions[changes[0]]
    assert back == (-first[0], -first[1])


def test_a_pose_that_flickers_by_its_rounding_is_no_motion():
    """The robot turns as it is told, and stands; its place is told to a centimetre."""
    pose, boxes = np.array([0.0, -4.0, 0.5 * math.pi]), [SQUARE + [0.0, 1.0]]
    policy = policies.sweeping(told(pose, boxes))
    actions = [next(policy)]
    for k in range(400):
        pose[2] = moved(pose, actions[-1])[2]
        actions.append(policy.send(told(pose + [0.0, 0.01 * (k % 2), 0.0], boxes)))
    ahead = np.array([a for a, _ in actions])
    longest = max(len(list(same)) for sign, same in itertools.groupby(np.sign(ahead)) if sign)
    assert (ahead > 0.0).any() and (ahead < 0.0).any() and longest <= 16


def pushed(box):
    """The pushes of GTSP for a box with sides along the axes, as ``worker.py`` tells them."""
    found, (x, y) = [], box.mean(axis=0)
    for side in (0.1, 0.0), (-0.1, 0.0), (0.0, 0.1), (0.0, -0.1):
        at, out = np.array([x, y]) + side, np.sign(side)
        end = np.where(out != 0.0, 5.0 * out, at)
        found.append([(at - 2.0 * out).tolist(), at.tolist(), end.tolist()])
    return found


def cost(here, heading, there, then):
    way = there - here
    units = [v / np.hypot(*v) for v in (heading, way, then)]
    turns = sum(math.acos(np.clip(a @ b, -1.0, 1.0)) for a, b in itertools.pairwise(units))
    return 0.5 * np.hypot(*way) + 0.25 * math.pi * turns


def laid_out(seed):
    """Three boxes, and the pose of the robot."""
    random = np.random.default_rng(seed)
    places = ([-3.0, 2.5], [0.5, -0.5], [3.0, 3.0]) + random.uniform(-1.0, 1.0, 2)
    pose = np.array([*random.uniform(-1.0, 1.0, 2), random.uniform(-3.0, 3.0)])
    return [SQUARE + at for at in places], pose


def best_tour(pose, boxes, closed=True):
    """Where the pushes of the cheapest tour begin; by trying all."""
    pose = np.array(pose)
    here, ahead = pose[:2], np.array([math.cos(pose[2]), math.sin(pose[2])])
    best, found = math.inf, None
    for order in itertools.permutations(range(len(boxes))):
        for choice in itertools.product(range(4), repeat=len(boxes)):
            tour = [np.array(pushed(boxes[k])[c]) for k, c in zip(order, choice, strict=True)]
            stops = [(here, ahead, here, ahead)]
            stops += [(p[0], p[-1] - p[-2], p[-1], p[-1] - p[-2]) for p in tour]
            stops += stops[:1] if closed else []
            spent = sum(cost(a[2], a[3], b[0], b[1]) for a, b in itertools.pairwise(stops))
            if spent < best:
                best, found = spent, [p[0] for p in tour]
    return found


def places_of(policy, pose, boxes, limit):
    """Where a robot is after each action; it takes no box along."""
    pushes, places, action = [pushed(b) for b in boxes], [pose], next(policy)
    while len(places) < limit:
        places.append(moved(places[-1], action))
        try:
            action = policy.send(told(places[-1], boxes, pushes))
        except StopIteration:
            break
    return np.array(places)


@pytest.mark.parametrize("seed", range(5))
def test_gtsp_drives_the_cheapest_closed_tour_and_ends(seed):
    random = np.random.default_rng(seed)
    boxes = [
        SQUARE + at for at in ([-3.0, 2.5], [0.5, -0.5], [3.0, 3.0]) + random.uniform(-1, 1, 2)
    ]
    pose = np.array([*random.uniform(-1.0, 1.0, 2), random.uniform(-3.0, 3.0)])
    room = told(pose, boxes, [pushed(b) for b in boxes])
    places = places_of(policies.gtsp(room), np.array(room["pose"]), boxes, 6000)
    assert len(places) < 6000
    reached = [
        int((np.hypot(*(places[:, :2] - start).T) < 0.4).argmax())
        for start in best_tour(np.array(room["pose"]), boxes)
    ]
    assert 0 < reached[0] < reached[1] < reached[2]


def test_the_cheapest_closed_tour_is_often_not_the_cheapest_open_one():
    """Else the test above would hold without the way back."""
    differ = 0
    for seed in range(5):
        boxes, pose = laid_out(seed)
        room = told(pose, boxes)["pose"]
        differ += not np.allclose(best_tour(room, boxes), best_tour(room, boxes, closed=False))
    assert differ


def test_gtsp_again_plans_further_tours_while_boxes_are_in_the_area():
    boxes, pose = [SQUARE + [1.0, 0.0]], np.array([0.0, -4.0, 0.5 * math.pi])
    room = told(pose, boxes, [pushed(b) for b in boxes])
    once = len(places_of(policies.gtsp(room), pose, boxes, 3000))
    assert once < 1500
    assert len(places_of(policies.gtsp_again(room), pose, boxes, 3 * once)) == 3 * once
    out = [SQUARE + [7.0, 0.0]]
    with pytest.raises(StopIteration):
        next(policies.gtsp_again(told(pose, out, [pushed(b) for b in out])))


class MadeUp:
    """In the place of a room of benchnpin: two boxes, of which one leaves at once."""

    def __init__(self, task, name):
        assert task == "clearing" and name in bench_push.ROOMS.values()
        self.step_of_boxes, self.steps = 0.3, 0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def seen(self):
        boxes = [SQUARE + [5.0 + self.step_of_boxes * self.steps, 0.0], SQUARE]
        more = {"done": 1, "over": self.steps == 4, "share": 0.5, "efficiency": 0.4}
        room = told(np.zeros(3), boxes, [pushed(b) for b in boxes])
        return room | more | {"effort": 0.3, "path_m": 2.0, "time_s": 0.8}

    def reset(self, seed):
        return self.seen()

    def step(self, speed, turn):
        self.steps += 1
        return self.seen()


class Throwing(MadeUp):
    def __init__(self, task, name):
        super().__init__(task, name)
        self.step_of_boxes = 1.5


@pytest.mark.parametrize("scenario", bench_push.SCENARIOS)
def test_an_episode_in_which_a_box_is_thrown_does_not_count(monkeypatch, scenario):
    monkeypatch.setattr(bench_push, "Room", MadeUp)
    row = bench_push.trial(Episode(scenario, 1))
    assert not row["success"] and row["reason"] == "1 of 2 boxes are left"
    assert row["time_s"] == pytest.approx(0.8) and row["share"] == 0.5
    monkeypatch.setattr(bench_push, "Room", Throwing)
    row = bench_push.trial(Episode(scenario, 1))
    assert not row["success"] and "threw a box by 1.5 m" in row["reason"]


def test_a_crashed_episode_counts_as_one_that_is_not_cleared(tmp_path, capsys):
    good = {"scenario": "clear-sweeps", "seed": 1, "success": True}
    good |= dict.fromkeys(bench_push.MEASURES, 1.0)
    crashed = {"scenario": "clear-sweeps", "seed": 2, "success": False, "crashed": True}
    found = bench_push.statistics([good, crashed])
    low, high = found["wilson_clear-sweeps"]
    assert low < 0.5 < high < 1.0
    bench_push.conclude(StudyOptions(("clear-sweeps",), 2, 1, tmp_path), [], [good, crashed])
    assert "cleared 1 of 2" in capsys.readouterr().out


@pytest.mark.long
@pytest.mark.skipif(not installed(), reason="the environment of benchnpin is not installed")
def test_the_open_room_is_cleared_and_equal_seeds_give_equal_rows():
    tasks = [Episode("clear-sweeps", seed) for seed in (1, 2, 3)]
    rows = [bench_push.trial(task) for task in tasks]
    assert all(row["success"] and row["efficiency"] > 0.6 for row in rows)
    again = bench_push.trial(tasks[1])
    assert {k: v for k, v in again.items() if k != "cpu_s"} == {
        k: v for k, v in rows[1].items() if k != "cpu_s"
    }
