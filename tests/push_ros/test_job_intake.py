"""Goals at the door: FAULTS 2, 3, 22, 28, whoever the owner of the job is."""

import math
import os

import numpy as np
import pytest
import rclpy
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import PoseStamped
from rclpy.action import ActionClient
from rclpy.serialization import serialize_message
from std_srvs.srv import Trigger

from push_model.jobs import GoalRefused, JobError
from push_msgs.action import MoveObject
from push_msgs.msg import JobState
from push_ros.conversions import pose_stamped_to_ros
from push_ros.diagnostics import Diagnostics
from push_ros.job_intake import JobIntake
from push_ros.job_memory import JobMemory, KeptJob, new_memory
from push_ros.names import Names
from push_ros.process import Spinner
from push_ros.qos import COMMAND, LATCHED


class Owner:
    """Works on a job until it is told that it is done. Goals beyond x = 5 are occupied."""

    def __init__(self, **more):
        self.node = rclpy.create_node("owner")
        self.names = Names("/", "/red/")
        self.busy, self.plan_ready = False, False
        self.taken, self.executed = [], 0
        diagnostics = Diagnostics(self.node, self.names, dict)
        self.intake = JobIntake(
            self.node, self.names, diagnostics, self, "single", ["epuck1"], "box", **more
        )
        self.say("IDLE")

    def say(self, state, code=JobError.NONE):
        self.intake.publish(1.0, state_name=state, reason="because", error_code=int(code))

    def check_goal(self, goal):
        if goal[0] > 5.0:
            raise GoalRefused(JobError.GOAL_OCCUPIED, "a wall is there")

    def take_goal(self, goal, plan_only):
        assert not self.busy and not self.plan_ready
        self.taken.append((tuple(goal), plan_only))
        self.busy, self.plan_ready = not plan_only, plan_only
        self.say("PUSHING")

    def end_job(self, code, message):
        if self.busy or self.plan_ready:
            self.busy = self.plan_ready = False
            self.intake.finish(MoveObject.Result(error_code=int(code), error_msg=message))
            self.say("IDLE", code)

    def execute(self):
        self.executed += 1


class Planner(Owner):
    """Is busy, too, while its plan waits to be executed, as the supervisor is."""

    def take_goal(self, goal, plan_only):
        super().take_goal(goal, plan_only)
        self.busy = True

    def execute(self):
        super().execute()
        self.plan_ready = False


class Choice(Owner):
    """Pushes a crate, too, but not beyond x = 3."""

    names_of_objects = ("box", "crate")

    def __init__(self):
        self.used = []
        super().__init__(choice=self)

    def check_other(self, item, goal):
        if goal[0] > 3.0:
            raise GoalRefused(JobError.GOAL_OCCUPIED, f"no room for the {item}")

    def use(self, item):
        assert not self.busy
        self.used.append(item)


class Client:
    def __init__(self, owner=None):
        self.owner = owner or Owner()
        self.node = rclpy.create_node("client")
        self.states = []
        self.node.create_subscription(JobState, "/red/job_state", self.states.append, LATCHED)
        self.goals = self.node.create_publisher(PoseStamped, "/red/goal_pose", COMMAND)
        self.action = ActionClient(self.node, MoveObject, "/red/move_object")
        self.spinner = Spinner([self.owner.node, self.node])
        ready = lambda: (  # noqa: E731
            self.states
            and self.action.server_is_ready()
            and self.goals.get_subscription_count() > 0
        )
        assert self.spinner.until(ready, 15.0)

    @property
    def state(self):
        return self.states[-1]

    def publish(self, goal, stamp=0.0):
        before = len(self.states)
        message = goal if isinstance(goal, PoseStamped) else pose_stamped_to_ros(goal, stamp)
        self.goals.publish(message)
        assert self.spinner.until(lambda: len(self.states) > before, 15.0)

    def send(self, goal, item="", plan_only=False):
        message = pose_stamped_to_ros(np.array(goal), 0.0)
        request = MoveObject.Goal(object=item, goal=message, plan_only=plan_only)
        sent = self.action.send_goal_async(request)
        assert self.spinner.until(sent.done, 15.0)
        return sent.result().get_result_async()

    def result(self, answer):
        assert self.spinner.until(answer.done, 15.0)
        return answer.result().status, answer.result().result


@pytest.fixture
def client(ros):
    client = Client()
    yield client
    client.spinner.close()


GOAL = np.array([1.0, 0.5, 0.3])


def test_a_goal_is_taken_and_the_state_tells_whose_it_is(client):
    client.publish(GOAL, stamp=12.5)
    assert client.owner.taken == [(pytest.approx(tuple(GOAL)), False)]
    state = client.state
    assert (state.system, list(state.robots), state.object) == ("single", ["epuck1"], "box")
    assert state.job == 1 and state.goal.header.stamp.sec == 12 and state.refusals == 0


def spoiled(kind):
    message = pose_stamped_to_ros(GOAL, 3.0)
    q = message.pose.orientation
    if kind == "nan":
        message.pose.position.y = math.nan
    elif kind == "zero quaternion":
        q.x = q.y = q.z = q.w = 0.0
    elif kind == "frame":
        message.header.frame_id = "odom"
    else:
        message.pose.position.x = 6.0
    return message


