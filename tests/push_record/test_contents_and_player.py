"""What a bag of two teams in a namespace holds, and what a playback of it publishes."""

import numpy as np
import pytest
import rclpy
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from push_model.settings import SettingsError
from push_msgs.msg import ControllerStatus, JobState, Poses
from push_record.bag import BagWriter, ending, read_bag
from push_record.contents import load, until
from push_record.player import PlayerNode
from push_record.recorder import RecorderNode, heard_scenario
from push_record.topics import MANY, recorded_topics, shown_topics
from push_ros.conversions import pose_stamped_to_ros, poses_to_ros, time_to_ros
from push_ros.process import Spinner
from push_ros.qos import CLOCK, LATCHED, STREAM
from push_scenario.scenario import load_scenario, scenario_from_text


@pytest.fixture
def teams():
    return load_scenario("two-singles")


def write_bag(folder, scenario, namespace="/a/", count=50, later=None):
    """Robots that go right, boxes ahead of them; south is told a goal, north is not. later: what
    south says at the end."""
    from rclpy.serialization import serialize_message

    meta = {
        "scenario": scenario.text,
        "scenario_name": scenario.name,
        "seed": "3",
        "namespace": namespace,
    }
    writer = BagWriter(folder, meta)
    for topic, kind in recorded_topics(scenario, namespace).items():
        writer.add_topic(topic, kind.type_name, kind.latched)

    def put(topic, moment, message):
        writer.write(namespace + topic, round(1e9 * moment), bytes(serialize_message(message)))

    state = JobState(state_name="PUSHING", reason="as told", object="box1")
    state.goal = pose_stamped_to_ros(np.array([0.5, -0.4, 0.0]), 1.0)
    for k in range(count):
        moment = 1.0 + 0.02 * k
        bodies = {n: s + [0.01 * k, 0.0, 0.0] for n, (_, s) in scenario.robots.items()}
        bodies |= {n: s + [0.01 * k, 0.0, 0.0] for n, (_, s) in scenario.objects.items()}
        for topic in ("poses", "ground_truth/poses"):
            put(topic, moment, poses_to_ros(bodies, moment))
        status = ControllerStatus(mode=ControllerStatus.PUSH, robot="epuck2", error_y=0.001 * k)
        status.header.stamp = time_to_ros(moment)
        put("epuck2/controller/status", moment, status)
    state.header.stamp = time_to_ros(1.5)
    put("south/job_state", 1.5, state)
    if later is not None:
        put("south/job_state", 1.55, later)
    put("north/job_state", 1.6, JobState(state_name="IDLE", reason="no goal", object="box2"))
    writer.close()


def test_a_world_that_was_reset_goes_on_in_time(tmp_path, teams):
    """Two runs of one second in one bag: nothing is drawn at two places at one time."""
    from rclpy.serialization import serialize_message

    writer = BagWriter(tmp_path / "bag", {"scenario": teams.text, "scenario_name": teams.name})
    for topic, kind in recorded_topics(teams, "").items():
        writer.add_topic(topic, kind.type_name, kind.latched)
    name, stamp = next(iter(teams.robots)), 0
    for run in range(2):
        for k in range(51):
            moment, stamp = 0.02 * k, stamp + 20_000_000
            frame = poses_to_ros({name: np.array([run + 0.01 * k, 0.0, 0.0])}, moment)
            writer.write("/ground_truth/poses", stamp, bytes(serialize_message(frame)))
            if k == 25:
                state = JobState(state_name="PUSHING", reason=f"run {run}", object="box1")
                state.header.stamp = time_to_ros(moment)
                writer.write("/south/job_state", stamp, bytes(serialize_message(state)))
    writer.close()
    contents = load(tmp_path / "bag")
    assert (np.diff(contents.time) >= 0.0).all()
    assert contents.time[-1] == pytest.approx(2.0)
    (job,) = [job for job in contents.jobs.values() if job.states]
    assert [s.time for s in job.states] == pytest.approx([0.5, 1.5])
    first = until(contents, 1.0)
    assert first.time[-1] < 1.0 and first.poses[name][:, 0].max() < 0.6
    assert [[s.reason for s in job.states] for job in first.jobs.values() if job.states] == [
        ["run 0"]
    ]


