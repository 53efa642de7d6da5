"""The whole graph in lockstep beside the bare physics at the same step settings."""

import time
from typing import Any

import numpy as np

from benchmarks.measure import at_least
from push_ros.process import claim_domain
from push_scenario.scenario import load_scenario
from push_study.graph_run import LockstepRun
from sim_bridge.pybullet_world import PyBulletWorld


def run(seconds: float = 20.0) -> dict[str, Any]:
    """Sim time over CPU time of this thread, both in the middle of a push."""
    claim_domain()
    scenario = load_scenario("env1-target1")
    factors: dict[str, list[float]] = {"graph": [], "bare": []}
    with LockstepRun(scenario, quiet=True) as graph:
        graph.start()
        graph.observer.send_goal(scenario.goal)
        graph.spin_until(lambda: graph.observer.state.state_name == "PUSHING", 60.0)
        graph.observer.look_away()  # an instrument, not a part of the graph
        robots, objects = scenario.robots, scenario.objects
        poses = graph.bridge.world.poses()
        with PyBulletWorld(
            scenario.environment,
            {n: (s, poses[n]) for n, (s, _) in robots.items()},
            {n: (s, poses[n]) for n, (s, _) in objects.items()},
        ) as bare:
            bare.command("epuck1", 0.07, 0.0)
            bare.step(500)
            for _ in range(4):  # in turn, so that a busy machine slows both
                for name in ("graph", "bare"):
                    started = time.thread_time()
                    if name == "graph":
                        begin = graph.bridge.time
                        end = begin + seconds / 4
                        graph.spin_until(lambda end=end: graph.bridge.time >= end, seconds)
                        done = graph.bridge.time - begin
                    else:
                        bare.step(round(250 * seconds), contacts=False)
                        done = 0.25 * seconds
                    factors[name].append(done / (time.thread_time() - started))
    graph_factor, bare_factor = (float(np.median(factors[n])) for n in ("graph", "bare"))
    ratio = graph_factor / bare_factor
    print(
        f"  whole graph {graph_factor:.2f} x real time, bare physics {bare_factor:.2f} x; "
        f"ratio {ratio:.2f}"
    )
    return {
        "graph": graph_factor,
        "bare": bare_factor,
        "bounds": {"graph over bare physics": at_least(ratio, 0.6)},
    }
