"""The command line: its grammar, and that what is wrong is said before anything starts."""

import importlib
import json

import numpy as np
import pytest
import rclpy

from benchmarks import NAMES
from planar_push import arguments
from planar_push.main import main, parser, verbs
from push_bringup import launcher
from push_msgs.msg import JobState, Poses
from push_ros.conversions import poses_to_ros
from push_ros.qos import LATCHED, STREAM
from push_scenario.scenario import config_directory
from push_study.study import experiment_names


@pytest.fixture
def nothing_starts(monkeypatch):
    """No process is started."""

    def refuse(*_, **__):
        raise AssertionError("a process was started")

    monkeypatch.setattr(launcher.subprocess, "Popen", refuse)


def code_of(line):
    try:
        return main(line)
    except SystemExit as refusal:  # by the grammar
        return refusal.code


def test_every_verb_has_words_and_says_what_it_does():
    assert {"demo", "launch", "goal", "view", "record", "play", "report", "experiment"} <= set(
        verbs()
    )
    text = parser().format_help()
    for name in verbs():
        verb = importlib.import_module(f"planar_push.{name}")
        assert verb.__doc__ and name.replace("_", "-") in text
        with pytest.raises(SystemExit) as refusal:
            main([name.replace("_", "-"), "--help"])
        assert refusal.value.code == 0


def test_help_says_what_each_benchmark_and_each_study_is_for(capsys):
    for verb, known in (("bench", NAMES), ("experiment", experiment_names())):
        with pytest.raises(SystemExit):
            main([verb, "--help"])
        lines = capsys.readouterr().out.splitlines()
        for name in known:
            (line,) = [at for at in lines if at.startswith(f"  {name} ")]
            assert len(line.removeprefix(f"  {name}").split()) >= 4, line


@pytest.mark.parametrize(
    ("line", "what"),
    [
        (["launch", "single", "--scenario", "atlantis"], "env1-target1"),
        (["launch", "single", "--factor", "0"], "positive"),
        (["launch", "single", "--factor", "nan"], "finite"),
        (["launch", "single", "--factor", "inf"], "finite"),
        (["launch", "single", "--factor", "-1"], "positive"),
        (["launch", "single", "--factor", "1e9"], "real_time_factor"),
        (["launch", "single", "--namespace", "1a"], "namespace"),
        (["launch", "orchestra"], "single"),
        (["launch", "single", "--record", "BAG"], "exists already"),
        (["launch", "single", "--record", "FILE/bag"], "cannot be written"),
        (["launch", "single", "--scenario", "ring20"], "robots"),
        (["demo", "--scenario", "atlantis", "--out", "OUT"], "env1-target1"),
        (["demo", "--factor", "0", "--out", "OUT"], "positive"),
        (["demo", "--namespace", "a b", "--out", "OUT"], "namespace"),
        (["demo", "--timeout", "0", "--out", "OUT"], "positive"),
        (["demo", "--out", "FILE/demo"], "cannot be written"),
        (["record", "--out", "BAG"], "exists already"),
        (["record", "--scenario", "atlantis", "--out", "OUT"], "env1-target1"),
        (["record", "--namespace", "a-b", "--out", "OUT"], "namespace"),
        (["view", "--scenario", "atlantis"], "env1-target1"),
        (["view", "--port", "-1"], "at least 0"),
        (["view", "--port", "65536"], "at most 65535"),
        (["play", "BAG", "--port", "65536"], "at most 65535"),
        (["goal", "nan", "0", "0"], "finite"),
        (["goal", "0", "0", "0", "--namespace", "/a b"], "namespace"),
        (["goal", "0", "0", "0", "--no-wait", "--timeout", "5"], "--timeout: with --no-wait"),
        (["rearrange", "--no-wait", "--timeout", "5"], "--timeout: with --no-wait"),
        (["leaderboard", "--workers", "2", "--scheduler", "tcp://a:1", "--out", "OUT"], "workers:"),
        (["launch", "single", "--scenario", "rearrange"], "the system 'rearrange' can carry out"),
        (["launch", "group", "--scenario", "rearrange"], "'rearrange' has an arrangement"),
        (["report", "NOWHERE"], "NOWHERE"),
        (["play", "NOWHERE"], "NOWHERE: no such bag"),
        (["play", "BAG"], "no .mcap file"),
        (["play", "BAG", "--factor", "0"], "positive"),
        (["recover", "NOWHERE", "--out", "OUT"], "NOWHERE"),
        (["bench", "solvers", "--steps", "0"], "at least 1"),
        (["bench", "mpc", "--steps", "100", "--out", "OUT"], "for bench solvers only"),
        (["bench", "--steps", "100"], "for bench solvers only"),
    ],
)
def test_wrong_words_end_with_2_before_anything_starts(
    tmp_path, capsys, nothing_starts, line, what
):
    (tmp_path / "BAG").mkdir()
    (tmp_path / "FILE").write_text("")
    places = ("BAG", "FILE", "OUT", "NOWHERE")
    line = [str(tmp_path / w) if w.split("/")[0] in places else w for w in line]
    before = sorted(tmp_path.rglob("*"))
    assert code_of(line) == 2
    error = capsys.readouterr().err
    assert what in error and "Traceback" not in error
    assert sorted(tmp_path.rglob("*")) == before