CODES = {
    "nan": JobError.INVALID_GOAL,
    "zero quaternion": JobError.INVALID_GOAL,
    "frame": JobError.UNKNOWN_FRAME,
    "occupied": JobError.GOAL_OCCUPIED,
}


@pytest.mark.parametrize("busy", [False, True])
@pytest.mark.parametrize("kind", CODES)
def test_a_goal_that_cannot_be_is_refused_and_touches_no_job(client, kind, busy):
    if busy:
        client.publish(GOAL)
    jobs = len(client.owner.taken)
    bad = spoiled(kind)
    client.publish(bad)
    state = client.state
    assert state.refusals == 1 and state.refusal_code == CODES[kind] and state.refusal
    assert state.refused_goal.header.stamp.sec == 3
    assert (state.job, state.error_code) == (jobs, 0) and len(client.owner.taken) == jobs
    assert client.owner.busy is busy
    request = client.action.send_goal_async(MoveObject.Goal(goal=bad))
    assert client.spinner.until(request.done, 15.0)
    status, result = client.result(request.result().get_result_async())
    assert status == GoalStatus.STATUS_ABORTED and result.error_code == CODES[kind]
    assert client.owner.busy is busy and client.state.refusals == 2


def test_the_goal_that_is_pursued_sent_again_changes_nothing(client):
    """FAULTS 28, by topic and by action; the stamp tells the second sender that it is served."""
    client.publish(GOAL, stamp=1.0)
    for stamp in range(2, 12):
        client.publish(GOAL, stamp=float(stamp))
        assert client.state.goal.header.stamp.sec == stamp
    answer = client.send(GOAL)
    assert client.spinner.until(lambda: client.owner.intake.waited_for, 15.0)
    assert len(client.owner.taken) == 1 and client.state.job == 1
    client.owner.end_job(JobError.NONE, "done")
    assert client.result(answer)[0] == GoalStatus.STATUS_SUCCEEDED


def test_a_second_client_with_the_same_goal_takes_over(client):
    first = client.send(GOAL)
    assert client.spinner.until(lambda: client.owner.busy, 15.0)
    second = client.send(GOAL)
    assert client.result(first)[1].error_code == JobError.PREEMPTED
    assert len(client.owner.taken) == 1 and client.owner.busy
    client.owner.end_job(JobError.NONE, "done")
    assert client.result(second)[1].error_code == 0


def test_a_flood_of_goals_ends_with_the_last(client):
    random = np.random.default_rng(2)
    goals = random.uniform(-1.0, 1.0, (60, 3))
    for goal in goals:
        client.goals.publish(pose_stamped_to_ros(goal, 0.0))
        client.spinner.once(0.0)
    last = tuple(goals[-1])
    assert client.spinner.until(
        lambda: bool(client.owner.taken) and np.allclose(client.owner.taken[-1][0], last), 15.0
    )
    assert client.owner.busy
    assert client.spinner.until(lambda: client.state.job == len(client.owner.taken), 15.0)


def test_another_object_a_plan_that_waits_and_cancel(client):
    _, result = client.result(client.send(GOAL, item="moon"))
    assert result.error_code == JobError.UNKNOWN_OBJECT and not client.owner.taken
    answer = client.send(GOAL, plan_only=True)
    assert client.spinner.until(lambda: client.owner.plan_ready, 15.0)
    execute = client.node.create_client(Trigger, "/red/execute")
    assert client.spinner.until(execute.service_is_ready, 15.0)
    called = execute.call_async(Trigger.Request())
    assert client.spinner.until(called.done, 15.0)
    assert called.result().success and client.owner.executed == 1
    cancel = client.node.create_client(Trigger, "/red/cancel")
    assert client.spinner.until(cancel.service_is_ready, 15.0)
    called = cancel.call_async(Trigger.Request())
    assert client.spinner.until(called.done, 15.0) and called.result().success
    assert client.result(answer)[1].error_code == JobError.CANCELED
    called = cancel.call_async(Trigger.Request())
    assert client.spinner.until(called.done, 15.0) and not called.result().success


@pytest.fixture
def planner(ros):
    client = Client(Planner())
    yield client
    client.spinner.close()


def plan(client):
    """Somebody waits for the plan to a goal."""
    answer = client.send(GOAL, plan_only=True)
    assert client.spinner.until(lambda: client.owner.plan_ready, 15.0)
    return answer


def modes(client):
    """Whether each job that was taken ends with its plan."""
    return [plan_only for _, plan_only in client.owner.taken]


@pytest.mark.parametrize("by", ["topic", "action"])
def test_a_goal_whose_plan_waits_is_pursued_when_it_comes_to_be_executed(planner, by):
    """FAULTS 28 does not hold for it: planning alone is not what is asked."""
    waits = plan(planner)
    if by == "topic":
        planner.publish(GOAL)
    else:
        answer = planner.send(GOAL)
    assert planner.result(waits)[1].error_code == JobError.PREEMPTED
    assert planner.spinner.until(lambda: planner.state.job == 2, 15.0)
    assert modes(planner) == [True, False] and planner.owner.busy and not planner.owner.plan_ready
    if by == "action":
        planner.owner.end_job(JobError.NONE, "done")
        assert planner.result(answer)[0] == GoalStatus.STATUS_SUCCEEDED


