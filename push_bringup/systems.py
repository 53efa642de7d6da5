"""The systems: which nodes make one up, for whom, and where they live.

One list serves the launcher (a process a node), lockstep (all nodes in one process) and the tests.
A further system is a function that returns such a list, and a row in ``SYSTEMS``.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from rclpy.node import Node

from push_model.bumpers import RingBumper
from push_model.drives import HolonomicDrive, SpeedDrive, TorqueDrive
from push_model.settings import SettingsError
from push_ros.names import inside, space
from push_scenario.scenario import Scenario
from push_scenario.teams import Team

LIVE: dict[str, dict[str, Any]] = {"controller": {"tracker": {"deadline": 0.03}}}
"""Settings of live use, where the scenario is silent. A run in lockstep must not depend on the wall
clock: there a solve has no deadline [s]."""

LOCKSTEP: dict[str, dict[str, Any]] = {"bridge": {"lockstep_warning": 60.0}}
"""Settings of a run in lockstep, where the scenario is silent. All nodes are in one process, so a
late answer [s] means a busy machine."""

GROUP_MOST = 5
"""Robots of a group at most."""

OWNERS = ("supervisor", "group", "swarm")
"""Kinds of nodes that own jobs: one a team."""

CROWDS = ("group", "swarm")
"""Those of them that command all robots of their team themselves."""

MODULES = {
    "bridge": "sim_bridge.node",
    "planner": "push_planner.node",
    "controller": "push_mpc.node",
    "supervisor": "push_supervisor.node",
    "torque_controller": "push_mpc.torque_node",
    "group": "grasp_opt.node",
    "optimizer": "grasp_opt.optimizer_node",
    "swarm": "swarm_push.node",
    "swarm_agent": "swarm_push.agent_node",
    "recorder": "push_record.recorder",
}
"""Kind of a node to the module whose ``main`` runs it in a process of its own."""


@dataclass(frozen=True)
class NodeSpec:
    """A node of a system.

    name: what it is called in messages to people; unique in the system.
    kind: key of ``MODULES``. namespace: where it lives. world: namespace of the bridge.
    robot, robots, item, team: whom it serves; empty where it serves all.
    parameters: further ROS parameters. remaps: names to names, besides the namespace.
    """

    name: str
    kind: str
    namespace: str
    world: str
    robot: str = ""
    item: str = ""
    team: str = ""
    robots: tuple[str, ...] = ()
    parameters: Mapping[str, Any] = field(default_factory=dict)
    remaps: Mapping[str, str] = field(default_factory=dict)

    def words(self, scenario: str) -> list[str]:
        """Command line of its process; scenario: name or path of the file that it reads."""
        values: dict[str, Any] = {"scenario": scenario, **self.parameters}
        if self.kind in (*OWNERS, "planner", "optimizer", "swarm_agent", "recorder"):
            values["world"] = self.world
        if self.kind in ("controller", "supervisor", "torque_controller", "swarm_agent"):
            values["robot"] = self.robot
        if self.kind in (*CROWDS, "optimizer", "swarm_agent"):
            values["robots"] = list(self.robots)
        if self.kind in (*OWNERS, "optimizer", "swarm_agent"):
            values["object"] = self.item
        remaps = {"__ns": self.namespace, **self.remaps}
        words = ["--ros-args"]
        for name, to in remaps.items():
            words += ["-r", f"{name}:={to}"]
        for name, value in values.items():
            words += ["-p", f"{name}:={json.dumps(value)}"]
        return words

    def make(self, scenario: Scenario) -> Node:
        """The node in this process, e.g. for a run in lockstep; a bridge waits to be started."""
        return _MAKERS[self.kind](self, scenario)


def _bridge(spec: NodeSpec, scenario: Scenario) -> Node:
    from sim_bridge.node import BridgeNode

    return BridgeNode(scenario, autostart=False, namespace=spec.namespace)


def _planner(spec: NodeSpec, scenario: Scenario) -> Node:
    from push_planner.node import PlannerNode

    return PlannerNode(scenario, namespace=spec.namespace, world=spec.world)


def _controller(spec: NodeSpec, scenario: Scenario) -> Node:
    from push_mpc.node import ControllerNode

    return ControllerNode(scenario, spec.robot, namespace=spec.world)


def _supervisor(spec: NodeSpec, scenario: Scenario) -> Node:
    from push_supervisor.node import SupervisorNode

    return SupervisorNode(
        scenario, spec.robot, spec.item, namespace=spec.namespace, world=spec.world
    )


def _torque_controller(spec: NodeSpec, scenario: Scenario) -> Node:
    from push_mpc.torque_node import TorqueControllerNode

    return TorqueControllerNode(scenario, spec.robot, namespace=spec.world)


def _group(spec: NodeSpec, scenario: Scenario) -> Node:
    from grasp_opt.node import GroupNode

    return GroupNode(scenario, spec.robots, spec.item, spec.namespace, spec.world)


def _optimizer(spec: NodeSpec, scenario: Scenario) -> Node:
    from grasp_opt.optimizer_node import OptimizerNode

    return OptimizerNode(scenario, spec.robots, spec.item, spec.namespace, spec.world)


def _swarm(spec: NodeSpec, scenario: Scenario) -> Node:
    from swarm_push.node import SwarmNode

    return SwarmNode(scenario, spec.robots, spec.item, spec.namespace, spec.world)


def _swarm_agent(spec: NodeSpec, scenario: Scenario) -> Node:
    from swarm_push.agent_node import SwarmAgentNode

    return SwarmAgentNode(scenario, spec.robot, spec.robots, spec.item, spec.namespace, spec.world)


_MAKERS: dict[str, Callable[[NodeSpec, Scenario], Node]] = {
    "bridge": _bridge,
    "planner": _planner,
    "controller": _controller,
    "supervisor": _supervisor,
    "torque_controller": _torque_controller,
    "group": _group,
    "optimizer": _optimizer,
    "swarm": _swarm,
    "swarm_agent": _swarm_agent,
}


def teams_of(scenario: Scenario) -> tuple[Team, ...]:
    """The teams of a scenario; the unnamed one where it names none."""
    return tuple(scenario.teams.values()) or (scenario.team(),)


def team_space(namespace: str, team: str) -> str:
    """Namespace of a team; that of the world for the unnamed one."""
    return inside(namespace, team) if team else _absolute(namespace)


def _absolute(namespace: str) -> str:
    return space(namespace).rstrip("/") or "/"


def single(scenario: Scenario, namespace: str = "") -> tuple[NodeSpec, ...]:
    """One robot that pushes one object, for each team; all in one world.

    A robot or object of no team stands in the way of the others.

    Raises
    ------
    SettingsError: a team has not one robot, or no object.
    """
    world = _absolute(namespace)
    nodes = [NodeSpec("bridge", "bridge", world, world)]
    for team in teams_of(scenario):
        if len(team.robots) != 1:
            whose = f"team '{team.name}'" if team.name else "its only team"
            raise SettingsError(
                f"scenario '{scenario.name}': {whose} has {len(team.robots)} robots, the system "
                "'single' takes one a team; say under 'teams' who moves what"
            )
        if not team.object:
            raise SettingsError(f"scenario '{scenario.name}' has no object to push")
        robot, item, place = team.robots[0], team.object, team_space(namespace, team.name)
        prefix = f"{team.name}/" if team.name else ""
        own = inside(namespace, robot)
        nodes += [
            NodeSpec(f"{prefix}controller", "controller", own, world, robot, item, team.name),
            NodeSpec(f"{prefix}planner", "planner", place, world, robot, item, team.name),
            NodeSpec(f"{prefix}supervisor", "supervisor", place, world, robot, item, team.name),
        ]
    return tuple(nodes)


def torque(scenario: Scenario, namespace: str = "") -> tuple[NodeSpec, ...]:
    """A controller for each robot that is driven by wheel torques: it follows trajectories.

    Raises
    ------
    SettingsError: there is no such robot.
    """
    world = _absolute(namespace)
    driven = [n for n, (r, _) in scenario.robots.items() if isinstance(r.drive, TorqueDrive)]
    if not driven:
        raise SettingsError(
            f"scenario '{scenario.name}': none of its robots is driven by wheel torques"
        )
    return (
        NodeSpec("bridge", "bridge", world, world),
        *(
            NodeSpec(f"{n}/controller", "torque_controller", inside(namespace, n), world, n)
            for n in driven
        ),
    )


def _check_crowd(scenario: Scenario, team: Team, system: str) -> str:
    """Who the team is, in words. Raise SettingsError unless it has an object, and round robots of
    one type with wheels of controlled speed, or in a swarm such that go in any direction."""
    whose = f"scenario '{scenario.name}': " + (f"team '{team.name}'" if team.name else "it")
    if not team.robots:
        raise SettingsError(f"{whose} has no robots")
    if not team.object:
        raise SettingsError(f"{whose} has no object to push")
    types = [scenario.robots[name][0] for name in team.robots]
    if any(t != types[0] for t in types):
        raise SettingsError(f"{whose} has robots of several types, a {system} is of one type")
    drives = (SpeedDrive, HolonomicDrive) if system == "swarm" else (SpeedDrive,)
    if not isinstance(types[0].bumper, RingBumper) or not isinstance(types[0].drive, drives):
        driven = "a controlled speed" if system == "swarm" else "wheels of controlled speed"
        raise SettingsError(
            f"{whose} has robots without a ring bumper and {driven}, which a {system} needs"
        )
    return whose


def group(scenario: Scenario, namespace: str = "") -> tuple[NodeSpec, ...]:
    """Two to five robots that push one object, for each team; all in one world.

    Raises
    ------
    SettingsError: a team has fewer than two robots, or more; robots of several types, or without a
        round bumper; no object, or one whose outline is not convex.
    """
    world = _absolute(namespace)
    nodes = [NodeSpec("bridge", "bridge", world, world)]
    for team in teams_of(scenario):
        whose = _check_crowd(scenario, team, "group")
        count = len(team.robots)
        if not 2 <= count <= GROUP_MOST:
            raise SettingsError(
                f"{whose} has {count} robots, the system 'group' takes 2 to {GROUP_MOST} a team"
            )
        if not scenario.objects[team.object][0].geometry.convex:
            raise SettingsError(
                f"{whose} pushes '{team.object}', whose outline is not convex: groups push "
                "convex objects"
            )
        place = team_space(namespace, team.name)
        prefix = f"{team.name}/" if team.name else ""
        nodes += [
            NodeSpec(
                f"{prefix}{kind}",
                kind,
                place,
                world,
                robots=team.robots,
                item=team.object,
                team=team.name,
            )
            for kind in ("optimizer", "group")
        ]
    return tuple(nodes)


def swarm(scenario: Scenario, namespace: str = "") -> tuple[NodeSpec, ...]:
    """Any number of robots that move one object, for each team; all in one world. One node moves
    them all, or each robot has its own where ``agents.decentralised`` of ``swarm`` says so.

    Raises
    ------
    SettingsError: a team has no robot or no object, robots of several types, or without a round
        bumper and a controlled speed.
    """
    world = _absolute(namespace)
    nodes = [NodeSpec("bridge", "bridge", world, world)]
    alone = scenario.parameters.get("swarm", {}).get("agents", {}).get("decentralised", False)
    for team in teams_of(scenario):
        _check_crowd(scenario, team, "swarm")
        prefix = f"{team.name}/" if team.name else ""
        desk = NodeSpec(
            f"{prefix}swarm",
            "swarm",
            team_space(namespace, team.name),
            world,
            robots=team.robots,
            item=team.object,
            team=team.name,
        )
        nodes.append(desk)
        nodes += [
            replace(desk, name=f"{prefix}{robot}/agent", kind="swarm_agent", robot=robot,
                    remaps={"__node": f"agent_{robot}"})
            for robot in (team.robots if alone else ())
        ]  # fmt: skip
    return tuple(nodes)


SYSTEMS: dict[str, Callable[[Scenario, str], tuple[NodeSpec, ...]]] = {
    "single": single,
    "torque": torque,
    "group": group,
    "swarm": swarm,
}
"""Name of a system to the function that lists its nodes for a scenario in a namespace."""


def nodes_of(system: str, scenario: Scenario, namespace: str = "") -> tuple[NodeSpec, ...]:
    """The nodes of a system.

    Raises
    ------
    SettingsError: there is no such system, the scenario does not suit it, or the namespace is none.
    """
    if system not in SYSTEMS:
        known = ", ".join(SYSTEMS)
        raise SettingsError(f"no system called '{system}'; expected one of: {known}")
    check_namespace(namespace)
    return SYSTEMS[system](scenario, namespace)


def check_namespace(namespace: str) -> None:
    """Raise SettingsError for what ROS would not take: names of letters, digits, underscores."""
    for part in namespace.strip("/").split("/") if namespace.strip("/") else []:
        if not (part.isascii() and part.isidentifier()):
            raise SettingsError(
                f"namespace '{namespace}': expected names of letters, digits and underscores, "
                "with slashes between them, none of which begins with a digit"
            )


def recorder(out: str, namespace: str = "") -> NodeSpec:
    """A recorder of the world in a namespace and of all its teams; out: bag folder."""
    world = _absolute(namespace)
    return NodeSpec("recorder", "recorder", world, world, parameters={"out": out})
