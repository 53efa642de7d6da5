"""The rearranger with a supervisor that only listens, in lockstep: no wall time decides."""

from dataclasses import replace

import numpy as np
import pytest
import rclpy
from nav_msgs.msg import OccupancyGrid
from std_msgs.msg import Bool

from push_model.jobs import JobError
from push_msgs.action import MoveObject
from push_msgs.msg import JobState, Poses
from push_planner.rearranger_node import RearrangerNode
from push_ros.actions import GoalServer
from push_ros.conversions import grid_to_ros, poses_to_ros
from push_ros.process import Spinner
from push_ros.qos import COMMAND, LATCHED, STREAM
from push_scenario.scenario import scenario_from_mapping

GOALS = {"a": np.array([0.0, 0.3, 0.0]), "b": np.array([0.3, -0.3, 0.0])}


class Supervisor:
    """Takes moves, and makes none. heard: names of their objects, and "cancel"."""

    def __init__(self, heard):
        self.heard, self.node = heard, rclpy.create_node("supervisor")
        self._states = self.node.create_publisher(JobState, "/job_state", LATCHED)
        self._server = GoalServer(
            self.node,
            MoveObject,
            "/move_object",
            check=lambda request: None,
            start=self._start,
            cancel=lambda: heard.append("cancel"),
            preempt=lambda request: None,
        )
        self.tell(JobState(state=JobState.IDLE, object="a"))

    def _start(self, request):
        self.heard.append(request.object)
        self.tell(JobState(state=JobState.PUSHING, object=request.object, goal=request.goal))

    def tell(self, state):
        self._states.publish(state)

    def die(self):
        self._server._server.destroy()


class World:
    def __init__(self):
        self.scenario = scenario_from_mapping(
            {
                "environment": "open",
                "robots": {"epuck1": {"type": "epuck", "start": [-0.6, 0.0, 0.0]}},
                "objects": {
                    "a": {"type": "box9", "start": [-0.3, 0.3, 0.0]},
                    "b": {"type": "box9", "start": [0.0, -0.3, 0.0]},
                },
            },
            "two",
            "test",
        )
        self.rearranger = RearrangerNode(self.scenario)
        self.node, self.heard, self.states = rclpy.create_node("world"), [], []
        self.supervisor = Supervisor(self.heard)
        nodes = [self.rearranger, self.node, self.supervisor.node]
        self.spinner = Spinner(nodes)
        self.time = 1.0
        bodies = {**self.scenario.robots, **self.scenario.objects}
        self.bodies = {name: np.array(body[1]) for name, body in bodies.items()}
        self.poses = self.node.create_publisher(Poses, "/poses", STREAM)
        self.goals = self.node.create_publisher(Poses, "/goal_poses", COMMAND)
        self.node.create_subscription(JobState, "/rearrangement", self.states.append, LATCHED)
        self.node.create_publisher(Bool, "/lockstep", LATCHED).publish(Bool(data=True))
        grid = grid_to_ros(self.scenario.grid, 0.0)
        self.node.create_publisher(OccupancyGrid, "/map", LATCHED).publish(grid)
        publishers = self.poses, self.goals
        assert self.spinner.until(
            lambda: (
                self.rearranger.ready
                and all(p.get_subscription_count() for p in publishers)
                and self.rearranger._poses.clock.lockstep
                and bool(self.states)
            ),
            20.0,
        )
        self.until(lambda: False, 0.5)

    def until(self, condition, limit):
        """Whether it becomes true within a limit [s] of pose time."""
        end = self.time + limit
        while self.time < end and not condition():
            self.time += 0.1
            self.poses.publish(poses_to_ros(self.bodies, self.time))
            for _ in range(3):
                self.spinner.once(0.003)
        return condition()

    def send(self, goals=GOALS):
        self.goals.publish(poses_to_ros(goals, self.time))

    def moves(self, count, limit=300.0):
        return self.until(lambda: self.heard.count("a") + self.heard.count("b") >= count, limit)

    @property
    def state(self):
        return self.states[-1]

    def lose(self):
        self.supervisor.die()
        self.spinner.remove(self.supervisor.node)
        assert self.spinner.until(lambda: not self.rearranger._mover.ready, 20.0)

    def restart(self):
        self.supervisor = Supervisor(self.heard)
        self.spinner.add(self.supervisor.node)
        assert self.spinner.until(lambda: self.rearranger._mover.ready, 20.0)


@pytest.fixture
def world(ros):
    world = World()
    yield world
    world.spinner.close()


def test_a_supervisor_that_is_lost_during_a_move_ends_the_job(world):
    world.send()
    assert world.moves(1)
    world.lose()
    assert not world.until(lambda: not world.rearranger.busy, 8.0)
    assert world.until(lambda: not world.rearranger.busy, 8.0)
    world.spinner.until(lambda: world.state.state == JobState.IDLE, 5.0)
    assert world.state.error_code == JobError.NODE_LOST
    assert "the supervisor does not answer" in world.state.reason


def test_a_move_that_a_new_supervisor_does_not_know_is_planned_again(world):
    world.send()
    assert world.moves(1)
    world.lose()
    assert not world.until(lambda: not world.rearranger.busy, 5.0)
    world.restart()
    assert world.moves(2)
    assert world.rearranger.busy and world.state.replans == 1


def test_the_same_goals_again_change_nothing(world):
    world.send()
    assert world.moves(1)
    for job in (2, 3):
        world.send()
        assert world.until(lambda job=job: world.state.job == job, 5.0)
    assert not world.moves(2, 30.0) and len(world.heard) == 1
    assert world.state.state != JobState.IDLE and world.state.replans == 0
    world.send({"b": GOALS["b"]})
    assert world.moves(2) and "cancel" in world.heard


def test_an_object_that_is_too_heavy_is_refused_unless_it_is_at_its_goal(world):
    beliefs = world.rearranger._beliefs
    belief = beliefs.current
    heavy = replace(belief.objects["b"], mass=50.0)
    beliefs.current = replace(belief, objects={**belief.objects, "b": heavy})
    world.send()
    assert world.until(lambda: world.state.refusals == 1, 5.0)
    assert world.state.refusal_code == JobError.TOO_HEAVY and not world.rearranger.busy
    assert world.state.refusal.startswith("'b': too heavy: needs")
    world.send({"a": GOALS["a"], "b": world.bodies["b"]})
    assert world.moves(1) and world.heard == ["a"]
