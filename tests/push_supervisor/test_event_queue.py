"""Events in a row, and an object that somebody moves on the robot's way to it."""

import numpy as np

from push_model.distance_field import DistanceField
from push_model.jobs import JobError
from push_planner import PlannerSettings, PushPlanner
from push_scenario.scenario import load_scenario
from push_supervisor import (
    Displacement,
    EventQueue,
    Machine,
    State,
    SupervisorSettings,
    commands,
    events,
)
from push_supervisor.arrival import Arrival


def short_plan():
    """The pushes of a plan, by which the robot's way begins."""
    scenario = load_scenario("short")
    ((_, (robot, _)),) = scenario.robots.items()
    ((_, (item, start)),) = scenario.objects.items()
    planner = PushPlanner(PlannerSettings(), DistanceField(scenario.grid), robot, item)
    return start, scenario.goal, planner.solve(start, scenario.goal).segments


def machine():
    return Machine(SupervisorSettings(), lambda goal: Arrival(False, False, "far"), lambda: False)


def test_what_a_command_fires_waits_for_the_commands_before_it():
    made, done, states = machine(), [], []

    def carry_out(command):
        done.append(type(command).__name__)
        if isinstance(command, commands.MakePlan):
            queue.fire(events.PlanFailed(JobError.PLANNING_FAILED, "no way"))
            assert made.state is State.PLANNING, "not yet"

    queue = EventQueue(made, carry_out, lambda: states.append(made.state))
    queue.fire(events.GoalGiven(np.zeros(3)))
    assert done == ["MakePlan", "Finish"] and states == [State.PLANNING, State.IDLE]
    queue.fire(events.MotionDone())
    assert states == [State.PLANNING, State.IDLE], "what means nothing changes nothing"


def test_an_object_is_moved_when_it_is_off_three_times_in_a_row_while_the_robot_is_on_its_way():
    start, goal, segments = short_plan()
    made = machine()
    watch, moved = Displacement(made), start + np.array([0.0, 0.05, 0.0])
    assert all(watch.look(moved) is None for _ in range(5)), "there is no job"
    made.handle(events.GoalGiven(goal))
    made.handle(events.PlanFound(segments))
    assert made.state is State.POSITIONING
    looks = [watch.look(p) for p in (moved, moved, start, moved, None, moved)]
    assert looks == [None] * 6
    found = watch.look(moved)
    assert isinstance(found, events.ObjectMoved) and "50 mm" in found.message
    assert watch.look(moved) is None, "told once, counted anew"
