"""The rearranger among the other nodes: two boxes, and everything that can happen meanwhile."""

import math
import os
import signal
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped
from std_srvs.srv import Trigger

from push_model.jobs import JobError
from push_msgs.msg import JobState, Poses
from push_msgs.srv import Displace, Reset
from push_planner.rearranger_node import RearrangerNode
from push_ros.claims import own_domain
from push_ros.conversions import pose_stamped_to_ros
from push_ros.names import Names
from push_ros.qos import COMMAND
from push_scenario.scenario import scenario_from_mapping
from push_study.experiments.rearrange import RearrangeTask, Watch, run_rearrangement, trial
from push_study.graph_run import LockstepRun
from tests.samples import slice_and_study
from tests.system.processes import children_of, command

GOALS = {"a": [0.0, 0.3, 0.0], "b": [0.3, -0.3, 0.0]}


def two(**parameters):
    values = {
        "environment": "open",
        "robots": {"epuck1": {"type": "epuck", "start": [-0.6, 0.0, 0.0]}},
        "objects": {
            "a": {"type": "box9", "start": [-0.3, 0.3, 0.0]},
            "b": {"type": "box9", "start": [0.0, -0.3, 0.0]},
        },
        "arrangement": GOALS,
        "parameters": {"bridge": {"world": "planar"}, **parameters},
    }
    return scenario_from_mapping(values, "two", "test")


class Run:
    """A lockstep run, its goals, and what becomes of them."""

    def __init__(self, run, watch):
        self.run, self.watch = run, watch
        self.node = next(n for n in run.nodes if isinstance(n, RearrangerNode))
        self.person = watch.create_publisher(PoseStamped, "/goal_pose", COMMAND)
        run.start()

    @property
    def state(self):
        return self.watch.state

    def until(self, condition, limit=150.0):
        assert self.run.spin_until(condition, limit), self.state
        return self.state

    def send(self, goals):
        self.watch.send({n: np.array(p) for n, p in goals.items()}, self.run.bridge.time)

    def pushes(self, item):
        """The supervisor pushes an object."""
        seen = self.run.observer
        self.until(lambda: seen.state.state_name == "PUSHING" and seen.state.object == item)

    def ends(self, jobs=1):
        return self.until(lambda: self.state.job >= jobs and self.state.state == JobState.IDLE)

    def call(self, kind, name, request):
        client = self.watch.create_client(kind, name)
        assert self.run.spinner.until(client.service_is_ready, 5.0)
        done = client.call_async(request)
        assert self.run.spinner.until(done.done, 5.0)
        return done.result()

    def stands(self):
        """Neither the supervisor nor the robot does anything any more."""
        seen = self.run.observer
        self.until(lambda: seen.state.state == JobState.IDLE, 2.0)
        before = self.watch.poses["epuck1"]
        end = self.run.bridge.time + 0.6
        self.until(lambda: self.run.bridge.time > end)
        assert np.hypot(*(self.watch.poses["epuck1"] - before)[:2]) < 0.02


@pytest.fixture
def run():
    watches = []

    def watch():
        watches.append(Watch(Names("/", "/"), "epuck1"))
        return list(watches)

    with own_domain(), LockstepRun(two(), watch, quiet=True, system="rearrange") as made:
        yield Run(made, watches[0])


@pytest.mark.long
def test_two_boxes_reach_their_goals_and_equal_runs_are_equal_to_the_bit():
    rows = [run_rearrangement(two()) for _ in range(2)]
    for row in rows:
        assert row["success"] and row["moves"] == 2 and row["replans"] == 0, row
        assert row["position_error_m"] < 0.003 and row["collisions"] == 0
        del row["planning_cpu_s"]
    assert rows[0] == rows[1]


@pytest.mark.parametrize(
    ("message", "code", "words"),
    [
        (Poses(), JobError.UNKNOWN_FRAME, "frame"),
        (Poses(names=["a", "x"]), JobError.UNKNOWN_OBJECT, "unknown objects: x; expected of: a, b"),
        (Poses(names=["a"]), JobError.INVALID_GOAL, "same length"),
        (Poses(names=[]), JobError.INVALID_GOAL, "no goals"),
        (
            Poses(names=["a"], x=[math.nan], y=[0.0], theta=[0.0]),
            JobError.INVALID_GOAL,
            "not finite",
        ),
        (
            Poses(names=["a", "a"], x=[0.0, 0.2], y=[0.0, 0.0], theta=[0.0, 0.0]),
            JobError.INVALID_GOAL,
            "twice",
        ),
        (Poses(names=["a"], x=[5.0], y=[0.0], theta=[0.0]), JobError.OUTSIDE_MAP, "outside"),
    ],
)
def test_goals_that_cannot_be_are_refused_and_the_job_goes_on(message, code, words, run):
    run.send(GOALS)
    run.until(lambda: run.state.job == 1)
    if code != JobError.UNKNOWN_FRAME:
        message.header.frame_id = "map"
    run.watch._publisher.publish(message)
    state = run.until(lambda: run.state.refusals == 1)
    assert state.refusal_code == code and words in state.refusal
    assert run.node.busy and state.job == 1