def test_contents_by_team(tmp_path, teams):
    write_bag(tmp_path / "bag", teams)
    contents = load(tmp_path / "bag")
    assert contents.metadata["seed"] == "3"
    assert len(contents.time) == 50 and set(contents.poses) == {*teams.robots, *teams.objects}
    assert set(contents.jobs) == {"/a/south/", "/a/north/"}
    south, north = contents.jobs["/a/south/"], contents.jobs["/a/north/"]
    assert [(s.time, s.name, s.reason) for s in south.states] == [(1.5, "PUSHING", "as told")]
    assert np.allclose(south.goal, [0.5, -0.4, 0.0]) and south.object == "box1"
    assert north.goal is None and north.object == "box2"
    assert set(contents.status) == {"epuck2"}
    assert np.allclose(contents.status["epuck2"]["error_y"], 0.001 * np.arange(50))
    end = teams.objects["box1"][1] + [0.49, 0.0, 0.0]
    assert np.allclose(contents.poses["box1"][-1], end)


def test_a_task_without_a_goal_does_not_have_that_of_the_job_before(tmp_path, teams):
    """The report would otherwise tell how far from it the object is."""
    write_bag(tmp_path / "bag", teams, later=JobState(state_name="PUSHING", object="box1", job=2))
    job = load(tmp_path / "bag").jobs["/a/south/"]
    assert job.goal is None and [s.goal is None for s in job.states] == [False, True]


def test_a_clock_before_zero_does_not_end_the_recording(tmp_path, teams, ros):
    recorder = RecorderNode(tmp_path / "bag", teams)
    world = rclpy.create_node("world")
    clock = world.create_publisher(Clock, "/clock", CLOCK)
    poses = world.create_publisher(Poses, "/poses", STREAM)
    spinner = Spinner([recorder, world])
    try:
        assert spinner.until(lambda: clock.get_subscription_count() > 0, 5.0)
        for k, second in enumerate((3, -5)):
            message = Clock()
            message.clock.sec = second
            clock.publish(message)
            spinner.until(lambda: False, 0.3)
            poses.publish(poses_to_ros({}, float(second)))
            assert spinner.until(lambda k=k: recorder.writer.count("/poses") > k, 5.0)
    finally:
        spinner.close()
    stamps = [r.stamp for r in read_bag(tmp_path / "bag", {"/poses"})]
    assert stamps == [3 * 10**9] * 2 and ending(tmp_path / "bag").trouble == ""


def test_a_bag_without_scenario_is_refused(tmp_path):
    writer = BagWriter(tmp_path / "bag", {"seed": "1"})
    writer.close()
    with pytest.raises(ValueError, match="no scenario"):
        load(tmp_path / "bag")


@pytest.mark.parametrize("namespace", ["", "b"])
def test_playback_publishes_what_was_seen_in_any_namespace(tmp_path, teams, ros, namespace):
    write_bag(tmp_path / "bag", teams)
    player = PlayerNode(tmp_path / "bag", factor=5.0, namespace=namespace)
    listener = rclpy.create_node("listener", namespace=namespace)
    poses, states, texts = [], [], []
    listener.create_subscription(Poses, "poses", poses.append, STREAM)
    listener.create_subscription(JobState, "south/job_state", states.append, LATCHED)
    listener.create_subscription(String, "scenario", texts.append, LATCHED)
    spinner = Spinner([player, listener])
    try:
        assert spinner.until(lambda: player.finished and states and texts, 20.0)
        spinner.until(lambda: len(poses) == 50, 1.0)  # best effort: a busy machine loses some
        assert len(poses) > 10
        text = scenario_from_text(texts[-1].data, "two-singles", "the topic")
        assert text.text == teams.text
        assert [s.reason for s in states] == ["as told"]
        assert not listener.count_publishers("ground_truth/poses")
        assert not listener.count_publishers("south/goal_pose")
        assert not listener.count_publishers("epuck1/cmd_vel")
    finally:
        spinner.close()


