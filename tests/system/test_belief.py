"""``/belief``, published in mid-job, changes what every system does at its next step."""

from dataclasses import replace

import numpy as np
import pytest

from grasp_opt.grasp_certificate import GraspCertificate
from push_model.belief import Interval
from push_model.stick_certificate import ContactBelief
from push_msgs.msg import Belief, JobState, Report
from push_ros.qos import BELIEF, STATUS
from push_ros.report_conversions import belief_to_ros, report_from_ros
from push_scenario.scenario import load_scenario, scenario_from_mapping
from push_study.graph_run import LockstepRun


def tell(run, values, source="person"):
    """Publish a belief and let the nodes hear it."""
    if not hasattr(run, "said"):
        run.said = run.observer.create_publisher(Belief, "/belief", BELIEF)
        run.spin_until(lambda: run.said.get_subscription_count() > 0, 5.0)
    run.said.publish(belief_to_ros(source, {k: Interval(*v) for k, v in values.items()}))
    begin = run.bridge.time
    run.spin_until(lambda: run.bridge.time > begin + 0.05, 1.0)


def pushing(run, goal, limit=120.0):
    run.teams[""].send_goal(np.array(goal))
    assert run.spin_until(lambda: run.observer.state.state == JobState.PUSHING, limit)
    begin = run.bridge.time
    run.spin_until(lambda: run.bridge.time > begin + 0.5, 2.0)


@pytest.fixture
def single():
    scenario = load_scenario("short")
    with LockstepRun(scenario, quiet=True) as run:
        run.start()
        yield run


@pytest.mark.long
def test_planner_and_controller_take_up_a_friction(single):
    """Half the friction: half the stable curvature, of the push under way and of the next plan."""
    item = next(iter(single.scenario.objects))
    friction = single.scenario.objects[item][0].contact_friction
    pushing(single, single.scenario.goal)
    before = single.controller.tracker.push.limits
    planned = single.planner._planner("", item).scene.sides[0].nominal
    half = friction / 2.0
    tell(single, {(item, "contact_friction"): (half, 0.9 * half, 1.1 * half)})
    after = single.controller.tracker.push.limits
    assert after.maximum == pytest.approx(0.5 * before.maximum, rel=0.05)
    again = single.planner._planner("", item).scene.sides[0].nominal
    assert again.maximum == pytest.approx(0.5 * planned.maximum, rel=0.05)
    tell(single, {("", "latency"): (0.02, 0.01, 0.03)}, source="clockmaker")
    assert single.controller.tracker._reckoning.delay == 0.02
    assert single.controller.tracker.push.limits == after, "what another source said stays"


@pytest.mark.long
def test_a_push_that_is_expected_to_slip_ends_and_is_planned_anew():
    """A friction that lets the planned bend slip arrives while the robot is still on its way."""
    scenario = load_scenario("line").settings("bridge", world="planar")
    scenario = scenario.settings("planner", easing=0.0)  # with tight bends
    start = scenario.objects["box"][1]
    with LockstepRun(scenario, quiet=True) as run:
        run.start()
        job, seen = run.teams[""], []
        job.send_goal(start + np.array([1.5, 0.5, 0.5]))
        run.spin_until(lambda: run.observer.state.state == JobState.PUSHING, 60.0)
        before = run.planner._planner("", "box").scene.sides[0].trusted
        tell(run, {("box", "contact_friction"): (0.1, 0.09, 0.11)})

        def ended():
            seen.append(run.observer.state.reason)
            return job.ended

        assert run.spin_until(ended, 120.0)
        state = run.observer.state
        assert any("may slip in" in reason for reason in seen)
        assert state.error_code == 0 and state.replans == 1
        after = run.planner._planner("", "box").scene.sides[0].trusted
        assert after.maximum < 0.7 * before.maximum


def test_what_cannot_be_believed_is_refused_and_changes_nothing(single):
    item = next(iter(single.scenario.objects))
    tell(single, {(item, "contact_friction"): (0.3, 0.2, 0.4)})
    before = single.planner._beliefs.current
    message = belief_to_ros("person", {(item, "contact_friction"): Interval.exact(0.3)})
    for field, value in (
        ("values", [float("nan")]),
        ("lows", [0.9]),
        ("highs", [9.0]),
        ("quantities", ["charm"]),
        ("bodies", ["nobody"]),
        ("source", ""),
    ):
        broken = belief_to_ros("person", {(item, "contact_friction"): Interval.exact(0.3)})
        setattr(broken, field, value)
        single.said.publish(broken)
    begin = single.bridge.time
    single.spin_until(lambda: single.bridge.time > begin + 0.05, 1.0)
    assert single.planner._beliefs.current == before
    assert single.planner._diagnostics.refused["/belief"] == 6
    assert message.source == "person"