@pytest.mark.long
def test_what_happens_in_mid_job(run):
    """One run after another in one world: cancel, a person's goal, other goals, a moved box."""
    run.send(GOALS)
    run.pushes("a")
    answer = run.call(Trigger, "/cancel_rearrangement", Trigger.Request())
    assert answer.success and run.ends().error_code == JobError.CANCELED
    run.stands()
    assert not run.call(Trigger, "/cancel_rearrangement", Trigger.Request()).success

    run.send(GOALS)
    run.pushes("a")
    assert run.call(Trigger, "/cancel", Trigger.Request()).success
    assert run.ends(2).error_code == JobError.CANCELED
    run.stands()

    run.send(GOALS)
    run.pushes("a")
    run.person.publish(pose_stamped_to_ros(np.array([0.1, 0.35, 0.0]), 0.0))
    state = run.ends(3)
    assert state.error_code == JobError.PREEMPTED
    run.until(lambda: run.run.observer.state.state == JobState.IDLE)  # the person's job goes on
    assert run.run.observer.state.error_code == 0
    assert np.hypot(*(run.watch.poses["a"] - [0.1, 0.35, 0.0])[:2]) < 0.02

    run.send(GOALS)
    run.pushes("b")
    moved = Displace.Request(name="a", x=-0.6, y=0.4)
    assert run.call(Displace, "/displace", moved).success
    state = run.ends(4)
    assert state.error_code == 0 and state.replans >= 1, state
    for name, goal in GOALS.items():
        assert np.hypot(*(run.watch.poses[name] - goal)[:2]) < 0.005


@pytest.mark.long
def test_new_goals_replace_those_under_way(run):
    run.send(GOALS)
    run.pushes("a")
    run.send({"b": [0.2, -0.3, 0.0]})
    state = run.ends(2)
    assert state.job == 2 and state.error_code == 0
    assert np.hypot(*(run.watch.poses["b"] - [0.2, -0.3, 0.0])[:2]) < 0.005


def test_a_cancel_is_heard_while_it_plans(run):
    run.send(GOALS)
    run.until(lambda: run.state.reason.startswith("searching"))
    assert run.call(Trigger, "/cancel_rearrangement", Trigger.Request()).success
    assert run.ends().error_code == JobError.CANCELED and run.watch.moves <= 1
    run.stands()


def test_a_reset_ends_it(run):
    run.send(GOALS)
    run.pushes("a")
    assert run.call(Reset, "/bridge/reset", Reset.Request()).success
    assert run.ends().error_code == JobError.CLOCK_RESET


@pytest.mark.parametrize(
    ("name", "world"),
    slice_and_study(
        [
            ("relopush-3", "pybullet"),
            ("relopush-6", "planar"),
            ("relopush-3", "planar"),
            ("relopush-6", "pybullet"),
        ],
        2,
    ),
)
def test_a_slice_of_the_study(name, world):
    """As the study runs it; in relopush-6 a box is moved out of the way."""
    row = trial(RearrangeTask(name, 102, "mild", world))
    assert row["success"], row
    assert row["moved_aside"] == (name == "relopush-6")


@pytest.mark.live
@pytest.mark.long
def test_the_verb_follows_refusals_moves_and_a_node_that_dies(tmp_path):
    """Live: goals of the scenario, goals that are refused, and a rearranger killed in mid-job."""
    from push_bringup.arranger import Arranger

    with own_domain() as domain:
        (tmp_path / "two.yaml").write_text(two().text)
        scenario = ("--scenario", str(tmp_path / "two.yaml"))
        environment = {**os.environ, "ROS_DOMAIN_ID": str(domain)}
        launch = command("launch", "rearrange", "--respawn", *scenario, env=environment)
        try:
            with Arranger() as arranger:
                assert arranger.connect(60.0)
                assert arranger.arrangement()["a"] == pytest.approx((0.0, 0.3, 0.0))
                arranger.send({"a": (9.0, 0.0, 0.0)})
                assert arranger.follow(20.0, print)[0] == "OUTSIDE_MAP"
                told = []
                arranger.send(arranger.arrangement())
                assert arranger.follow(120.0, told.append) == ("", "every object is at its goal")
                assert any("(1 of 2)" in text for text in told)
                arranger.send({"b": (0.6, -0.3, 0.0)})

                def node(word):
                    """The process of a node, by a word of its command line."""
                    lines = {
                        p: Path(f"/proc/{p}/cmdline").read_text() for p in children_of(launch.pid)
                    }
                    return next(pid for pid, line in lines.items() if word in line)

                def kill(text):
                    if text.startswith("'b'"):
                        os.kill(node("rearranger"), signal.SIGKILL)

                assert arranger.follow(60.0, kill)[0] in ("JOB_FORGOTTEN", "NODE_LOST")
        finally:
            launch.send_signal(signal.SIGINT)
            assert launch.wait(30) == 0
