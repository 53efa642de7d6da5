"""Done-when 3, in lockstep: the single-robot system twice side by side in one graph."""

from dataclasses import replace

import numpy as np
import pytest

from push_bringup.suite import scenario_goals
from push_bringup.systems import nodes_of
from push_model.settings import SettingsError
from push_scenario.scenario import load_scenario
from push_study.graph_run import LockstepRun
from push_study.observer import final_errors


@pytest.mark.long
@pytest.mark.parametrize("namespace", ["", "lab/a"])
def test_two_teams_reach_their_goals_and_touch_nobody_else(namespace):
    scenario = load_scenario("two-singles")
    with LockstepRun(scenario, quiet=True, namespace=namespace) as run:
        run.start()
        results = run.reach_all()
        own = {n.namespace for n in nodes_of("single", scenario, namespace)}
        names = {t for t, _ in run.supervisor.get_topic_names_and_types()}
        assert run.bridge.unanswered == 0
        for name, team in run.teams.items():
            trace = team.observer.trace
            assert results[name].success, results[name]
            position, orientation = final_errors(trace, scenario.team(name).goal)
            assert position < 2e-3 and orientation < 1e-2
            # contacts of its robot or box with anything but each other
            assert trace.collisions == 0 and trace.contact_losses == 0 and trace.pushes == 1
        world = f"/{namespace}/" if namespace else "/"
    ours = {t for t in names if t not in ("/rosout", "/parameter_events")}
    assert ours and all(t.startswith(world) for t in ours)
    assert {f"{world}south/goal_pose", f"{world}north/goal_pose", f"{world}epuck2/cmd_vel"} <= ours
    assert f"{world}goal_pose" not in ours and len(own) == 5


def in_a_row(*goals):
    """The scenario "short" in the planar world, with several goals."""
    scenario = load_scenario("short").settings("bridge", world="planar")
    return replace(scenario, goals=tuple(np.array(goal) for goal in goals))


def test_all_goals_of_a_scenario_are_reached_one_after_another():
    goals = (0.0, 0.02, 0.0), (0.3, -0.02, -0.1)
    with LockstepRun(in_a_row(*goals), quiet=True) as run:
        run.start()
        (result,) = run.reach_all().values()
        assert result.success and result.goal == goals[1] and result.position_error < 4e-3
        assert run.observer.state.job == 2
        seen = np.array(run.observer.trace.object)
    assert np.hypot(*(seen[:, :2] - goals[0][:2]).T).min() < 4e-3
    assert result.duration < 0.7 * len(seen) * 0.01  # of the second job alone


def test_a_goal_that_is_not_reached_ends_the_row():
    with LockstepRun(in_a_row((50.0, 0.0, 0.0), (0.0, 0.02, 0.0)), quiet=True) as run:
        run.start()
        (result,) = run.reach_all().values()
        assert result.refused and result.goal == (50.0, 0.0, 0.0)
        assert run.observer.state.job == 0 and run.observer.state.refusals == 1


def test_a_scenario_with_a_trajectory_says_how_to_send_it():
    with pytest.raises(SettingsError, match=r"a trajectory and no goal; .* push_along"):
        scenario_goals(load_scenario("group-trajectory"))


@pytest.mark.long
def test_a_goal_for_one_team_moves_nobody_of_the_other():
    scenario = load_scenario("two-singles")
    with LockstepRun(scenario, quiet=True) as run:
        run.start()
        goal = tuple(float(v) for v in scenario.team("north").goal)
        (result,) = run.reach_all({"north": goal}).values()
        south = run.teams["south"]
        assert result.success
        assert south.observer.state.job == 0 and south.observer.trace.pushes == 0
        for name, way in (("epuck1", south.observer.trace.robot), ("box1", None)):
            seen = south.observer.trace.object if way is None else way
            start = (scenario.robots | scenario.objects)[name][1]
            assert np.abs(np.array(seen) - start).max() < 1e-3
        refused = run.reach_all({"south": (50.0, 0.0, 0.0)})["south"]
        assert refused.refused and not refused.success