def group_scenario(two=False):
    values = {
        "environment": "open",
        "robots": {
            f"e{i}": {"type": "epuck_ring", "start": [-0.9, y, 0.0]}
            for i, y in enumerate((-0.2, 0.2) if two else (-0.4, 0.0, 0.4))
        },
        "objects": {"plate": {"type": "plate_ellipse", "start": [0.0, 0.0, 0.0]}},
        "parameters": {"bridge": {"world": "planar"}},
    }
    return scenario_from_mapping(values, "group", "test")


@pytest.mark.long
def test_a_group_is_placed_by_the_certified_margin_and_tells_it():
    scenario = group_scenario()
    mu = scenario.objects["plate"][0].contact_friction
    with LockstepRun(scenario, quiet=True, system="group") as run:
        run.start()
        told = []
        run.observer.create_subscription(Report, "/report", told.append, STATUS)
        tell(run, {("plate", "contact_friction"): (mu, 0.7 * mu, 1.2 * mu)})
        pushing(run, (0.5, 0.3, 0.4))
        method = run.supervisor.method
        assert run.spin_until(lambda: method.job.last is not None, 5.0)
        twists, contacts = (
            method.job.plan.trajectory.body_twists,
            method.job.plan.placement.contacts,
        )
        believed = ContactBelief(Interval(mu, 0.7 * mu, 1.2 * mu), *[Interval.exact(0.0)] * 2)
        item = scenario.objects["plate"][0]
        sure = GraspCertificate(item, believed, twists).margin(contacts)
        begin = run.bridge.time
        run.spin_until(lambda: run.bridge.time > begin + 0.5, 2.0)
        last = report_from_ros(told[-1])
        assert 0.0 <= sure == pytest.approx(last.figure("certified margin"))
        assert sure < last.figure("grasp margin")
        tell(run, {("plate", "contact_friction"): (mu, 0.3 * mu, 1.2 * mu)})
        begin = run.bridge.time
        run.spin_until(lambda: run.bridge.time > begin + 0.5, 2.0)
        assert report_from_ros(told[-1]).figure("certified margin") < sure


@pytest.mark.long
def test_a_group_ends_a_push_that_may_slip_and_plans_anew():
    """A friction arrives in mid-push that the contacts do not hold the object with."""
    scenario = group_scenario(two=True)
    with LockstepRun(scenario, quiet=True, system="group") as run:
        run.start()
        seen = []
        pushing(run, (0.5, 0.2, 0.6))
        job = run.supervisor.method.job
        before = job.watch.nominal
        assert before > 0.0 and job.slip_in == np.inf
        tell(run, {("plate", "contact_friction"): (0.02, 0.015, 0.025)})

        def ended():
            seen.append(run.observer.state.reason)
            return run.teams[""].ended

        assert run.spin_until(ended, 300.0)
        why = [r for r in dict.fromkeys(seen) if "may not hold the object" in r]
        assert len(why) == 1 and "for what is believed now" in why[0], dict.fromkeys(seen)
        assert job.replans >= 1


def test_a_group_that_is_not_to_stop_before_a_slip_only_tells_it():
    scenario = group_scenario(two=True).settings("group", push__stop_before_slip=False)
    with LockstepRun(scenario, quiet=True, system="group") as run:
        run.start()
        told = []
        run.observer.create_subscription(Report, "/report", told.append, STATUS)
        pushing(run, (0.5, 0.2, 0.6))
        tell(run, {("plate", "contact_friction"): (0.02, 0.015, 0.025)})
        begin = run.bridge.time
        run.spin_until(lambda: run.bridge.time > begin + 0.5, 2.0)
        assert report_from_ros(told[-1]).figure("slip expected in") >= 0.0
        assert run.observer.state.state == JobState.PUSHING


