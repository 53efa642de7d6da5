"""Cost of the graph per tick in lockstep, beside the physics, at 1, 20, 200 and 1000 bodies.

The graph is the bridge and a commander that answers every frame with arrays, without any control
law. The physics is the time of the world itself in the same run. Thread CPU time.
"""

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import rclpy
from geometry_msgs.msg import TwistStamped
from rclpy.logging import LoggingSeverity, set_logger_level
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from benchmarks.measure import at_least, at_most
from push_msgs.msg import Poses, Velocities
from push_ros.claims import claim_domain
from push_ros.conversions import twist_to_ros
from push_ros.process import Spinner, prepare_environment
from push_ros.qos import COMMAND, STREAM
from push_scenario.scenario import Scenario, load_scenario, scenario_from_mapping
from push_study.graph_run import LockstepRun
from sim_bridge.node import BridgeNode
from sim_bridge.pybullet_world import PyBulletWorld

BOUNDS = {1: 0.7, 20: 1.0, 200: 2.0, 1000: 3.0}
"""[ms] bound of the graph's time per tick, by the number of robots; 200 is interpolated."""
_TICKS = {1: 1000, 20: 500, 200: 100, 1000: 30}


class Commander(Node):
    """Answers a frame with the same velocity for every robot in it."""

    def __init__(self, robots: list[str]) -> None:
        super().__init__("commander")
        self._one = len(robots) == 1
        kind = TwistStamped if self._one else Velocities
        topic = f"/{robots[0]}/cmd_vel" if self._one else "/cmd_vels"
        self._publisher = self.create_publisher(kind, topic, COMMAND)
        self.create_subscription(Poses, "/poses", self._on_poses, STREAM)

    def _on_poses(self, message: Poses) -> None:
        if self._one:
            self._publisher.publish(twist_to_ros(0.02, 0.0, message.header.stamp))
            return
        answer = Velocities(names=message.names)
        answer.header.stamp = message.header.stamp
        answer.header.frame_id = "base_link"
        answer.vx = [0.02] * len(message.names)
        self._publisher.publish(answer)


def crowd(count: int) -> Scenario:
    """One e-puck, twenty, or a number of discs, apart from each other."""
    columns = math.ceil(math.sqrt(count))
    side = 0.13 * columns + 1.0
    corner = [-side / 2.0 + 0.4, -side / 2.0 + 0.4]
    placement = {"kind": "grid", "corner": corner, "spacing": 0.13, "columns": columns}
    values = {
        "environment": {"size": [side, side], "resolution": 0.05},
        "robots": {
            "r": {
                "type": "epuck_ring" if count <= 20 else "disc",
                "count": count,
                "placement": placement,
            }
        },
        "parameters": {"bridge": {"lockstep": True, "physics": {"time_step": 0.005}}},
    }
    return scenario_from_mapping(values, f"crowd{count}", "benchmark")


def timed(function: Callable[..., Any], spent: list[float]) -> Callable[..., Any]:
    """The function, wrapped to sum its thread CPU time."""

    def wrapper(*arguments: Any, **keywords: Any) -> Any:
        started = time.thread_time()
        try:
            return function(*arguments, **keywords)
        finally:
            spent[0] += time.thread_time() - started

    return wrapper


def graph_cost(count: int) -> tuple[float, float]:
    """[ms] per tick of the graph and of the world."""
    scenario = crowd(count)
    bridge = BridgeNode(scenario, autostart=False)
    spinner = Spinner([bridge, Commander(list(scenario.robots))])
    try:
        if not spinner.until(lambda: bridge.heard_by(1) and len(bridge.commanded()) == count, 20.0):
            raise RuntimeError("the nodes did not find each other")
        end = time.monotonic() + 0.5
        spinner.until(lambda: time.monotonic() > end, 1.0)
        bridge.start()
        spinner.until(lambda: bridge.tick > 5, 60.0)
        spent = [0.0]
        world: Any = bridge.world
        for name in ("step", "poses", "command" if count == 1 else "command_all"):
            setattr(world, name, timed(getattr(world, name), spent))
        costs = []
        for _ in range(5):
            spent[0] = 0.0
            begin, started = bridge.tick, time.thread_time()
            until = begin + _TICKS[count] // 5
            spinner.until(lambda until=until: bridge.tick >= until, 120.0)  # type: ignore[misc]
            total, ticks = time.thread_time() - started, bridge.tick - begin
            costs.append(((total - spent[0]) / ticks, spent[0] / ticks))
        if bridge.unanswered:
            raise RuntimeError("a tick was not answered")
        graph, physics = np.median(costs, axis=0)
        return 1e3 * float(graph), 1e3 * float(physics)
    finally:
        spinner.close()


def whole_graph(seconds: float) -> tuple[float, float]:
    """Simulated over thread CPU time in the middle of a push: all nodes, and the bare physics."""
    scenario = load_scenario("env1-target1")
    factors: dict[str, list[float]] = {"graph": [], "bare": []}
    with LockstepRun(scenario, quiet=True) as graph:
        graph.start()
        assert scenario.goal is not None and graph.bridge.world is not None
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
            for _ in range(4):  # alternating, so that a busy machine slows both
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
    return float(np.median(factors["graph"])), float(np.median(factors["bare"]))


def run(seconds: float = 20.0) -> dict[str, Any]:
    """The table of costs, and the whole single-robot system against its bare physics."""
    prepare_environment()
    claim_domain()
    costs, bounds = {}, {}
    set_logger_level("", LoggingSeverity.WARN)
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        for count, bound in BOUNDS.items():
            graph, physics = costs[count] = graph_cost(count)
            print(
                f"  {count:4d} robots: graph {graph:.3f} ms a tick, world {physics:.3f} ms; "
                f"ratio {graph / physics:.3f}",
                flush=True,
            )
            bounds[f"graph at {count} [ms a tick]"] = at_most(graph, bound)
    finally:
        rclpy.try_shutdown()
    whole, bare = whole_graph(seconds)
    ratio = whole / bare
    print(f"  whole graph {whole:.2f} x real time, bare physics {bare:.2f} x; ratio {ratio:.2f}")
    bounds["graph over bare physics"] = at_least(ratio, 0.6)
    return {"costs_ms": costs, "graph": whole, "bare": bare, "bounds": bounds}
