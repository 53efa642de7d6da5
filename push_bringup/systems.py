"""The systems: which nodes each of them consists of, whom they serve, and in which namespace.

The same list of nodes serves the launcher (one process per node), runs in lockstep (all nodes in
one process) and the tests. An added method is a system without a change in this file. To add a
system of several kinds of nodes, write a function that returns its list of nodes, and name the
function in ``SYSTEMS``.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from grasp_opt.group_method import GROUP
from push_bringup.node_kinds import NodeSpec
from push_job.method import method_names, method_spec
from push_model.bumpers import RingBumper
from push_model.drives import TorqueDrive
from push_model.settings import SettingsError
from push_ros.names import inside, space
from push_scenario.scenario import Scenario
from push_scenario.teams import Team
from swarm_push.swarm_method import SWARM

LIVE: dict[str, dict[str, Any]] = {"controller": {"tracker": {"deadline": 0.03}}}
"""Defaults for real time, for settings that the scenario does not give. In lockstep a solve has no
deadline [s], because such a run must not depend on the wall clock."""

LOCKSTEP: dict[str, dict[str, Any]] = {"bridge": {"lockstep_warning": 60.0}}
"""Defaults for lockstep, for settings that the scenario does not give. All nodes are in one
process, so a late answer [s] only means that the machine is busy."""

OUTLINE_ESTIMATOR = "outline_estimator"
"""The kind of the node that estimates outlines."""

GROUP_MOST = 5
"""Maximum number of robots in a group."""


def teams_of(scenario: Scenario) -> tuple[Team, ...]:
    """The teams of a scenario. A scenario without teams has one team without a name."""
    return tuple(scenario.teams.values()) or (scenario.team(),)


def team_space(namespace: str, team: str) -> str:
    """Namespace of a team. A team without a name has the namespace of the world."""
    return inside(namespace, team) if team else _absolute(namespace)


def _absolute(namespace: str) -> str:
    return space(namespace).rstrip("/") or "/"


def _bridge(scenario: Scenario, world: str) -> NodeSpec:
    """The node that connects to the world: to a simulated one, or to a lab."""
    kind = "lab_bridge" if scenario.on == "lab" else "bridge"
    return NodeSpec("bridge", kind, world, world)


def single(scenario: Scenario, namespace: str = "") -> tuple[NodeSpec, ...]:
    """Nodes of the system ``single``: in each team, one robot pushes one object.

    All teams share one world. Robots and objects that belong to no team are obstacles.

    Raises
    ------
    SettingsError: a team does not have exactly one robot, or has no object.
    """
    world = _absolute(namespace)
    nodes = [_bridge(scenario, world)]
    for team in teams_of(scenario):
        if len(team.robots) != 1:
            whose = f"team '{team.name}'" if team.name else "its only team"
            raise SettingsError(
                f"scenario '{scenario.name}': {whose} has {len(team.robots)} robots, but the "
                "system 'single' needs one per team; list under 'teams' which robot pushes which "
                "object"
            )
        if not team.object:
            raise SettingsError(
                f"scenario '{scenario.name}' has no object to push; add one under 'objects'"
            )
        robot, item, place = team.robots[0], team.object, team_space(namespace, team.name)
        prefix = f"{team.name}/" if team.name else ""
        own = inside(namespace, robot)
        nodes += [
            NodeSpec(f"{prefix}controller", "controller", own, world, robot, item, team.name),
            NodeSpec(f"{prefix}planner", "planner", place, world, robot, item, team.name),
            NodeSpec(f"{prefix}supervisor", "supervisor", place, world, robot, item, team.name),
        ]
        if _estimates(scenario):
            nodes.append(_estimator(place, world, team))
    return tuple(nodes)


def rearrange(scenario: Scenario, namespace: str = "") -> tuple[NodeSpec, ...]:
    """Nodes of the system ``rearrange``: those of ``single``, and one that decides which object the
    robot pushes next.

    Raises
    ------
    SettingsError: see ``single``; or the scenario has teams.
    """
    if scenario.teams:
        raise SettingsError(
            f"scenario '{scenario.name}' has teams; in the system 'rearrange' one robot pushes all "
            "objects, so remove 'teams'"
        )
    nodes = single(scenario, namespace)
    owner = next(n for n in nodes if n.kind == "supervisor")
    return (*nodes, replace(owner, name="rearranger", kind="rearranger", item=""))


def _estimates(scenario: Scenario, kind: str = "estimator") -> bool:
    """Whether the scenario asks for estimators of a kind."""
    return bool(scenario.parameters.get(kind, {}).get("enabled", False))


def estimated(system: str, scenario: Scenario) -> Scenario:
    """A scenario whose estimators are switched on: that of the outline for teams of several robots,
    else that of contact friction, centre of mass and latency.

    Raises
    ------
    SettingsError: the system has no estimator for this scenario.
    """
    several = any(len(t.robots) > 1 for t in teams_of(scenario))
    kind = OUTLINE_ESTIMATOR if several else "estimator"
    asked = scenario.settings(kind, enabled=True)
    if not any(n.kind == kind for n in nodes_of(system, asked)):
        raise SettingsError(
            f"the system '{system}' has no estimator for scenario '{scenario.name}'; there is one "
            "for a robot that pushes alone, and one for several robots with ring bumpers"
        )
    return asked


def _estimator(place: str, world: str, team: Team) -> NodeSpec:
    """The estimator of a team of one robot."""
    name = f"{team.name}/estimator" if team.name else "estimator"
    robot = team.robots[0]
    return NodeSpec(name, "estimator", place, world, robot, team.object, team.name)


def torque(scenario: Scenario, namespace: str = "") -> tuple[NodeSpec, ...]:
    """Nodes of the system ``torque``: a controller for each robot with torque-driven wheels.

    Raises
    ------
    SettingsError: no robot of the scenario has torque-driven wheels.
    """
    world = _absolute(namespace)
    driven = [n for n, (r, _) in scenario.robots.items() if isinstance(r.drive, TorqueDrive)]
    if not driven:
        raise SettingsError(
            f"scenario '{scenario.name}': no robot is driven by wheel torques; the system 'torque' "
            "needs a robot type with 'drive: {kind: torque}'"
        )
    return (
        _bridge(scenario, world),
        *(
            NodeSpec(f"{n}/controller", "torque_controller", inside(namespace, n), world, n)
            for n in driven
        ),
    )


def method(name: str, scenario: Scenario, namespace: str = "") -> tuple[NodeSpec, ...]:
    """Nodes of a method: for each team, one node that runs the method. All share one world.

    Raises
    ------
    SettingsError: there is no such method, or it cannot command the robots of a team.
    """
    world = _absolute(namespace)
    nodes = [_bridge(scenario, world)]
    spec = {"group": GROUP, "swarm": SWARM}.get(name) or method_spec(name)
    if spec is None:
        raise SettingsError(
            f"there is no method '{name}'; give the name of an installed method, or "
            "MODULE:ATTRIBUTE"
        )
    for team in teams_of(scenario):
        whose = f"scenario '{scenario.name}': " + (f"team '{team.name}'" if team.name else "it")
        if not team.robots:
            raise SettingsError(f"{whose} has no robots; add at least one")
        if not team.object:
            raise SettingsError(
                f"{whose} has no object to push; name one under 'object' or 'objects'"
            )
        try:
            robots = {r: scenario.robots[r][0] for r in team.robots}
            spec.check(robots, scenario.objects[team.object][0])
        except SettingsError as error:
            raise SettingsError(f"{whose} {error}") from None
        place, prefix = team_space(namespace, team.name), f"{team.name}/" if team.name else ""
        host = NodeSpec(
            f"{prefix}{spec.name}",
            name,
            place,
            world,
            robots=team.robots,
            item=team.object,
            team=team.name,
        )
        nodes.append(host)
        if _estimates(scenario) and len(team.robots) == 1:
            nodes.append(_estimator(place, world, team))
        if _estimates(scenario, OUTLINE_ESTIMATOR):
            if not all(isinstance(r.bumper, RingBumper) for r in robots.values()):
                raise SettingsError(
                    f"{whose} has robots without a ring bumper, which estimate no outline; leave "
                    f"'{OUTLINE_ESTIMATOR}.enabled' unset"
                )
            beside = f"{prefix}{OUTLINE_ESTIMATOR}"
            nodes.append(replace(host, name=beside, kind=OUTLINE_ESTIMATOR))
    return tuple(nodes)


def group(scenario: Scenario, namespace: str = "") -> tuple[NodeSpec, ...]:
    """Nodes of the system ``group``: for each team, the group node and an optimizer.

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
    """Nodes of the system ``swarm``: for each team, the swarm node.

    If the setting ``agents.decentralised`` is true, each robot has an agent node in addition.

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
    """A system by name.

    nodes: function of a scenario and a namespace that returns the nodes. example: scenario that is
    used if none is given.
    """

    nodes: Callable[[Scenario, str], tuple[NodeSpec, ...]]
    example: str


SYSTEMS: dict[str, System] = {
    "single": System(single, "env1-target1"),
    "rearrange": System(rearrange, "rearrange"),
    "torque": System(torque, "wheel-slip"),
    "group": System(group, GROUP.example),
    "swarm": System(swarm, SWARM.example),
}
"""The systems that are listed in this file, by name. Every method is also a system, which consists
of the bridge and the node of the method."""


def system_of(name: str) -> System:
    """A system by its name; also a method, by its name or as ``module:ATTRIBUTE``.

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
            f"there is no system '{name}'; expected one of: {known}, "
            "or MODULE:ATTRIBUTE of a method"
        )
    return System(partial(method, name), spec.example)