@pytest.mark.long
@pytest.mark.parametrize("when", [JobState.PLANNING, JobState.POSITIONING, JobState.PUSHING])
def test_a_group_brings_the_object_to_its_goal_when_its_centre_of_mass_is_told_late(when):
    """The goal is one of the object's frame, wherever the centre of mass is believed to be."""
    reach_with_late_centre("group", group_scenario(), "plate", (0.7, 0.3, 0.8), when, 5e-3)


@pytest.mark.long
def test_a_swarm_brings_the_object_to_its_goal_when_its_centre_of_mass_is_told_late():
    scenario = load_scenario("swarm-square").settings("bridge", world="planar")
    scenario = scenario.settings("swarm", position_tolerance=0.008)
    (name,) = scenario.objects
    reach_with_late_centre("swarm", scenario, name, (0.6, 0.2, 0.5), JobState.PUSHING, 0.01)


def reach_with_late_centre(system, scenario, name, goal, when, most):
    spec, start = scenario.objects[name]
    com = (0.02, -0.016)
    world = replace(scenario, objects={name: (replace(spec, com=com), start)})
    with LockstepRun(scenario, world=world, quiet=True, system=system) as run:
        run.start()
        run.teams[""].send_goal(np.array(goal))
        assert run.spin_until(lambda: run.observer.state.state == when, 60.0)
        tell(
            run,
            {(name, f"com_{a}"): (c, c - 1e-3, c + 1e-3) for a, c in zip("xy", com, strict=True)},
        )
        assert run.spin_until(lambda: run.teams[""].ended, 300.0)
        state, trace = run.observer.state, run.teams[""].observer.trace
        assert state.error_code == 0, state.reason
        off = trace.object[-1] - goal
        assert np.hypot(*off[:2]) < most, 1e3 * off[:2]


@pytest.mark.long
def test_a_group_pushes_on_with_the_friction_that_it_is_told():
    scenario = group_scenario().settings("group", push__stop_before_slip=False)
    with LockstepRun(scenario, quiet=True, system="group") as run:
        run.start()
        pushing(run, (0.5, 0.3, 0.4))
        job = run.supervisor.method.job
        assert run.spin_until(lambda: job.last is not None, 5.0)  # its first tick
        before = job.last.command
        tell(run, {("plate", "contact_friction"): (0.05, 0.04, 0.06)})
        controller = job._step.push.controller
        assert controller.friction == 0.05 and run.planner._item.contact_friction == 0.05
        assert run.planner._believed.friction == Interval(0.05, 0.04, 0.06)
        after = job.last.command
        inward = (after.forces * after.contacts.normals).sum(axis=1)
        normals = after.contacts.normals
        along = np.abs(normals[:, 0] * after.forces[:, 1] - normals[:, 1] * after.forces[:, 0])
        assert (along <= 0.05 * inward + 1e-9).all(), "forces lie in the narrower cones"
        assert before.lacking <= after.lacking + 1e-9
        tell(run, {("plate", "floor_friction"): (1.2, 1.0, 1.4)})
        heavy = job._step.push.controller.surface.max_force
        spec = scenario.objects["plate"][0]
        assert heavy == pytest.approx(1.2 / spec.floor_friction * spec.limit_surface().max_force)
        assert controller.friction == 0.05, "what it said of contact is replaced"
        assert job._step.push.controller.friction == spec.contact_friction


def test_a_swarm_makes_its_law_anew_for_what_it_is_told():
    scenario = load_scenario("swarm-square").settings("bridge", world="planar")
    with LockstepRun(scenario, quiet=True, system="swarm") as run:
        run.start()
        pushing(run, (0.6, 0.2, 0.5))
        job, name = run.supervisor.method.job, run.supervisor.object
        tell(run, {(name, "contact_friction"): (0.6, 0.5, 0.7)})
        assert job._law._item.contact_friction == 0.6
        assert job.busy, "the job goes on"
        outline = 1.1 * scenario.objects[name][0].outline
        message = belief_to_ros("person", {}, {name: outline})
        run.said.publish(message)
        begin = run.bridge.time
        run.spin_until(lambda: run.bridge.time > begin + 0.05, 1.0)
        assert job._law._item.outline == pytest.approx(outline, abs=1e-9)
        reach = float(np.hypot(*outline.T).max())
        assert job._lever == pytest.approx(reach, rel=1e-6) and job.busy
