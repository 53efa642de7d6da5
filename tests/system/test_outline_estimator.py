"""The estimator of the outline in the graph: radius only, wrong poses, and who may have it."""

import numpy as np
import pytest
from shapely import Polygon

from push_bringup.systems import estimated, nodes_of
from push_model.settings import SettingsError
from push_msgs.msg import Belief
from push_ros.qos import BELIEF
from push_scenario.bodies import load_object
from push_scenario.scenario import load_scenario, scenario_from_mapping
from push_study.graph_run import LockstepRun
from tests.samples import slice_and_study
from tests.system.test_one_robot_faults import tamper
from tests.system.test_swarm import VALUES
from tests.system.test_swarm_faults import error, pushing

TRUE = Polygon(load_object("swarm_square").outline)
RADIUS = float(np.hypot(*load_object("swarm_square").outline.T).max())
GOAL = np.array(VALUES["goal"])


def running(**values):
    """The square of the other tests of swarms, of which only the radius is told."""
    own = {"enabled": True, "radius": RADIUS, **values}
    bridge = VALUES["parameters"]["bridge"]
    changes = {"parameters": {"bridge": bridge, "outline_estimator": own}}
    scenario = scenario_from_mapping({**VALUES, **changes}, "test", "test")
    return LockstepRun(scenario, system="swarm", quiet=True)


def estimator(run):
    (node,) = (n for n in run.nodes if n.get_name() == "outline_estimator")
    return node


def mistake(outline):
    """Share of the area of the square that an outline has too much, and too little."""
    found = Polygon(outline)
    return found.difference(TRUE).area / TRUE.area, TRUE.difference(found).area / TRUE.area


def corners(message):
    (outline,) = message.outlines
    return np.column_stack([outline.x, outline.y])


@pytest.mark.long
def test_with_a_radius_only_a_pose_is_reached_and_the_outline_found():
    with running() as run:
        said = []
        run.observer.create_subscription(Belief, "/belief", said.append, BELIEF)
        run.start()
        state = run.reach(GOAL, 300.0)
        assert state is not None and state.error_code == 0, state and state.reason
        away, turned = error(run)
        assert away < 0.03 and turned < 0.06
        seconds, node = run.bridge.time, estimator(run)
        assert {m.source for m in said} == {"outline_estimator"}
        assert 5 < len(said) < seconds + 2
        assert np.hypot(*corners(said[0]).T) == pytest.approx(RADIUS)
        assert mistake(corners(said[0]))[0] > 0.5
        much, little = mistake(corners(said[-1]))
        assert much < 0.25 and little < 0.05, (much, little)
        assert node.learner.estimate.forgotten == 0
        assert run.supervisor.beliefs.current.outlines.keys() == {"box"}


@pytest.mark.parametrize("how", slice_and_study(["frozen", "moved", "swapped"], 2))
def test_wrong_poses_and_a_hand_do_not_spoil_the_outline(how):
    """FAULTS 34. For 3 s the pose of the object stays what it was; or it is that of a robot; or a
    hand moves the object. The goal is reached, and the outline holds."""
    with running() as run:
        run.start()
        run.teams[""].send_goal(GOAL)
        pushing(run)
        until, held = run.bridge.time + 3.0, {}

        def frozen(message):
            k = list(message.names).index("box")
            if not held:
                held.update(x=message.x[k], y=message.y[k], theta=message.theta[k])
            if run.bridge.time < until:
                message.x[k], message.y[k], message.theta[k] = held.values()
            return [message]

        def swapped(message):
            k, j = (list(message.names).index(n) for n in ("box", "e3"))
            if run.bridge.time < until:
                for column in (message.x, message.y, message.theta):
                    column[k], column[j] = column[j], column[k]
            return [message]

        if how == "moved":
            pose = run.observer.trace.object[-1] + [0.05, 0.1, 0.3]
            run.bridge.world.place("box", pose)
        else:
            tamper(run, {"frozen": frozen, "swapped": swapped}[how])
        assert run.spin_until(lambda: run.teams[""].ended, 300.0)
        assert run.observer.state.error_code == 0, run.observer.state.reason
        assert error(run)[0] < 0.03
        much, little = mistake(estimator(run).learner.estimate.outline)
        assert little < 0.1 and much < 0.6, (much, little)


def test_it_is_part_of_a_system_of_several_robots_where_the_scenario_asks_for_it():
    scenario = load_scenario("swarm-square")
    plain = [n.kind for n in nodes_of("swarm", scenario)]
    asked = estimated("swarm", scenario)
    assert [n.kind for n in nodes_of("swarm", asked)] == [*plain, "outline_estimator"]
    single = estimated("single", load_scenario("short"))
    assert [n.kind for n in nodes_of("single", single)][-1] == "estimator"


def test_who_cannot_have_one_is_told():
    with pytest.raises(SettingsError, match="no estimator for scenario 'wheel-slip'"):
        estimated("torque", load_scenario("wheel-slip"))
    flat = load_scenario("short").settings("outline_estimator", enabled=True)
    with pytest.raises(SettingsError, match="without a ring bumper"):
        nodes_of("one-robot", flat)


def test_the_first_outline_is_that_of_the_file_where_no_radius_is_given():
    """And nothing is said before anything was learned."""
    with running(radius=0.0) as run:
        said = []
        run.observer.create_subscription(Belief, "/belief", said.append, BELIEF)
        run.start()
        run.spin_until(lambda: False, 2.0)
        assert sum(mistake(estimator(run).learner.estimate.outline)) < 1e-9
        assert not said