def system_names() -> tuple[str, ...]:
    """Names of all systems, including those of installed methods."""
    return tuple(dict.fromkeys((*SYSTEMS, *method_names())))


def nodes_of(system: str, scenario: Scenario, namespace: str = "") -> tuple[NodeSpec, ...]:
    """The nodes of a system.

    Raises
    ------
    SettingsError: there is no such system, the scenario does not fit it, or the namespace is not a
        valid ROS namespace.
    """
    found = system_of(system)
    check_namespace(namespace)
    if system != "group" and any(team.trajectory for team in teams_of(scenario)):
        raise SettingsError(
            f"scenario '{scenario.name}' has a trajectory, which only the system 'group' follows; "
            f"give '{system}' a 'goal' or 'goals', or none"
        )
    if system != "rearrange" and scenario.arrangement:
        raise SettingsError(
            f"scenario '{scenario.name}' has an arrangement, which only the system 'rearrange' "
            f"can carry out; give '{system}' a scenario without one"
        )
    return found.nodes(scenario, namespace)


def check_namespace(namespace: str) -> None:
    """Raise SettingsError if ROS would not accept a namespace.

    Each part must consist of letters, digits and underscores, and must not begin with a digit.
    """
    for part in namespace.strip("/").split("/") if namespace.strip("/") else []:
        if not (part.isascii() and part.isidentifier()):
            raise SettingsError(
                f"namespace '{namespace}': expected names of letters, digits and underscores, "
                "with slashes between them, none of which begins with a digit"
            )


def recorder(out: str, namespace: str = "", system: str = "") -> NodeSpec:
    """A recorder of the world in a namespace and of all its teams.

    out: bag folder. system: which one runs; it is noted in the bag.
    """
    world = _absolute(namespace)
    parameters = {"out": out} | ({"system": system} if system else {})
    return NodeSpec("recorder", "recorder", world, world, parameters=parameters)
