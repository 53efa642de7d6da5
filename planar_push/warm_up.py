"""Compile the numerical kernels, so that no run waits for it."""

import argparse


def add_words(parser: argparse.ArgumentParser) -> None:
    """It has none."""


def run(arguments: argparse.Namespace) -> int:
    """Use each kernel once."""
    import numpy as np

    from push_mpc import LtvMpc, MpcSettings, TrackerSettings, TrajectoryTracker
    from push_planner import PlannerSettings, PushPlanner
    from push_scenario.scenario import load_scenario

    print("compiling the numerical kernels")
    scenario = load_scenario("env1-target1")
    _, robot = scenario.robot()
    _, item = scenario.object()
    TrajectoryTracker(TrackerSettings(), LtvMpc(MpcSettings(), robot.differential)).warm_up()
    start = next(iter(scenario.objects.values()))[1]
    goal = scenario.goal if scenario.goal is not None else np.zeros(3)
    PushPlanner(PlannerSettings(), scenario.grid, robot, item).solve(start, goal)
    return 0