def test_playback_keeps_the_pace_by_its_clock(tmp_path, teams, ros):
    write_bag(tmp_path / "bag", teams, count=11)  # 0.2 s of poses
    now = [0.0]
    player = PlayerNode(tmp_path / "bag", 2.0, "", lambda: now[0])
    spinner = Spinner([player])
    try:
        player._on_timer()
        assert player.played == 0
        now[0] += 0.7 + 0.05 + 1e-6  # it begins, and half of the poses are due
        player._on_timer()
        per_moment = 3  # poses, a status; the ground truth is not played
        assert player.played == 6 * (per_moment - 1)
        now[0] += 10.0
        player._on_timer()
        assert player.finished and player.played == 11 * (per_moment - 1) + 2
    finally:
        spinner.close()


@pytest.mark.parametrize("factor", [0.0, -1.0, float("nan"), float("inf")])
def test_a_factor_that_is_none(tmp_path, teams, ros, factor):
    write_bag(tmp_path / "bag", teams)
    with pytest.raises(SettingsError, match="factor"):
        PlayerNode(tmp_path / "bag", factor)


def test_the_recorder_hears_scenario_and_all_teams_of_its_namespace(tmp_path, teams, ros):
    bridge = rclpy.create_node("bridge", namespace="a")
    publisher = bridge.create_publisher(String, "scenario", LATCHED)
    publisher.publish(String(data=teams.text))
    assert heard_scenario("a", 10.0).text == teams.text
    with pytest.raises(SettingsError, match="/scenario"):
        heard_scenario("", 0.3)
    recorder = RecorderNode(tmp_path / "bag", namespace="a")
    state = bridge.create_publisher(JobState, "north/job_state", LATCHED)
    state.publish(JobState(reason="of the north"))
    spinner = Spinner([bridge, recorder])
    topic = "/a/north/job_state"
    assert spinner.until(lambda: recorder.writer._topics[topic].count > 0, 10.0)
    spinner.close()
    reasons = [r.message.reason for r in read_bag(tmp_path / "bag", {topic})]
    assert reasons == ["of the north"]
    assert load(tmp_path / "bag").metadata["namespace"] == "/a/"


def test_states_that_come_at_once_and_at_the_end_are_all_recorded(tmp_path, teams, ros):
    """A job's last state is published just before the suite is stopped."""
    bridge = rclpy.create_node("bridge")
    state = bridge.create_publisher(JobState, "north/job_state", LATCHED)
    recorder = RecorderNode(tmp_path / "bag", teams)
    there = Spinner([bridge])
    assert there.until(lambda: state.get_subscription_count() > 0, 10.0)
    for k in range(20):
        state.publish(JobState(reason=str(k)))
    here = Spinner([recorder])
    recorder.finish(here)
    here.close()
    there.close()
    reasons = [r.message.reason for r in read_bag(tmp_path / "bag", {"/north/job_state"})]
    assert reasons == [str(k) for k in range(20)]
    assert load(str(tmp_path / "bag")).metadata["namespace"] == "/"


def test_topics_of_one_of_teams_and_of_very_many(teams):
    short = load_scenario("short")
    assert {"/poses", "/goal_pose", "/epuck1/cmd_vel", "/scenario"} <= set(recorded_topics(short))
    names = set(recorded_topics(teams, "a"))
    assert {"/a/poses", "/a/south/goal_pose", "/a/north/push_plan", "/a/epuck2/cmd_vel"} <= names
    assert all(n.startswith("/a/") for n in names)
    assert set(shown_topics(teams, "a")) < names
    many = load_scenario("discs1000")
    assert len(many.robots) >= MANY and len(recorded_topics(many)) < 30
    torque = set(recorded_topics(load_scenario("pioneer")))
    assert any(n.endswith("/wheel_torques") for n in torque)
