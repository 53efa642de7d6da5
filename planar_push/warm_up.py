"""Compile the numerical kernels, so that no later run waits for it."""

import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """It has none."""


def run(arguments: argparse.Namespace) -> int:
    """Use each kernel once."""
    import numpy as np

    from grasp_opt.indices import composed_quality, extension, modified_hausdorff
    from grasp_opt.object_trajectory import sinusoid
    from grasp_opt.placement import Placer
    from push_mpc import LtvMpc, MpcSettings, TrackerSettings, TrajectoryTracker
    from push_planner import PlannerSettings, PushPlanner
    from push_scenario.bodies import load_object, load_robot
    from push_scenario.scenario import load_scenario
    from sim_bridge.planar_world import PlanarWorld
    from swarm_push.swarm_job import SwarmJob

    print("compiling the numerical kernels")
    scenario = load_scenario("env1-target1")
    _, robot = scenario.robot()
    _, item = scenario.object()
    TrajectoryTracker(TrackerSettings(), LtvMpc(MpcSettings(), robot.differential)).warm_up()
    start = next(iter(scenario.objects.values()))[1]
    goal = scenario.goal if scenario.goal is not None else np.zeros(3)
    PushPlanner(PlannerSettings(), scenario.grid, robot, item).solve(start, goal)
    with PlanarWorld(scenario.environment, scenario.robots, scenario.objects) as world:
        world.step(2)
    placer = Placer(load_object("plate_ellipse"), sinusoid(0.0, 1.0, 0.5, 0.1, 0.1), 2, 0.05)
    contacts = placer.placement(placer.grid(24)[0]).contacts
    composed_quality(contacts.points, contacts.normals)
    extension(contacts.points)
    modified_hausdorff(np.ones((1, 3, 3)), np.ones((1, 3)))
    room = np.array([[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [-2.0, 2.0]])
    SwarmJob(room, load_object("swarm_square"), load_robot("epuck_ring")).warm_up()
    return 0
