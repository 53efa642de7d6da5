"""Where a body of a running world can be put, and how far it can be shoved."""

import numpy as np
import pytest

from push_model import se2
from push_model.outlines import distance, inside
from push_scenario.footing import TOUCH, Footing
from push_scenario.scenario import scenario_from_mapping

WALLS = {
    "size": [3.0, 2.0],
    "circles": [{"centre": [-0.6, 0.4], "radius": 0.2}],
}
START = {"a": [0.0, 0.0, 0.0], "b": [0.4, 0.0, 0.0]}
BOX = [0.0, 0.5, 0.0]


def crowd():
    values = {
        "environment": WALLS,
        "robots": {n: {"type": "epuck", "start": p} for n, p in START.items()},
        "objects": {"box": {"type": "box9", "start": BOX}},
    }
    scenario = scenario_from_mapping(values, "s", "s.yaml")
    bodies = scenario.robots | scenario.objects
    return scenario, {n: pose for n, (_, pose) in bodies.items()}


@pytest.mark.parametrize(
    ("name", "pose", "words"),
    [
        ("box", [0.02, 0.0, 1.0], "in a"),
        ("a", [0.4, 0.02, 3.0], "in b"),
        ("a", [0.0, 0.5, 0.0], "in box"),
        ("box", [-0.6, 0.4, 0.0], "in circle 0"),
        ("box", [1.48, 0.0, 0.0], "in the arena's wall"),
        ("box", [5.0, 0.0, 0.0], "outside the arena"),
        ("box", [0.9, 0.9, 2.0], None),
        ("a", [0.0, 0.0, 2.0], None),
    ],
)
def test_a_body_stands_where_nothing_else_is(name, pose, words):
    scenario, poses = crowd()
    assert Footing(scenario).trouble(name, np.array(pose), poses) == words


def test_who_is_gone_is_in_nobodys_way():
    scenario, poses = crowd()
    del poses["a"]
    assert Footing(scenario).trouble("box", np.zeros(3), poses) is None


def deepest(outline, other):
    """[m] by which corners of one outline lie in another, and theirs in it."""
    depths = [0.0]
    for points, of in ((outline, other), (other, outline)):
        depths += list(distance(of, points)[inside(of, points)])
    return max(depths)


@pytest.mark.long
def test_shoves_end_before_anything_and_nowhere_short_of_it():
    """200 shoves of a box that a robot may be pressing on: into robots, pillar and walls."""
    random = np.random.default_rng(4)
    scenario, poses = crowd()
    footing = Footing(scenario)
    stopped = 0
    for _ in range(200):
        while True:
            at = random.uniform([-1.2, -0.7, -np.pi], [1.2, 0.7, np.pi])
            place = se2.compose(at, np.array([0.05 + 0.045, random.uniform(-0.02, 0.02), 0.0]))
            other = random.uniform([-1.4, -0.9, -np.pi], [1.4, 0.9, np.pi])
            poses |= {"a": at, "b": other, "box": place}
            if not any(footing.trouble(n, p, poses) for n, p in poses.items()):
                break
        by = random.uniform([-0.12, -0.12, -1.0], [0.12, 0.12, 1.0])
        pose, trouble = footing.along("box", by, poses)
        part = np.hypot(*(pose - place)[:2]) / np.hypot(*by[:2])
        assert se2.wrap(pose[2] - place[2] - part * by[2]) == pytest.approx(0.0, abs=1e-9)
        outline = se2.transform(pose, scenario.objects["box"][0].outline)
        for name in ("a", "b"):
            robot = se2.transform(poses[name], scenario.robots[name][0].outline)
            assert deepest(outline, robot) < 2.0 * TOUCH
        away = np.hypot(*(outline - [-0.6, 0.4]).T).min()
        assert away > 0.2 - 2.0 * TOUCH and np.abs(outline[:, 0]).max() < 1.5 + TOUCH
        if trouble is None:
            assert part == pytest.approx(1.0)
        else:
            stopped += 1
            farther = min(1.0, part + 0.05)
            assert any(
                footing.trouble("box", place + f * by, poses) is not None
                for f in np.linspace(part, farther, 50)
            )
    assert 80 < stopped < 190


def test_a_body_leaves_whom_it_overlaps_and_goes_no_deeper():
    scenario, poses = crowd()
    footing = Footing(scenario)
    poses["box"] = np.array([0.05 + 0.045 - 0.0018, 0.0, 0.0])  # 1.8 mm in the bumper of a
    pose, trouble = footing.along("box", np.array([0.03, 0.0, 0.0]), poses)
    assert trouble is None and pose[0] == pytest.approx(poses["box"][0] + 0.03)
    pose, trouble = footing.along("box", np.array([-0.03, 0.0, 0.0]), poses)
    assert trouble == "in a" and np.array_equal(pose, poses["box"])
