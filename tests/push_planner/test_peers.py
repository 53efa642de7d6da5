"""The supervisor as the rearranger sees it: each move ends once, also when its answer is lost."""

import numpy as np
import rclpy

from push_model.jobs import JobError
from push_msgs.msg import JobState
from push_planner.peers import Mover
from push_ros.conversions import pose_stamped_to_ros
from push_ros.names import Names

GOAL = np.array([0.3, 0.2, 0.1])


def told(state, item="box", goal=GOAL, code=JobError.NONE):
    message = JobState(state=state, object=item, error_code=int(code), reason="because")
    message.goal = pose_stamped_to_ros(goal, 1.0)
    return message


def test_a_job_that_is_seen_to_end_ends_the_move_once(ros):
    node, ends = rclpy.create_node("mover"), []
    mover = Mover(node, Names("/", "/"), lambda code, why: ends.append((code, why)))
    mover._on_job(told(JobState.IDLE))  # nothing was asked for
    mover.move("box", GOAL, 1.0)
    mover._on_job(told(JobState.IDLE))  # of a job before
    mover._on_job(told(JobState.PUSHING, item="crate"))
    mover._on_job(told(JobState.IDLE, item="crate"))
    mover._on_job(told(JobState.PUSHING, goal=GOAL + 0.01))
    mover._on_job(told(JobState.IDLE, goal=GOAL + 0.01))
    assert ends == []
    mover._on_job(told(JobState.PUSHING))
    mover._on_job(told(JobState.IDLE, code=JobError.OFF_TARGET))
    mover._on_job(told(JobState.IDLE, code=JobError.OFF_TARGET))
    assert ends == [(JobError.OFF_TARGET, "because")]
    mover.move("box", GOAL, 2.0)
    mover._on_job(told(JobState.PUSHING))
    mover.forget()
    mover._on_job(told(JobState.IDLE))
    assert len(ends) == 1
    node.destroy_node()


def test_a_supervisor_without_any_job_has_forgotten_the_move(ros):
    """One that was seen at work, or that was gone, comes back and has no goal."""
    node, ends = rclpy.create_node("mover"), []
    mover = Mover(node, Names("/", "/"), lambda code, why: ends.append(code))
    restarted = JobState(state=JobState.IDLE, object="crate")
    mover.move("box", GOAL, 1.0)
    mover._on_job(restarted)  # it has not heard of the move yet
    assert ends == []
    mover._on_job(told(JobState.PUSHING))
    mover._on_job(restarted)
    assert ends == [JobError.JOB_FORGOTTEN]
    mover.move("box", GOAL, 2.0)
    mover.missed()
    mover._on_job(restarted)
    assert ends == [JobError.JOB_FORGOTTEN] * 2
    node.destroy_node()
