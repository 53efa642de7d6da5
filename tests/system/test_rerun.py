"""Runs in lockstep are repeated to the bit from their bags, and what differs is found."""

import json
import shutil

import numpy as np
import pytest
import rclpy
from rclpy.action import ActionClient
from rclpy.serialization import deserialize_message, serialize_message
from std_srvs.srv import SetBool, Trigger

from planar_push.main import main
from push_model.belief import Interval
from push_msgs.action import SwarmMove
from push_msgs.msg import Belief, ControllerStatus
from push_msgs.srv import Displace, Kill, Reset
from push_record.bag import BagWriter, bag_file, read_bag, read_metadata, read_raw
from push_record.contents import bag_scenario
from push_record.topics import recorded_topics
from push_ros.claims import own_domain
from push_ros.qos import BELIEF
from push_ros.report_conversions import belief_to_ros
from push_scenario.scenario import load_scenario, scenario_from_mapping
from push_study.graph_run import LockstepRun
from push_study.recorded_run import recorded_run
from push_study.rerun import rerun
from push_study.uncertainty import uncertainty

ROOM = {"size": [3.6, 2.6]}
PLANAR = {"bridge": {"world": "planar"}}
GROUP = {
    "environment": ROOM,
    "robots": {
        f"e{i}": {"type": "epuck_ring", "start": [-0.9, y, 0.0]}
        for i, y in enumerate((-0.4, 0.0, 0.4))
    },
    "objects": {"plate": {"type": "plate_ellipse", "start": [0.0, 0.0, -1.5708]}},
    "goal": [0.5, 0.3, -1.0],
    "parameters": PLANAR,
}
RING = {"kind": "ring", "centre": [0.0, 0.0], "radius": 0.5}
SWARM = {
    "environment": ROOM,
    "robots": {"e": {"type": "epuck_ring", "count": 8, "placement": RING}},
    "objects": {"square": {"type": "swarm_square", "start": [0.0, 0.0, 0.0]}},
    "goal": [0.3, 0.0, 0.0],
    "parameters": PLANAR,
}


def scenario_of(system):
    if system in ("single", "stable-nmpc"):
        return load_scenario("short")
    return scenario_from_mapping(GROUP if system == "group" else SWARM, system, "test")


@pytest.fixture(autouse=True)
def no_context_is_left():
    yield
    assert not rclpy.ok()


@pytest.mark.parametrize(
    "system",
    [
        *(pytest.param(s, marks=pytest.mark.long) for s in ("single", "group", "stable-nmpc")),
        "swarm",
    ],
)
def test_a_run_of_each_system_is_repeated_to_the_bit(system, tmp_path):
    """With the noise, the latency and the other frictions of a trial, which are in the bag."""
    believed, world, drawn = uncertainty("mild").draw(scenario_of(system), 5)
    with (
        own_domain(),
        LockstepRun(
            believed, world=world, quiet=True, system=system, record=tmp_path / "bag"
        ) as run,
    ):
        run.start()
        (result,) = run.reach_all(sim_limit=60.0).values()
    assert drawn and result.success
    again = rerun(tmp_path / "bag", tmp_path / "again")
    found = again.comparison
    assert found.equal, (found.first, found.settings)
    assert found.messages > 1000 and again.code == 0
    assert set(found.topics) <= set(recorded_topics(believed))


def copied(bag, folder, change):
    """A bag in which ``change(topic, k, data)`` may alter the message k of a topic."""
    scenario, metadata = bag_scenario(bag)
    writer = BagWriter(folder, metadata)
    for topic, kind in recorded_topics(scenario).items():
        writer.add_topic(topic, kind.type_name, kind.latched)
    seen = {}
    for record in read_raw(bag):
        k = seen[record.topic] = seen.get(record.topic, -1) + 1
        writer.write(record.topic, record.stamp, change(record.topic, k, record.data))
    writer.close()
    return folder


@pytest.mark.long
def test_goals_in_mid_job_and_beliefs_are_repeated(tmp_path, capsys):
    """A goal replaces another one in mid-push, a belief changes, then a goal after the end."""
    bag = tmp_path / "bag"
    believers = []

    def extra():
        node = rclpy.create_node("person")
        believers.append(node.create_publisher(Belief, "/belief", BELIEF))
        return [node]

    with own_domain(), LockstepRun(load_scenario("short"), extra, quiet=True, record=bag) as run:
        run.start()
        team = run.teams[""]
        team.send_goal(np.array([0.1, 0.04, 0.1]))
        run.spin_until(lambda: run.bridge.time > 6.0, 10.0)
        friction = {("box", "contact_friction"): Interval(0.25, 0.2, 0.3)}
        believers[0].publish(belief_to_ros("person", friction))
        run.spin_until(lambda: run.bridge.time > 7.0, 10.0)
        team.send_goal(np.array([0.2, 0.0, 0.0]))
        run.spin_until(lambda: team.ended, 60.0)
        run.reach(np.array([0.3, 0.0, 0.0]), 60.0)
    assert main(["rerun", str(bag)]) == 0
    told = capsys.readouterr().out
    assert "equal to the bit" in told and "4 messages to the suite" in told


