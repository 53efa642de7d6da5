"""Reports from bags: one robot, several teams, a thousand bodies."""

import json
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.patches import Circle
from PIL import Image
from rclpy.serialization import serialize_message

from push_model.specs import EnvironmentSpec
from push_msgs.msg import ControllerStatus, JobState
from push_record.bag import BagWriter
from push_record.collisions import Collisions
from push_record.contents import load
from push_ros.conversions import contacts_to_ros, pose_stamped_to_ros, poses_to_ros, time_to_ros
from push_scenario.scenario import load_scenario
from push_view.bodies import bodies_of
from push_view.drawing import body_vertices, draw_trajectory, moments
from push_view.playback import playback_json
from push_view.report import PRODUCTS, final_error, write_report
from sim_bridge.world import BodyContacts, Contact

TYPES = {
    "group_plan": "push_msgs/msg/GroupPlan",
    "ground_truth/poses": "push_msgs/msg/Poses",
    "poses": "push_msgs/msg/Poses",
    "contacts": "push_msgs/msg/Contacts",
    "job_state": "push_msgs/msg/JobState",
    "/report": "push_msgs/msg/Report",
    "controller/status": "push_msgs/msg/ControllerStatus",
}


def crowd(scenario, robots, items):
    """A scenario with so many robots and objects, side by side in a hall of its own."""
    robot, box = scenario.robot()[1], scenario.object()[1]
    places = [np.array([0.3 * (i % 40) - 6.0, 0.3 * (i // 40) - 5.0, 0.0]) for i in range(1600)]
    return replace(
        scenario,
        environment=EnvironmentSpec((16.0, 16.0), resolution=0.05),
        goals=(),
        robots={f"r{i}": (robot, places[i]) for i in range(robots)},
        objects={f"box{i}": (box, places[robots + i]) for i in range(items)},
    )


class Bag:
    """A bag that is written by a test."""

    def __init__(self, folder, scenario):
        self.folder = folder
        metadata = {"scenario": scenario.text, "scenario_name": "made", "seed": "7"}
        self.writer = BagWriter(folder, metadata)
        self.topics = set()

    def write(self, topic, message, time):
        if topic not in self.topics:
            kind = next(k for suffix, k in TYPES.items() if topic.endswith(suffix))
            self.writer.add_topic(topic, kind, topic.endswith("job_state"))
            self.topics.add(topic)
        self.writer.write(topic, round(1e9 * time), serialize_message(message))

    def poses(self, poses, time, space="/"):
        self.write(f"{space}ground_truth/poses", poses_to_ros(poses, time), time)

    def state(self, space, name, time, robots=(), item="", goal=None, code=0):
        message = JobState(system="single", robots=list(robots), object=item, state_name=name)
        message.header.stamp = time_to_ros(time)
        message.error_code = code
        if goal is not None:
            message.goal = pose_stamped_to_ros(np.array(goal), 0.0)
        self.write(f"{space}job_state", message, time)

    def touch(self, pairs, time, space="/"):
        zero = np.zeros(3)
        contacts = [Contact(a, b, zero, np.array([1.0, 0, 0]), zero, 1.0) for a, b in pairs]
        message = contacts_to_ros(BodyContacts.of(contacts), time)
        self.write(f"{space}contacts", message, time)

    def status(self, robot, time, **values):
        message = ControllerStatus(mode=2, robot=robot, **values)
        message.header.stamp = time_to_ros(time)
        self.write(f"/{robot}/controller/status", message, time)

    def close(self):
        self.writer.close()
        return self.folder


@pytest.fixture
def two_teams(scenario, tmp_path):
    """Robots r0 and r1 with a box each, in a world of its own namespace."""
    bag = Bag(tmp_path / "bag", crowd(scenario, 2, 2))
    for i in range(100):
        t = 0.02 * i
        poses = {
            "r0": [0.01 * i, 0.0, 0.0],
            "r1": [-0.01 * i, 0.5, 3.0],
            "box0": [0.01 * i + 0.1, 0.0, 0.0],
        }
        if i < 90:  # the other is lost at the end
            poses["box1"] = [-0.01 * i - 0.1, 0.5, 3.0]
        bag.poses({n: np.array(p) for n, p in poses.items()}, t, "/w/")
        if i % 10 == 0:
            bag.state("/w/a/", f"STATE{i}", t, ["r0"], "box0", [1.09, 0.003, 0.02])
            bag.state("/w/b/", "PUSHING", t, ["r1"], "box1", [-1.0, 0.5, 3.0])
            bag.status("r0", t, error_x=0.001 * i, curvature_margin=float("inf"))
    return bag.close()


def test_contents_of_several_teams(two_teams):
    contents = load(two_teams)
    assert set(contents.jobs) == {"/w/a/", "/w/b/"}
    assert contents.time == pytest.approx(0.02 * np.arange(100))
    assert contents.poses["r0"][:, 0] == pytest.approx(0.01 * np.arange(100))
    assert np.isnan(contents.poses["box1"][90:]).all()
    assert np.isfinite(contents.poses["box1"][:90]).all()
    assert list(contents.status) == ["r0"]
    assert contents.status["r0"]["error_x"] == pytest.approx(0.01 * np.arange(10))
    a, b = (contents.jobs[space] for space in ("/w/a/", "/w/b/"))
    assert [s.name for s in a.states] == [f"STATE{i}" for i in range(0, 100, 10)]
    error = final_error(contents, a)
    assert (error.position, error.orientation) == pytest.approx((0.003, 0.02))
    assert final_error(contents, b).position == pytest.approx(0.01)  # where it was seen last


def test_a_bag_of_a_lab_shows_the_poses_that_were_measured(scenario, tmp_path):
    """It has no ground truth. Where there is one, measured poses do not count."""
    hall = crowd(scenario, 1, 1)
    for name, truth in (("lab", False), ("sim", True)):
        bag = Bag(tmp_path / name, hall)
        for i in range(50):
            t = 1.7e9 + 0.02 * i
            seen = {"r0": np.array([0.01 * i, 0.2, 0.0]), "box0": np.array([0.1, 0.01 * i, 0.0])}
            bag.write("/poses", poses_to_ros(seen, t), t)
            if truth:
                bag.poses({n: p + [0.0, 0.0, 0.5] for n, p in seen.items()}, t)
        bag.state("/", "PUSHING", 1.7e9 + 0.2, ["r0"], "box0", [0.1, 0.5, 0.0])
        bag.state("/", "IDLE", 1.7e9 + 0.98, ["r0"], "box0", [0.1, 0.5, 0.0])
        found = load(bag.close())
        assert found.measured is not truth and len(found.time) == 50
        assert found.poses["box0"][:, 1] == pytest.approx(0.01 * np.arange(50))
        assert found.poses["box0"][-1, 2] == (0.5 if truth else 0.0)
    errors = write_report(tmp_path / "lab", tmp_path / "out", animate=False)
    assert errors["position_error_m"] == pytest.approx(0.01)
    text = (tmp_path / "out" / "report.html").read_text()
    assert "poses as measured" in text and "of simulation" not in text
    data = json.loads(json.dumps(playback_json(tmp_path / "lab"), allow_nan=False))
    x, y, _ = data["poses"][data["bodies"]["names"].index("box0")]
    assert len(y) == 50 and (x[0], y[-1]) == (1000, 4900)


def test_report_of_several_teams_has_a_page_each(two_teams, tmp_path):
    errors = write_report(two_teams, tmp_path / "out", animate=False)
    assert errors["position_error_m"] == pytest.approx(0.01)
    assert errors["orientation_error_rad"] == pytest.approx(0.02)
    assert (tmp_path / "out" / "trajectory.png").stat().st_size > 1000
    text = (tmp_path / "out" / "report.pdf").read_bytes()
    assert text.count(b"/Type /Page\n") + text.count(b"/Type /Page ") == 3


def test_the_picture_of_a_run_shows_obstacles_as_they_are_and_its_legend_hides_nothing(tmp_path):
    scenario = load_scenario("group-ellipse")
    bag = Bag(tmp_path / "bag", scenario)
    names = (*scenario.robots, *scenario.objects)
    for i in range(5):
        bag.poses({n: np.array([0.1 * i, 0.3 * k, 0.0]) for k, n in enumerate(names)}, 0.1 * i)
    figure, axes = plt.subplots(figsize=(9, 6))
    draw_trajectory(axes, load(bag.close()))
    figure.canvas.draw()
    shown = axes.get_legend().get_window_extent()
    assert shown.y1 < axes.get_window_extent().y0
    (first, second) = [p for p in axes.patches if isinstance(p, Circle)]
    assert [*first.center, first.radius, *second.center] == [0.1, 0.55, 0.15, 0.3, -0.75]
    assert not axes.images
    plt.close(figure)


def test_report_of_a_thousand_bodies(scenario, tmp_path):
    random = np.random.default_rng(2)
    many = crowd(scenario, 1000, 1)
    bag = Bag(tmp_path / "bag", many)
    start = random.uniform((-7.8, -7.8, -3), (7.7, 7.7, 3), (1001, 3))
    names = bodies_of(many).names
    for i in range(20):
        poses = start + 0.005 * i
        bag.poses(dict(zip(names, poses, strict=True)), 0.1 * i)
    bag.state("/", "MOVING", 0.0, names[:1000], "box0", [0.5, 0.5, 0.0])
    out = tmp_path / "out"
    errors = write_report(bag.close(), out, animate=False)
    assert errors["position_error_m"] == pytest.approx(np.hypot(*(poses[1000, :2] - 0.5)))
    pixels = np.asarray(Image.open(out / "trajectory.png").convert("RGB")).astype(int)
    blue = pixels[..., 2] - pixels[..., 0] > 40
    # robots all over the map: some in each of a hundred parts of the picture's middle
    rows, columns = (np.linspace(0.2 * n, 0.8 * n, 11).astype(int) for n in blue.shape)
    parts = [
        blue[a:b, c:d].any()
        for a, b in zip(rows[:-1], rows[1:], strict=True)
        for c, d in zip(columns[:-1], columns[1:], strict=True)
    ]
    assert np.mean(parts) > 0.95


def test_report_without_an_object_or_a_job(scenario, tmp_path):
    bag = Bag(tmp_path / "bag", crowd(scenario, 3, 0))
    for i in range(10):
        bag.poses({f"r{k}": np.array([0.1 * i, 0.2 * k, 0.0]) for k in range(3)}, 0.1 * i)
    errors = write_report(bag.close(), tmp_path / "out")
    assert np.isnan(errors["position_error_m"])
    assert all((tmp_path / "out" / name).is_file() for name in PRODUCTS)


def test_report_of_a_bag_without_poses_and_of_no_bag(scenario, tmp_path):
    bag = Bag(tmp_path / "bag", scenario)
    bag.state("/", "IDLE", 0.0, ["epuck1"], "box")
    assert np.isnan(write_report(bag.close(), tmp_path / "out")["position_error_m"])
    with pytest.raises(FileNotFoundError):
        write_report(tmp_path / "nothing", tmp_path / "out")


def test_collisions_are_counted_apart(scenario, tmp_path):
    """Touches of a robot and its object are none; a touch counts once however long it lasts."""
    bag = Bag(tmp_path / "bag", crowd(scenario, 2, 2))
    for i in range(100):
        pairs = [("r0", "box0")]
        if 10 <= i < 40 and i != 20:  # one tick apart is the same touch
            pairs.append(("r1", "r0"))
        if i in (5, 6, 60, 61):
            pairs.append(("wall3", "r1"))
        if i == 70:
            pairs += [("box1", "circle0"), ("box0", "box1")]
        bag.touch(pairs, 0.01 * i)
    hits = load(bag.close()).collisions
    assert hits.between_robots == 1
    assert (hits.robots_with_walls, hits.objects_with_walls, hits.with_walls) == (2, 1, 3)
    assert hits.between_objects == 1


def test_collisions_of_random_touches():
    """Against the number of intervals, taken pair by pair."""
    random = np.random.default_rng(11)
    robots, objects = {"r0", "r1", "r2"}, {"o0", "o1"}
    names = [*robots, *objects, "wall0", "polygon1"]
    for _ in range(200):
        hits = Collisions(robots, objects)
        expected = dict.fromkeys(("rr", "oo", "rw", "ow"), 0)
        touches = {}
        for a, b in (random.permutation(names)[:2] for _ in range(4)):
            times = np.cumsum(random.choice([0.01, 0.05, 0.3, 2.0], 12))
            if tuple(sorted((a, b))) in touches:
                continue
            touches[tuple(sorted((a, b)))] = [(t, a, b) for t in times]
            kind = "".join(sorted(n[0] if n[0] in "ro" else "w" for n in (a, b)))
            kind = {"or": "", "ww": ""}.get(kind, kind)
            if kind:
                expected[kind] += 1 + int((np.diff(times) > 0.1 + 1e-9).sum())
        for t, a, b in sorted(touch for pair in touches.values() for touch in pair):
            hits.take(float(t), [a], [b])
        found = (hits.between_robots, hits.between_objects)
        assert found == (expected["rr"], expected["oo"])
        found = (hits.robots_with_walls, hits.objects_with_walls)
        assert found == (expected["rw"], expected["ow"])


def test_bodies_share_types_and_are_drawn_where_they_are(scenario):
    many = crowd(scenario, 30, 3)
    bodies = bodies_of(many)
    assert len(bodies) == 33 and len(bodies.types) == 2
    assert [t.robot for t in bodies.types] == [True, False]
    poses = {"r3": np.array([[0.0, 0.0, 0.0], [1.0, 2.0, np.pi / 2]])}
    poses["box1"] = np.full((2, 3), np.nan)
    vertices = body_vertices(bodies, poses, 1)
    assert vertices[bodies.colour("box1")] == []
    x, y = many.robot()[1].outline.T
    assert vertices[bodies.colour("r3")][0] == pytest.approx(np.column_stack([1.0 - y, 2.0 + x]))


def test_an_object_is_drawn_about_the_middle_of_its_outline(scenario):
    """Poses are of the geometric frame, wherever the centre of mass is."""
    box = replace(scenario.object()[1], com=(0.02, 0.01))
    heavy = replace(scenario, objects={"box": (box, np.zeros(3))})
    assert bodies_of(heavy).type("box").outline.mean(axis=0) == pytest.approx([0.0, 0.0])


@pytest.mark.parametrize(
    ("count", "bodies"), [(0, 2), (1, 2), (5, 2), (500, 2), (500, 20), (9, 999)]
)
def test_bodies_are_drawn_at_fewer_moments_the_more_they_are(count, bodies):
    found = moments(count, bodies)
    assert len(found) == len(set(found)) <= (7 if bodies == 2 else 2)
    assert count == 0 or found[-1] == count - 1