def test_a_plan_alone_of_the_goal_that_is_pursued_ends_the_pursuit(planner):
    planner.publish(GOAL)
    plan(planner)
    assert modes(planner) == [False, True]


def test_after_execute_the_goal_is_pursued_and_sent_again_changes_nothing(planner):
    waits = plan(planner)
    again = plan(planner)
    assert planner.result(waits)[1].error_code == JobError.PREEMPTED  # the client, not the job
    assert modes(planner) == [True]
    execute = planner.node.create_client(Trigger, "/red/execute")
    assert planner.spinner.until(execute.service_is_ready, 15.0)
    called = execute.call_async(Trigger.Request())
    assert planner.spinner.until(called.done, 15.0) and called.result().success
    planner.publish(GOAL)
    assert modes(planner) == [True] and planner.owner.busy and planner.state.job == 1
    planner.owner.end_job(JobError.NONE, "done")
    assert planner.result(again)[0] != GoalStatus.STATUS_SUCCEEDED, "it was taken over"


def test_a_goal_of_another_object_where_the_owner_has_a_choice(ros):
    client = Client(Choice())
    owner = client.owner
    client.publish(GOAL)
    assert owner.busy and owner.used == [] and client.state.object == "box"
    _, result = client.result(client.send([4.0, 0.0, 0.0], item="crate"))
    assert result.error_code == JobError.GOAL_OCCUPIED and owner.busy and owner.used == []
    answer = client.send(GOAL, item="crate")  # the same pose, but of another object
    assert client.spinner.until(lambda: owner.used == ["crate"], 15.0)
    assert client.spinner.until(lambda: client.state.object == "crate", 15.0)
    assert len(owner.taken) == 2 and client.state.job == 2
    client.publish(np.array([2.0, 0.0, 0.0]))  # on the topic, a goal is of the first object
    assert client.spinner.until(lambda: owner.used == ["crate", "box"], 15.0)
    assert client.result(answer)[1].error_code == JobError.PREEMPTED
    assert len(owner.taken) == 3 and client.spinner.until(
        lambda: client.state.object == "box" and client.state.job == 3, 15.0
    )
    client.spinner.close()


def test_a_plan_that_is_not_to_be_executed_is_refused_where_nobody_can_make_it(ros):
    client = Client(Owner(no_plan_only="it plans as it goes"))
    client.publish(GOAL)
    _, result = client.result(client.send([2.0, 0.0, 0.0], plan_only=True))
    assert result.error_code == JobError.INVALID_GOAL and result.error_msg == "it plans as it goes"
    assert client.spinner.until(lambda: client.state.refusals == 1, 15.0)
    assert client.owner.busy and len(client.owner.taken) == 1  # the job goes on
    client.spinner.close()


def test_how_a_job_that_was_not_taken_up_ended_is_told_until_the_next_one(ros):
    """The owner, which knows nothing of it, says that it waits, for example when the map comes."""
    file = new_memory()
    goal = bytes(serialize_message(pose_stamped_to_ros(GOAL, 0.0))).hex()
    JobMemory(file).write(KeptJob(("box", "epuck1"), 7, goal, (tuple(GOAL),)))
    client = Client(Owner(memory=JobMemory(file)))
    assert client.spinner.until(lambda: client.state.state_name == "PLANNING", 15.0)
    assert client.state.job == 7
    cancel = client.node.create_client(Trigger, "/red/cancel")
    assert client.spinner.until(cancel.service_is_ready, 15.0)
    called = cancel.call_async(Trigger.Request())
    assert client.spinner.until(called.done, 15.0) and called.result().success
    client.owner.intake.publish(2.0, state_name="IDLE", reason="waiting", error_code=0)
    assert client.spinner.until(lambda: client.state.header.stamp.sec == 2, 15.0)
    assert client.state.state_name == "IDLE" and client.state.reason == "canceled"
    assert client.state.error_code == JobError.CANCELED
    client.publish(GOAL)
    assert client.owner.busy and client.state.job == 8
    client.owner.end_job(JobError.NONE, "done")
    assert client.spinner.until(lambda: client.state.state_name == "IDLE", 15.0)
    assert client.state.error_code == JobError.NONE
    client.spinner.close()
    os.close(file)


def test_a_restarted_node_carries_out_a_plan_that_was_to_be_executed(planner, monkeypatch):
    """Else it would plan, and wait for a second ``/execute``."""
    kept = []
    monkeypatch.setattr(planner.owner.intake._keeper._memory, "write", kept.append)
    plan(planner)
    assert kept[-1].plan_only
    execute = planner.node.create_client(Trigger, "/red/execute")
    called = execute.call_async(Trigger.Request())
    assert planner.spinner.until(called.done, 15.0) and called.result().success
    assert not kept[-1].plan_only and kept[-1].job == 1
