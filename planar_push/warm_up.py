"""Compile the numerical kernels, so that no later run waits for it."""

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from push_job.method import MethodSpec
    from push_scenario.scenario import Scenario

_STEPS = 20  # of a method that is not simulated: it plans, and begins to move its robots


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """It has none."""


def run(arguments: argparse.Namespace) -> int:
    """Use each kernel once, as the nodes of every system do when they start and get a goal."""
    parts = {
        "one robot": _one_robot,
        "torque-driven robot": _torque,
        "placements of a group": _placements,
        "group and swarm": _methods,
        "environments for learning, and a point pusher": _batches,
    }
    for number, (name, compile_part) in enumerate(parts.items(), 1):
        print(f"compiling the numerical functions, {number} of {len(parts)}: {name}", flush=True)
        compile_part()
    return 0


def _one_robot() -> None:
    import numpy as np

    from push_model.corner_push import corner_push, touching
    from push_mpc import TrackerSettings, TrajectoryTracker
    from push_mpc.controllers import CONTROLLERS
    from push_planner import PlannerSettings, PushPlanner, warm_up
    from push_qp import BACKENDS
    from push_scenario.scenario import load_scenario
    from sim_bridge.planar_world import PlanarWorld

    scenario = load_scenario("env1-target1")
    _, robot = scenario.robot()
    _, item = scenario.object()
    for kind in CONTROLLERS.values():
        for solver in BACKENDS:
            mpc = kind.make(kind.settings(backend=solver), robot.differential)
            TrajectoryTracker(TrackerSettings(), mpc).warm_up()
    start = next(iter(scenario.objects.values()))[1]
    goal = scenario.goal if scenario.goal is not None else np.zeros(3)
    warm_up(PlannerSettings(), robot, item)
    PushPlanner(PlannerSettings(), scenario.grid, robot, item).solve(start, goal)
    corner = touching(item.outline, 0.4, 0.05, 0.0)
    corner_push(item.outline, corner, 0.05, 0.03, item.contact_friction, 0.05, 0.1)
    with PlanarWorld(scenario.environment, scenario.robots, scenario.objects) as world:
        world.step(2)


def _torque() -> None:
    from push_mpc.wheel_slip_nmpc import WheelSlipNmpc, WheelSlipSettings
    from push_scenario.scenario import load_scenario

    _, robot = load_scenario("wheel-slip").robot()
    WheelSlipNmpc(WheelSlipSettings(), robot).warm_up()


def _placements() -> None:
    import numpy as np

    from grasp_opt.indices import composed_quality, extension, modified_hausdorff
    from grasp_opt.object_trajectory import sinusoid
    from grasp_opt.placement import Placer
    from grasp_opt.wrench_cone import margins
    from push_scenario.bodies import load_object

    placer = Placer(load_object("plate_ellipse"), sinusoid(0.0, 1.0, 0.5, 0.1, 0.1), 2, 0.05)
    contacts = placer.placement(placer.grid(24)[0]).contacts
    composed_quality(contacts.points, contacts.normals)
    extension(contacts.points)
    modified_hausdorff(np.ones((1, 3, 3)), np.ones((1, 3)))
    margins(np.ones((1, 3, 3)), np.ones((1, 3)))


def _methods() -> None:
    """The first steps of a group, of swarms in an open room and among walls, and of rivals."""
    from grasp_opt.group_method import GROUP
    from grasp_opt.warm_up import warm_up
    from push_scenario.scenario import load_scenario
    from push_study.rivals.gibbs import METHOD as GIBBS
    from push_study.rivals.occlusion import METHOD as OCCLUSION
    from swarm_push.own_sensing import METHOD as OWN_SENSING
    from swarm_push.swarm_method import SWARM

    group = load_scenario("group-ellipse")
    warm_up(group.object()[1], group.robot()[1])
    for method, name in ((GROUP, "group-ellipse"), (SWARM, "swarm-square"), (SWARM, "swarm-walls")):
        _begin(method, load_scenario(name))
    for name in ("own-sensing", "swarm-walls"):
        _begin(OWN_SENSING, load_scenario(name), turned=False)
    for rival in (GIBBS, OCCLUSION):
        _begin(rival, load_scenario("swarm-square"), turned=False)


def _batches() -> None:
    """A step of several planar worlds at once, and one of a disc that pushes."""
    import numpy as np

    from push_model.point_push import Disc, body, driven, gap, placed, push
    from push_model.specs import EnvironmentSpec
    from push_scenario.scenario import load_scenario
    from sim_bridge.planar.tables import grown, make_contacts
    from sim_bridge.planar_batch import PlanarBatch

    scenario = load_scenario("env1-target1")
    (_, robot), (_, item) = scenario.robot(), scenario.object()
    batch = PlanarBatch(2, EnvironmentSpec((1.0, 1.0)), [robot], [item])
    batch.command(np.ones((2, 1, 3)))
    batch.step(2)
    grown(make_contacts(4))
    box, disc = body(item.outline, 0.03), Disc(0.01, 100.0, 20.0, 0.01, 0.2, 1e-3)
    gap(0.1, 0.0, placed(box, np.zeros(3)), box.first, box.count)
    push(box, disc, np.zeros((1, 6)), np.full((1, 4), 0.05), np.zeros((1, 2)), 2)
    driven(disc, np.zeros(4), np.ones(2), 1)


def _begin(method: "MethodSpec", scenario: "Scenario", turned: bool = True) -> None:
    import numpy as np

    from push_job.method import Arena, Seen, Task
    from push_model.belief import Belief

    robots = {name: spec for name, (spec, _) in scenario.robots.items()}
    item, spec = scenario.object()
    belief = Belief({item: spec}, robots)
    places = {name: start for name, (_, start) in scenario.robots.items()}
    made = method.make(Arena(scenario.grid, robots, item, spec))
    goal = scenario.goal
    assert goal is not None
    task = Task((goal if turned else np.array([*goal[:2], np.nan]),))
    for k in range(_STEPS):
        seen = Seen(0.01 * k, scenario.objects[item][1], places)
        if k == 0:
            made.assess(task, belief, seen)
            made.begin(task, belief)
        made.step(seen, belief)
        made.report(seen)
