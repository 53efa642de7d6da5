"""Goals that meet a job under way: what each client is told, and what the robot does meanwhile."""

import math

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import PoseStamped
from rclpy.action import ActionClient
from std_srvs.srv import SetBool

from push_msgs.action import MoveObject
from push_msgs.msg import JobState
from push_msgs.srv import LoadScenario
from push_ros.conversions import pose_stamped_to_ros
from push_ros.qos import COMMAND
from push_scenario.scenario import config_directory, load_scenario
from push_study.graph_run import LockstepRun


class Jobs:
    """A lockstep run with an action client."""

    def __init__(self, run):
        self.run = run
        self.goal = run.scenario.goal
        self.client = ActionClient(run.observer, MoveObject, "/move_object")
        self.topic = run.observer.create_publisher(PoseStamped, "/goal_pose", COMMAND)
        assert run.spinner.until(
            lambda: self.client.server_is_ready() and self.topic.get_subscription_count() > 0, 5.0
        )

    @property
    def state(self):
        return self.run.observer.state

    def send(self, goal, item=""):
        """A goal by action; its handle."""
        message = goal if isinstance(goal, PoseStamped) else pose_stamped_to_ros(goal, 0.0)
        sent = self.client.send_goal_async(MoveObject.Goal(object=item, goal=message))
        assert self.run.spin_until(sent.done, 5.0) and sent.result().accepted
        return sent.result()

    def result(self, handle, limit=120.0):
        """Status and result of a handle."""
        answer = handle.get_result_async()
        assert self.run.spin_until(answer.done, limit)
        return answer.result().status, answer.result().result

    def pushing(self):
        assert self.run.spin_until(
            lambda: (
                self.state.state == JobState.PUSHING
                and self.run.observer.trace.object[-1][0] > -0.40
            ),
            60.0,
        )

    def ended(self):
        assert self.run.spin_until(lambda: self.state.state == JobState.IDLE, 120.0)
        return self.state

    def wait(self, seconds):
        end = self.run.bridge.time + seconds
        self.run.spin_until(lambda: self.run.bridge.time >= end, seconds + 1.0)


@pytest.fixture
def jobs():
    with LockstepRun(load_scenario("short"), quiet=True) as run:
        run.start()
        yield Jobs(run)


def bad(kind, goal):
    message = pose_stamped_to_ros(goal, 0.0)
    if kind == "nan":
        message.pose.position.x = math.nan
    elif kind == "frame":
        message.header.frame_id = "odom"
    elif kind == "occupied":
        message.pose.position.x = 1.49
    else:
        message.pose.position.x = 40.0
    return message


CODES = {
    "nan": MoveObject.Result.INVALID_GOAL,
    "frame": MoveObject.Result.UNKNOWN_FRAME,
    "outside": MoveObject.Result.OUTSIDE_MAP,
    "occupied": MoveObject.Result.GOAL_OCCUPIED,
}


def some(kinds, quick):
    """All of them; those that are not quick in the slow tests."""
    return [k if k in quick else pytest.param(k, marks=pytest.mark.long) for k in kinds]


@pytest.mark.parametrize("kind", some(CODES, ("occupied",)))
def test_a_bad_goal_on_the_topic_leaves_a_job_alone(jobs, kind):
    """FAULTS 2, in the middle of a push, whether the job came by topic or by action."""
    handle = jobs.send(jobs.goal)
    jobs.pushing()
    jobs.topic.publish(bad(kind, jobs.goal))
    assert jobs.run.spin_until(lambda: jobs.state.refusals == 1, 5.0)
    assert jobs.state.refusal_code == CODES[kind] and jobs.state.refusal
    assert jobs.state.state == JobState.PUSHING
    status, result = jobs.result(handle)
    assert status == GoalStatus.STATUS_SUCCEEDED and result.error_code == 0
    assert result.pushes == 1 and result.position_error < 0.02


@pytest.mark.long
@pytest.mark.parametrize("kind", [*CODES, "object"])
def test_a_bad_action_goal_is_told_so_and_leaves_a_job_alone(jobs, kind):
    jobs.run.observer.send_goal(jobs.goal)
    jobs.pushing()
    if kind == "object":
        _, result = jobs.result(jobs.send(jobs.goal, "moon"), 5.0)
        assert result.error_code == MoveObject.Result.UNKNOWN_OBJECT
    else:
        _, result = jobs.result(jobs.send(bad(kind, jobs.goal)), 5.0)
        assert result.error_code == CODES[kind] and result.error_msg
    assert jobs.state.state == JobState.PUSHING
    assert jobs.ended().error_code == 0