def test_a_demo_that_cannot_start_leaves_the_last_one_alone(tmp_path, capsys, nothing_starts):
    (tmp_path / "report.pdf").write_text("of the last demo")
    assert main(["demo", "--scenario", "ring20", "--out", str(tmp_path)]) == 2
    assert (tmp_path / "report.pdf").read_text() == "of the last demo"


@pytest.mark.parametrize("namespace", ["", "a"])
def test_a_second_suite_in_a_domain_is_noticed(tmp_path, ros, domain, capsys, namespace):
    """FAULTS 23: before anything starts; a namespace is room for another one."""
    node = rclpy.create_node("somebody", namespace=namespace)
    publisher = node.create_publisher(Poses, "poses", STREAM)
    publisher.publish(poses_to_ros({"box": np.zeros(3)}, 0.0))
    own = ["--namespace", namespace] if namespace else []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(launcher.subprocess, "Popen", None)
        for line in (
            ["launch", "single", *own],
            ["demo", "--scenario", "short", "--out", str(tmp_path / "demo"), *own],
        ):
            assert main(line) == 2
            error = capsys.readouterr().err
            assert f"a bridge already runs in domain {domain}" in error
        assert not (tmp_path / "demo").exists()
        with pytest.raises(TypeError):  # it would start there
            main(["launch", "single", "--namespace", "elsewhere"])
    node.destroy_node()


def test_without_a_bridge_it_is_said_what_is_missing(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("push_record.recorder._PATIENCE", 0.3)
    assert main(["record", "--namespace", "lab", "--out", str(tmp_path / "bag")]) == 2
    assert "/lab/scenario" in capsys.readouterr().err
    assert not (tmp_path / "bag").exists()


def test_schemas_are_written_as_they_are_in_config(tmp_path, capsys):
    assert main(["schema", "--out", str(tmp_path)]) == 0
    made = {p.name: json.loads(p.read_text()) for p in tmp_path.glob("*.json")}
    kept = {p.name: json.loads(p.read_text()) for p in (config_directory() / "schema").glob("*")}
    assert made and made == kept


def test_numbers_on_the_command_line():
    assert arguments.positive("2.5") == 2.5 and arguments.whole(1)("3") == 3
    for parse, text in (
        (arguments.positive, "0"),
        (arguments.finite, "nan"),
        (arguments.whole(1), "0"),
    ):
        with pytest.raises(arguments.argparse.ArgumentTypeError):
            parse(text)


def test_launch_says_what_to_do_next():
    from planar_push.launch import _what_next
    from push_bringup.preparation import prepare

    setup = prepare("two-singles", namespace="lab")
    assert _what_next(setup).endswith("planar-push goal X Y THETA --namespace lab --team south")
    torque = prepare("wheel-slip", system="torque")
    assert _what_next(torque) == "send trajectories to: /pioneer/follow_trajectory"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("box.contact_friction=0.25:0.2:0.3", (("box", "contact_friction"), (0.25, 0.2, 0.3))),
        ("latency=0.03", (("", "latency"), (0.03, 0.03, 0.03))),
        ("a.b.mass=1", (("a.b", "mass"), (1.0, 1.0, 1.0))),
        ("box.charm=1", None),
        ("box.mass", None),
        ("box.mass=heavy", None),
        ("box.mass=1:2", None),
        ("box.mass=1:2:3", None),
        ("box.mass=nan", None),
    ],
)
def test_a_belief_on_the_command_line(text, expected):
    from planar_push.belief import parsed
    from push_model.belief import BeliefError, Interval

    if expected is None:
        with pytest.raises(BeliefError):
            parsed(text)
    else:
        assert parsed(text) == (expected[0], Interval(*expected[1]))


@pytest.mark.parametrize("words", [[], ["--team", "nosuch"]])
def test_a_goal_without_the_name_of_its_team_is_told_the_names(words, ros, monkeypatch, capsys):
    monkeypatch.setattr("planar_push.goal._PATIENCE", 1.0)
    node = rclpy.create_node("somebody")
    publishers = [
        node.create_publisher(JobState, f"/{team}/job_state", LATCHED)
        for team in ("south", "north")
    ]
    assert main(["goal", "0", "0", "0", *words]) == 1
    assert "name a team of the running suite by --team: north, south" in capsys.readouterr().err
    for publisher in publishers:
        node.destroy_publisher(publisher)
    node.destroy_node()


@pytest.mark.parametrize("system", ["rearrange", "torque"])
def test_a_demo_of_a_system_without_a_single_goal_says_what_to_run(system, capsys):
    assert main(["demo", system]) == 2
    assert f"planar-push launch {system}" in capsys.readouterr().err


@pytest.mark.parametrize("words", [["goal", "0", "0", "0"], ["launch", "single"], ["view"]])
def test_a_command_keeps_out_of_a_run_of_somebody_else(words, domain, monkeypatch, capsys):
    """A goal was executed by the trial of a study that happened to run in the same domain."""
    monkeypatch.delenv("PLANAR_PUSH_DOMAIN")  # as a process that this test has not started
    assert main(words) == 2
    error = capsys.readouterr().err
    assert f"another process uses ROS domain {domain} now" in error and "ROS_DOMAIN_ID" in error
