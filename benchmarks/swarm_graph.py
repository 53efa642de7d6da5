"""Time of a tick of a pushing swarm in the whole graph, in lockstep.

Twenty e-pucks in both worlds, and a thousand discs. Thread CPU time, separately for the job and for
the graph around it.
"""

import time
from typing import Any

import numpy as np

from benchmarks.lockstep import timed
from benchmarks.measure import at_most
from push_ros.claims import claim_domain
from push_ros.process import prepare_environment
from push_scenario.scenario import Scenario, load_scenario, scenario_from_mapping
from push_study.graph_run import LockstepRun

_PARTS = 5


def wheels(world: str) -> Scenario:
    """Twenty e-pucks around the square."""
    values = {
        "environment": {"size": [4.0, 4.0]},
        "robots": {
            "e": {
                "type": "epuck_ring",
                "count": 20,
                "placement": {"random": {"seed": 3, "gap": 0.03, "area": [-1.8, -1.6, -0.9, 1.6]}},
            }
        },
        "objects": {"square": {"type": "swarm_square", "start": [-0.4, 0.0, 0.0]}},
        "goal": [1.4, 0.0, 0.0],
        "parameters": {"bridge": {"world": world}},
    }
    return scenario_from_mapping(values, f"wheels-{world}", "benchmark")


def discs() -> Scenario:
    """A thousand discs at random around the square."""
    scenario = load_scenario("discs1000")
    return scenario.settings("bridge", world="planar")


def budget(scenario: Scenario, goal: Any, ticks: int) -> dict[str, float]:
    """[ms] per tick: world, job, rest of the swarm node, and rest of the graph."""
    with LockstepRun(scenario, system="swarm", quiet=True) as run:
        run.start()
        run.teams[""].send_goal(np.array(goal))
        run.spin_until(lambda: run.observer.state.state_name == "PUSHING", 60.0)
        run.observer.look_away()  # a measuring instrument, not a part of the graph
        spent = {name: [0.0] for name in ("world", "job", "node")}
        world: Any = run.bridge.world
        for name in ("step", "poses", "command_all"):
            setattr(world, name, timed(getattr(world, name), spent["world"]))
        node: Any = run.controller
        job = node.method.job
        job.step = timed(job.step, spent["job"])
        node._poses.take = timed(node._poses.take, spent["node"])
        parts = []
        for _ in range(_PARTS):
            for clock in spent.values():
                clock[0] = 0.0
            begin, started = run.bridge.tick, time.thread_time()
            until = begin + ticks // _PARTS
            run.spinner.until(lambda until=until: run.bridge.tick >= until, 300.0)  # type: ignore
            done = run.bridge.tick - begin
            total = time.thread_time() - started
            physics, job, whole = (spent[k][0] for k in ("world", "job", "node"))
            parts.append(np.array([physics, job, whole - job, total - physics - whole]) / done)
        if not node.busy:
            raise RuntimeError("the job ended before the measurement did")
        if run.bridge.unanswered:
            raise RuntimeError("a tick was not answered")
    table = 1e3 * np.median(parts, axis=0)
    return dict(zip(("world", "job", "node", "rest"), map(float, table), strict=True))


def run() -> dict[str, Any]:
    """The tables, and the time of the graph itself."""
    prepare_environment()
    claim_domain()
    results, bounds = {}, {}
    for name, scenario, goal, ticks in (
        ("20 e-pucks, pybullet", wheels("pybullet"), (1.4, 0.0, 0.0), 300),
        ("20 e-pucks, planar", wheels("planar"), (1.4, 0.0, 0.0), 300),
        ("1000 discs, planar", discs(), (4.0, 0.0, 0.0), 50),
    ):
        found = results[name] = budget(scenario, goal, ticks)
        told = ", ".join(f"{part} {value:.3f}" for part, value in found.items())
        print(f"  {name}: {told} ms a tick", flush=True)
        if name.startswith("20"):
            own = found["node"] + found["rest"]
            bounds[f"graph with {name} [ms a tick]"] = at_most(own, 2.0)
        else:
            held = found["job"] + found["node"]
            bounds[f"node with {name} [ms a tick]"] = at_most(held, 50.0)
    return {"costs_ms": results, "bounds": bounds}
