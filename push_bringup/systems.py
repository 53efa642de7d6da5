"""The systems: which nodes make one up, for whom, and where they live.

One list serves the launcher (a process a node), lockstep (all nodes in one process) and the tests.
A further method is a system of its own without an edit here; a system of several kinds of nodes is
a function that returns such a list, and a row in ``SYSTEMS``.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from grasp_opt.group_method import GROUP
from push_bringup.node_kinds import NodeSpec
from push_job.method import method_names, method_spec
from push_model.drives import TorqueDrive
from push_model.settings import SettingsError
from push_ros.names import inside, space
from push_scenario.scenario import Scenario
from push_scenario.teams import Team
from swarm_push.swarm_method import SWARM

LIVE: dict[str, dict[str, Any]] = {"controller": {"tracker": {"deadline": 0.03}}}
"""Settings of live use, where the scenario is silent. A run in lockstep must not depend on the wall
clock: there a solve has no deadline [s]."""

LOCKSTEP: dict[str, dict[str, Any]] = {"bridge": {"lockstep_warning": 60.0}}
"""Settings of a run in lockstep, where the scenario is silent. All nodes are in one process, so a
late answer [s] means a busy machine."""

GROUP_MOST = 5
"""Robots of a group at most."""


def teams_of(scenario: Scenario) -> tuple[Team, ...]:
    """The teams of a scenario; the unnamed one where it names none."""
    return tuple(scenario.teams.values()) or (scenario.team(),)


def team_space(namespace: str, team: str) -> str:
    """Namespace of a team; that of the world for the unnamed one."""
    return inside(namespace, team) if team else _absolute(namespace)


def _absolute(namespace: str) -> str:
    return space(namespace).rstrip("/") or "/"


def _bridge(scenario: Scenario, world: str) -> NodeSpec:
    """The node that connects to the world: to a simulated one, or to a lab."""
    kind = "lab_bridge" if scenario.on == "lab" else "bridge"
    return NodeSpec("bridge", kind, world, world)


def single(scenario: Scenario, namespace: str = "") -> tuple[NodeSpec, ...]:
    """One robot that pushes one object, for each team; all in one world.

    A robot or object of no team stands in the way of the others.

    Raises
    ------
    SettingsError: a team has not one robot, or no object.
    """
    world = _absolute(namespace)
    nodes = [_bridge(scenario, world)]
    for team in teams_of(scenario):
        if len(team.robots) != 1:
            whose = f"team '{team.name}'" if team.name else "its only team"
            raise SettingsError(
                f"scenario '{scenario.name}': {whose} has {len(team.robots)} robots, the system "
                "'single' needs one per team; list under 'teams' which robot pushes which object"
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
        _bridge(scenario, world),
        *(
            NodeSpec(f"{n}/controller", "torque_controller", inside(namespace, n), world, n)
            for n in driven
        ),
    )


def method(name: str, scenario: Scenario, namespace: str = "") -> tuple[NodeSpec, ...]:
    """One node that hosts a method, for each team; all in one world.

    Raises
    ------
    SettingsError: there is no such method, or a team is not one that it can drive.
    """
    world = _absolute(namespace)
    nodes = [_bridge(scenario, world)]
    spec = {"group": GROUP, "swarm": SWARM}.get(name) or method_spec(name)
    if spec is None:
        raise SettingsError(
            f"no method called '{name}'; name an installed one, or MODULE:ATTRIBUTE"
        )
    for team in teams_of(scenario):
        whose = f"scenario '{scenario.name}': " + (f"team '{team.name}'" if team.name else "it")
        if not team.robots:
            raise SettingsError(f"{whose} has no robots")
        if not team.object:
            raise SettingsError(f"{whose} has no object to push")
        try:
            robots = {r: scenario.robots[r][0] for r in team.robots}
            spec.check(robots, scenario.objects[team.object][0])
        except SettingsError as error:
            raise SettingsError(f"{whose} {error}") from None
        place, prefix = team_space(namespace, team.name), f"{team.name}/" if team.name else ""
        nodes.append(
            NodeSpec(
                f"{prefix}{spec.name}",
                name,
                place,
                world,
                robots=team.robots,
                item=team.object,
                team=team.name,
            )
        )
    return tuple(nodes)


def group(scenario: Scenario, namespace: str = "") -> tuple[NodeSpec, ...]:
    """Two to five robots that push one object, for each team, and a grasp optimizer.

    Raises
    ------
    SettingsError: see ``method``.
    """
    nodes: list[NodeSpec] = []
    for node in method("group", scenario, namespace):
        if node.kind == "group":
            name = f"{node.team}/optimizer" if node.team else "optimizer"
            nodes.append(replace(node, name=name, kind="optimizer"))
        nodes.append(node)
    return tuple(nodes)


def swarm(scenario: Scenario, namespace: str = "") -> tuple[NodeSpec, ...]:
    """Any number of robots that move one object, for each team. One node moves them all, or each
    robot has its own where ``agents.decentralised`` of ``swarm`` says so.

    Raises
    ------
    SettingsError: see ``method``.
    """
    alone = scenario.parameters.get("swarm", {}).get("agents", {}).get("decentralised", False)
    nodes: list[NodeSpec] = []
    for node in method("swarm", scenario, namespace):
        nodes.append(node)
        if node.kind != "swarm" or not alone:
            continue
        prefix = f"{node.team}/" if node.team else ""
        nodes += [
            replace(
                node,
                name=f"{prefix}{robot}/agent",
                kind="swarm_agent",
                robot=robot,
                remaps={"__node": f"agent_{robot}"},
            )
            for robot in node.robots
        ]
    return tuple(nodes)


@dataclass(frozen=True)
class System:
    """nodes: lists its nodes for a scenario in a namespace. example: scenario to start it with."""

    nodes: Callable[[Scenario, str], tuple[NodeSpec, ...]]
    example: str


SYSTEMS: dict[str, System] = {
    "single": System(single, "env1-target1"),
    "torque": System(torque, "wheel-slip"),
    "group": System(group, GROUP.example),
    "swarm": System(swarm, SWARM.example),
}
"""Systems of more than one kind of node, by name. Any method is a system too, of its one node."""


def system_of(name: str) -> System:
    """A system by its name, or that of a method by its name or ``module:ATTRIBUTE``.

    Raises
    ------
    SettingsError: there is no such system.
    """
    if name in SYSTEMS:
        return SYSTEMS[name]
    spec = method_spec(name)
    if spec is None:
        known = ", ".join(system_names())
        raise SettingsError(
            f"no system called '{name}'; expected one of: {known}, or MODULE:ATTRIBUTE of a method"
        )
    return System(partial(method, name), spec.example)


def system_names() -> tuple[str, ...]:
    """Names of all systems, those of installed methods among them."""
    return tuple(dict.fromkeys((*SYSTEMS, *method_names())))


def nodes_of(system: str, scenario: Scenario, namespace: str = "") -> tuple[NodeSpec, ...]:
    """The nodes of a system.

    Raises
    ------
    SettingsError: there is no such system, the scenario does not suit it, or the namespace is none.
    """
    found = system_of(system)
    check_namespace(namespace)
    return found.nodes(scenario, namespace)


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