@pytest.mark.long
def test_calls_of_services_are_repeated(tmp_path, capsys):
    """The object is displaced in mid-push, the world paused and let go on, the job cancelled, a
    robot killed; then the world is reset, and what follows is left out."""
    bag = tmp_path / "bag"
    people = []

    def extra():
        node = rclpy.create_node("person")
        calls = (
            (8.0, Displace, "/displace", {"name": "box", "relative": True, "y": 0.03}),
            (20.0, SetBool, "/bridge/pause", {"data": True}),
            (20.0, SetBool, "/bridge/pause", {"data": False}),
            (24.0, Trigger, "/cancel", {}),
            (25.0, Kill, "/bridge/kill", {"robot": "epuck1"}),
            (26.0, Reset, "/bridge/reset", {"seed": 5}),
        )
        people.extend((at, kind, node.create_client(kind, name), f) for at, kind, name, f in calls)
        return [node]

    slow = load_scenario("short").settings("planner", push_speed=0.03)
    with own_domain(), LockstepRun(slow, extra, quiet=True, record=bag) as run:
        run.start()
        assert run.spin_until(lambda: all(c.service_is_ready() for _, _, c, _ in people), 5.0)
        run.teams[""].send_goal(np.array([0.1, 0.04, 0.1]))
        for at, kind, client, fields in people:
            run.spin_until(lambda at=at: run.bridge.time >= at, 60.0)
            answer = client.call_async(kind.Request(**fields))
            assert run.spinner.until(answer.done, 60.0) and answer.result().success, kind
        run.spin_until(lambda: 0.5 < run.bridge.time < 5.0, 60.0)
    calls = [r.message for r in read_bag(bag, {"/service_calls"})]
    assert [c.type.split("/")[-1] for c in calls] == [
        *("Displace", "SetBool", "SetBool", "Trigger", "Kill", "Reset")
    ]
    assert all(c.success for c in calls) and json.loads(calls[0].request)["y"] == 0.03
    assert main(["rerun", str(bag)]) == 0
    told = capsys.readouterr().out
    assert "equal to the bit" in told and "6 messages to the suite" in told
    assert "somebody started the world anew at 26.0" in told


@pytest.fixture(scope="module")
def beginning(tmp_path_factory):
    """The first three seconds of a job of one robot."""
    bag = tmp_path_factory.mktemp("beginning") / "bag"
    recorded_run(load_scenario("short"), "single", bag, sim_limit=3.0)
    return bag


@pytest.mark.long
def test_one_altered_field_is_found(beginning, tmp_path, capsys):
    def altered(topic, k, data):
        if topic != "/epuck1/controller/status" or k != 200:
            return data
        message = deserialize_message(bytes(data), ControllerStatus)
        message.error_y = float(np.nextafter(message.error_y, 1.0))
        return bytes(serialize_message(message))

    assert main(["rerun", str(copied(beginning, tmp_path / "same", lambda t, k, d: d))]) == 0
    told = capsys.readouterr().out
    assert "not compared: /diagnostics" in told and "solve_time" in told
    assert main(["rerun", str(copied(beginning, tmp_path / "altered", altered))]) == 1
    (line,) = [t for t in capsys.readouterr().out.splitlines() if t.startswith("first difference")]
    assert "/epuck1/controller/status at 2.0" in line and "(message 200), error_y: " in line


@pytest.mark.long
def test_a_changed_parameter_is_named_with_what_it_changes_first(beginning, tmp_path, capsys):
    words = ["rerun", str(beginning), "--set", "planner.push_speed=0.06"]
    assert main([*words, "--out", str(tmp_path / "again")]) == 1
    told = capsys.readouterr().out
    assert "parameters.planner.push_speed: 0.125 in the bag, 0.06 in the re-run" in told
    (line,) = [t for t in told.splitlines() if t.startswith("first difference")]
    assert "/push_plan" in line and "trajectory" in line
    assert read_metadata(tmp_path / "again")["pace"] == "lockstep"