def test_a_new_action_goal_replaces_the_one_under_way_and_can_be_canceled(jobs):
    first = jobs.send(jobs.goal)
    jobs.pushing()
    second = jobs.send(jobs.goal + [0.1, 0.0, 0.0])
    status, result = jobs.result(first, 5.0)
    assert status == GoalStatus.STATUS_ABORTED
    assert result.error_code == MoveObject.Result.PREEMPTED
    assert jobs.state.state != JobState.IDLE
    second.cancel_goal_async()
    status, result = jobs.result(second, 5.0)
    assert status == GoalStatus.STATUS_CANCELED
    assert result.error_code == MoveObject.Result.CANCELED
    jobs.wait(0.4)
    before = jobs.run.observer.trace.robot[-1]
    jobs.wait(0.5)
    assert np.hypot(*(jobs.run.observer.trace.robot[-1] - before)[:2]) < 1e-3


@pytest.mark.long
def test_a_goal_on_the_topic_replaces_an_action_and_is_reached(jobs):
    first = jobs.send(jobs.goal + [0.1, 0.0, 0.0])
    jobs.pushing()
    jobs.run.observer.send_goal(jobs.goal)
    _, result = jobs.result(first, 5.0)
    assert result.error_code == MoveObject.Result.PREEMPTED
    assert jobs.ended().error_code == 0
    assert jobs.run.observer.trace.object[-1][:2] == pytest.approx(jobs.goal[:2], abs=0.02)


@pytest.mark.long
def test_an_action_goal_takes_over_from_a_goal_on_the_topic(jobs):
    jobs.run.observer.send_goal(jobs.goal + [0.1, 0.0, 0.0])
    jobs.pushing()
    status, result = jobs.result(jobs.send(jobs.goal))
    assert status == GoalStatus.STATUS_SUCCEEDED and result.error_code == 0
    assert jobs.run.observer.trace.object[-1][:2] == pytest.approx(jobs.goal[:2], abs=0.02)


@pytest.mark.long
def test_the_same_goal_again_is_answered_again(jobs):
    assert jobs.run.reach(jobs.goal).error_code == 0
    again = jobs.run.reach(jobs.goal)
    assert again is not None and again.error_code == 0 and "at the goal" in again.reason


def test_poses_that_are_silent_for_long_end_a_goal_as_such(jobs):
    """FAULTS 7: the supervisor says that it has no poses, not that it cannot plan."""
    supervisor = jobs.run.supervisor
    supervisor._apply(type(supervisor.settings)(pose_timeout=0.3, node_timeout=0.6))
    supervisor._poses.clock.lockstep = False  # live, where silence counts
    jobs.run.bridge.running = False
    assert jobs.run.spinner.until(lambda: supervisor._pose("box") is None, 5.0)
    jobs.run.observer.send_goal(jobs.goal)
    assert jobs.run.spinner.until(
        lambda: jobs.state.error_code == MoveObject.Result.POSES_STALE, 10.0
    )
    assert "no poses" in jobs.state.reason
    supervisor._poses.clock.lockstep = True
    jobs.run.bridge.start()
    assert jobs.run.reach(jobs.goal).error_code == 0


def pause(jobs, on):
    client = jobs.run.observer.create_client(SetBool, "/bridge/pause")
    assert jobs.run.spinner.until(client.service_is_ready, 5.0)
    done = client.call_async(SetBool.Request(data=on))
    assert jobs.run.spinner.until(done.done, 5.0) and done.result().success


@pytest.mark.long
def test_a_pause_in_mid_push_stands_still_and_goes_on(jobs):
    """FAULTS 12 and 24: longer than anybody waits for poses; nobody answers late, nothing is
    stopped by force, the goal is reached."""
    jobs.run.observer.send_goal(jobs.goal)
    jobs.pushing()
    pause(jobs, True)
    tick = jobs.run.bridge.tick
    jobs.run.spinner.until(lambda: False, 7.0)
    assert jobs.run.bridge.tick == tick and jobs.state.state == JobState.PUSHING
    pause(jobs, False)
    assert jobs.ended().error_code == 0
    assert jobs.run.bridge.unanswered == 0 and jobs.state.replans == 0


@pytest.mark.long
def test_another_scenario_with_other_names_can_be_loaded(jobs, tmp_path):
    text = (config_directory() / "scenarios" / "short.yaml").read_text()
    path = tmp_path / "other.yaml"
    path.write_text(text.replace("epuck1", "walle").replace("box:", "crate:", 1))
    jobs.run.observer.send_goal(jobs.goal)
    jobs.pushing()
    client = jobs.run.observer.create_client(LoadScenario, "/bridge/load_scenario")
    assert jobs.run.spinner.until(client.service_is_ready, 5.0)
    done = client.call_async(LoadScenario.Request(scenario=str(path)))
    assert jobs.run.spinner.until(done.done, 5.0) and done.result().success
    assert jobs.run.spinner.until(lambda: jobs.run.bridge.tick > 300, 20.0)
    assert set(jobs.run.bridge.world.poses()) == {"walle", "crate"}
    wrong = client.call_async(LoadScenario.Request(scenario="atlantis"))
    assert jobs.run.spinner.until(wrong.done, 5.0)
    assert not wrong.result().success and "atlantis" in wrong.result().message
