"""The planner as the supervisor sees it: what it answers, and what is made of it."""

import numpy as np
import pytest
import rclpy

from push_model.jobs import JobError
from push_msgs.action import PlanPush
from push_msgs.msg import PushPlan
from push_ros.actions import GoalServer
from push_ros.names import Names
from push_ros.process import Spinner
from push_supervisor.events import PlanFailed
from push_supervisor.peers import Peers
from push_supervisor.requests import Peer


@pytest.mark.parametrize("improving", [False, True])
def test_a_plan_without_pushes_is_no_plan(ros, improving):
    """As the result of planning, and while the planner goes on."""
    me, planner, answers = rclpy.create_node("me"), rclpy.create_node("planner"), []

    def plan(request):
        if improving:
            server.feedback(PlanPush.Feedback(plan=[PushPlan()]))
        else:
            server.finish(PlanPush.Result(), success=True)

    server = GoalServer(
        planner,
        PlanPush,
        "/plan_push",
        check=lambda request: None,
        start=plan,
        cancel=lambda: None,
        preempt=lambda request: None,
    )
    answered = lambda number, event: answers.append((number, event))  # noqa: E731
    peers = Peers(me, Names("/", "/"), "robot", "box", answered, lambda number: None)
    spinner = Spinner([me, planner])
    assert spinner.until(lambda: peers.ready(Peer.PLANNER), 15.0)
    pose = np.zeros(3)
    peers.plan(7, pose, pose + 0.3, 1.0, False, np.zeros((0, 3)), pose - 0.3)
    assert spinner.until(lambda: bool(answers), 15.0)
    number, event = answers[0]
    assert number == 7 and isinstance(event, PlanFailed)
    assert event.code is JobError.PLANNING_FAILED and "without pushes" in event.message
    spinner.close()