@pytest.mark.long
def test_a_bag_that_is_cut_off_is_compared_as_far_as_it_goes(beginning, tmp_path, capsys):
    shutil.copytree(beginning, tmp_path / "cut")
    file = bag_file(tmp_path / "cut")
    file.write_bytes(file.read_bytes()[: 2 * file.stat().st_size // 3])
    assert main(["rerun", str(tmp_path / "cut")]) == 0
    first, *_ = told = capsys.readouterr().out.splitlines()
    assert first.startswith("the file is cut off at ") and "only what can be read" in first
    assert any("equal to the bit" in line for line in told)


@pytest.mark.long
def test_another_revision_is_told_before_anything_runs(beginning, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("push_study.rerun.revision", lambda: "0123456789ab")
    assert main(["rerun", str(beginning)]) == 0
    first, *_ = capsys.readouterr().out.splitlines()
    assert first.startswith("revision: ") and first.endswith("0123456789ab here")


def test_what_cannot_be_run_again_is_refused_with_a_sentence(tmp_path, capsys):
    writer = BagWriter(tmp_path / "foreign", {})
    writer.close()
    assert main(["rerun", str(tmp_path / "foreign")]) == 2
    assert "no scenario in it" in capsys.readouterr().err
    assert main(["rerun", str(tmp_path / "nowhere")]) == 2
    assert main(["rerun", str(tmp_path / "foreign"), "--set", "push_speed"]) == 2
    assert "NODE.SETTING=VALUE" in capsys.readouterr().err


def test_a_bag_with_targets_that_came_by_an_action_is_refused(tmp_path, capsys):
    """They are not in the bag: a run without them would differ, and look like a fault."""
    bag = tmp_path / "bag"
    with (
        own_domain(),
        LockstepRun(scenario_of("swarm"), quiet=True, system="swarm", record=bag) as run,
    ):
        run.start()
        client = ActionClient(run.observer, SwarmMove, "/swarm_move")
        assert run.spinner.until(client.server_is_ready, 5.0)
        sent = client.send_goal_async(SwarmMove.Goal(x=[0.05], y=[0.0], theta=[]))
        assert run.spin_until(sent.done, 5.0) and sent.result().accepted
        begin = run.bridge.time
        run.spin_until(lambda: run.bridge.time > begin + 1.0, 5.0)
    assert main(["rerun", str(bag)]) == 2
    assert "push_along, swarm_move" in capsys.readouterr().err


@pytest.mark.long
@pytest.mark.live
def test_a_live_bag_is_compared_by_distance(tmp_path, capsys):
    from push_bringup.suite import Suite

    with Suite("short", record=tmp_path / "bag") as suite:
        assert suite.reach(0.1, 0.04, 0.1).success
    assert read_metadata(tmp_path / "bag")["pace"] == "live"
    assert main(["rerun", str(tmp_path / "bag")]) == 0
    told = capsys.readouterr().out
    assert "the bag is of live use" in told and "equal to the bit" not in told
    (box,) = [line.split() for line in told.splitlines() if line.startswith("  box ")]
    assert float(box[5]) < 5.0  # [mm] at the end: both have reached the goal
    assert "  PUSHING" in told


@pytest.mark.long
def test_a_demo_in_lockstep_ends_with_a_report_and_can_be_repeated(tmp_path, capsys):
    words = ["demo", "swarm", "--scenario", str(tmp_path / "small.yaml"), "--lockstep"]
    (tmp_path / "small.yaml").write_text(scenario_of("swarm").text)
    out = tmp_path / "out"
    assert main([*words, "--seed", "7", "--out", str(out)]) == 0
    metadata = read_metadata(out / "bag")
    assert (metadata["seed"], metadata["pace"], metadata["system"]) == ("7", "lockstep", "swarm")
    told = bag_scenario(out / "bag")[0]
    assert told.parameters["bridge"]["seed"] == 7
    assert (out / "report.html").stat().st_size > 10_000
    assert main(["rerun", str(out / "bag")]) == 0
    assert "equal to the bit" in capsys.readouterr().out
    assert main([*words, "--factor", "2", "--out", str(out)]) == 2
    assert "no pace" in capsys.readouterr().err
    assert (out / "bag").is_dir()  # nothing was removed


@pytest.mark.long
def test_a_demo_succeeds_within_the_tolerances_of_its_method(tmp_path, capsys):
    """Robots with own sensing bring the object to within 10 cm, with any heading."""
    small = """
environment: {size: [3.0, 2.4]}
robots:
  e:
    {type: epuck_ring, count: 6, placement: {random: {seed: 2, area: [-1.3, -0.3, -1.0, 1.0]}}}
objects: {square: {type: transport_square, start: [0.0, 0.0, 0.2]}}
goal: [0.25, 0.0, 1.5]
parameters: {bridge: {world: planar}}
"""
    (tmp_path / "small.yaml").write_text(small)
    out = tmp_path / "out"
    words = ["demo", "own-sensing", "--scenario", str(tmp_path / "small.yaml"), "--lockstep"]
    assert main([*words, "--out", str(out)]) == 0
    told = capsys.readouterr().out
    error = float(told.split("final error: ")[1].split(" mm")[0])
    assert 20.0 < error <= 100.0
    assert main(["rerun", str(out / "bag")]) == 0
    assert "equal to the bit" in capsys.readouterr().out
