"""The kinds of nodes: a row each, with the module that runs it, how it is made, and its settings.

A method that an installed package or a script adds is no row here: ``kind_of`` makes its row from
its ``MethodSpec``.
"""

import importlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from rclpy.node import Node

from grasp_opt.group_method import GROUP
from grasp_opt.placement_settings import PlacementWeights
from grasp_opt.step_settings import StepSettings
from lab_bridge.settings import LabBridgeSettings
from push_estimation.outline_estimate import OutlineSettings
from push_estimation.pose_gate import PoseGateSettings
from push_estimation.push_belief import PushPriorSettings
from push_estimation.stopped_robots import StoppedSettings
from push_estimation.stream_latency import LatencySettings
from push_job.method import MethodSpec, method_names, method_spec
from push_model.settings import SettingsError
from push_mpc.settings import ControllerSettings, MpcSettings, TrackerSettings
from push_mpc.torque_friction import FrictionTrustSettings
from push_mpc.torque_observer import TorqueObserverSettings
from push_mpc.torque_tracker import TorqueTrackerSettings
from push_mpc.wheel_slip_nmpc import WheelSlipSettings
from push_planner import PlannerSettings
from push_planner.rearrangement import RearrangementSettings
from push_ros.estimator_node import EstimatorSettings
from push_ros.outline_node import OutlineNodeSettings
from push_ros.roster import RosterSettings
from push_scenario.scenario import Scenario
from push_supervisor import SupervisorSettings
from sim_bridge.settings import BridgeSettings, MotionCaptureSettings, PhysicsSettings
from swarm_push.swarm_method import SWARM

METHOD_MODULE = "push_ros.method_node"
"""The module whose ``main`` runs any method in a process of its own."""


@dataclass(frozen=True)
class NodeKind:
    """A kind of node.

    module: whose ``main`` runs it. maker: the callable of that module that makes it in this
    process. passes: keyword arguments of the maker, from a NodeSpec. takes: ROS parameters that say
    whom it serves. sections: classes of its settings by section; "" is its own level. owner:
    whether it owns the jobs of a team. commands: whether it commands all robots of its team.
    listens: subscriptions of the pose stream that a run in lockstep waits for.
    """

    module: str
    maker: str
    passes: Callable[["NodeSpec"], dict[str, Any]]
    takes: tuple[str, ...] = ()
    sections: Mapping[str, type[Any]] = field(default_factory=dict)
    owner: bool = False
    commands: bool = False
    listens: int = 0

    def make(self, spec: "NodeSpec", scenario: Any) -> Any:
        """The node in this process."""
        maker = getattr(importlib.import_module(self.module), self.maker)
        return maker(scenario=scenario, **self.passes(spec))


@dataclass(frozen=True)
class NodeSpec:
    """A node of a system.

    name: what it is called in messages to people; unique in the system.
    kind: see ``kind_of``. namespace: where it lives. world: namespace of the bridge.
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

    @property
    def traits(self) -> NodeKind:
        """What its kind is."""
        return kind_of(self.kind)

    def words(self, scenario: str) -> list[str]:
        """Command line of its process; scenario: name or path of the file that it reads."""
        own = {
            "world": self.world,
            "robot": self.robot,
            "robots": list(self.robots),
            "object": self.item,
            "method": self.kind,
        }
        values: dict[str, Any] = {"scenario": scenario, **self.parameters}
        values.update({name: own[name] for name in self.traits.takes})
        remaps = {"__ns": self.namespace, **self.remaps}
        words = ["--ros-args"]
        for name, to in remaps.items():
            words += ["-r", f"{name}:={to}"]
        for name, value in values.items():
            words += ["-p", f"{name}:={json.dumps(value)}"]
        return words

    def make(self, scenario: Scenario) -> Node:
        """The node in this process, e.g. for a run in lockstep; a bridge waits to be started."""
        return self.traits.make(self, scenario)


def _team(spec: NodeSpec) -> dict[str, Any]:
    return {
        "robots": spec.robots,
        "item": spec.item,
        "namespace": spec.namespace,
        "world": spec.world,
    }


def _robot_and_object(spec: NodeSpec) -> dict[str, Any]:
    return {
        "robot": spec.robot,
        "item": spec.item,
        "namespace": spec.namespace,
        "world": spec.world,
    }


def _robot(spec: NodeSpec) -> dict[str, Any]:
    return {"robot": spec.robot, "namespace": spec.world}


def _method_kind(spec: MethodSpec, name: str) -> NodeKind:
    """Of a method that is hosted as it is; name: by which it is found again in a process."""
    return NodeKind(
        METHOD_MODULE,
        "MethodNode",
        lambda node: {"spec": name, **_team(node)},
        ("world", "robots", "object", "method"),
        {**spec.sections, **_HOST},
        owner=True,
        commands=True,
        listens=1,
    )


_TEAM = ("world", "robots", "object")
_GATED = {"poses": PoseGateSettings}
_HOST: dict[str, type[Any]] = {**_GATED, "roster": RosterSettings}

KINDS: dict[str, NodeKind] = {
    "bridge": NodeKind(
        "sim_bridge.node",
        "BridgeNode",
        lambda s: {"autostart": False, "namespace": s.namespace},
        sections={
            "": BridgeSettings,
            "motion_capture": MotionCaptureSettings,
            "physics": PhysicsSettings,
        },
    ),
    "lab_bridge": NodeKind(
        "lab_bridge.node",
        "LabBridgeNode",
        lambda s: {"namespace": s.namespace},
        sections={"": LabBridgeSettings, **_GATED},
    ),
    "planner": NodeKind(
        "push_planner.node",
        "PlannerNode",
        lambda s: {"namespace": s.namespace, "world": s.world},
        ("world",),
        {"": PlannerSettings},
    ),
    "rearranger": NodeKind(
        "push_planner.rearranger_node",
        "RearrangerNode",
        lambda s: {"robot": s.robot, "namespace": s.namespace, "world": s.world},
        ("world", "robot"),
        {"": RearrangementSettings, **_GATED},
        listens=1,
    ),
    "controller": NodeKind(
        "push_mpc.node",
        "ControllerNode",
        _robot,
        ("robot",),
        {"": ControllerSettings, "mpc": MpcSettings, "tracker": TrackerSettings, **_GATED},
        listens=1,
    ),
    "supervisor": NodeKind(
        "push_supervisor.node",
        "SupervisorNode",
        _robot_and_object,
        ("world", "robot", "object"),
        {"": SupervisorSettings, **_GATED},
        owner=True,
        listens=1,
    ),
    "group": NodeKind(
        "grasp_opt.node",
        "make",
        _team,
        _TEAM,
        {**GROUP.sections, **_HOST},
        owner=True,
        commands=True,
        listens=1,
    ),
    "optimizer": NodeKind(
        "grasp_opt.optimizer_node",
        "OptimizerNode",
        _team,
        _TEAM,
        {"": StepSettings, "placement": PlacementWeights},
    ),
    "swarm": NodeKind(
        "swarm_push.node",
        "make",
        _team,
        _TEAM,
        {**SWARM.sections, **_HOST},
        owner=True,
        commands=True,
        listens=1,
    ),
    "swarm_agent": NodeKind(
        "swarm_push.agent_node",
        "SwarmAgentNode",
        lambda s: {"robot": s.robot, **_team(s)},
        ("world", "robot", "robots", "object"),
        listens=1,
    ),
    "torque_controller": NodeKind(
        "push_mpc.torque_node",
        "TorqueControllerNode",
        _robot,
        ("robot",),
        {
            "nmpc": WheelSlipSettings,
            "tracker": TorqueTrackerSettings,
            "observer": TorqueObserverSettings,
            "friction": FrictionTrustSettings,
            **_GATED,
        },
        listens=1,
    ),
    "estimator": NodeKind(
        "push_ros.estimator_node",
        "EstimatorNode",
        _robot_and_object,
        ("world", "robot", "object"),
        {"": EstimatorSettings, "push": PushPriorSettings, "latency": LatencySettings, **_GATED},
        listens=1,
    ),
    "outline_estimator": NodeKind(
        "push_ros.outline_node",
        "OutlineNode",
        _team,
        _TEAM,
        {"": OutlineNodeSettings, "outline": OutlineSettings, "stopped": StoppedSettings, **_GATED},
        listens=1,
    ),
    "recorder": NodeKind(
        "push_record.recorder", "RecorderNode", lambda s: {"world": s.world}, ("world",)
    ),
}
"""By name, which is also the node's key among the ``parameters`` of a scenario."""

MODULES = {name: kind.module for name, kind in KINDS.items()} | {"method": METHOD_MODULE}
"""Name of a node on the command line to the module whose ``main`` runs it."""

SECTIONS = {name: dict(kind.sections) for name, kind in KINDS.items() if kind.sections}
"""Settings classes of the nodes that have settings, by section."""


@cache
def kind_of(name: str) -> NodeKind:
    """A kind of node: one of ``KINDS``, or a method by its name or ``module:ATTRIBUTE``.

    Raises
    ------
    SettingsError: there is none of the name.
    """
    if name in KINDS:
        return KINDS[name]
    spec = method_spec(name)
    if spec is None:
        known = ", ".join(dict.fromkeys((*KINDS, *method_names())))
        raise SettingsError(f"unknown node '{name}'; expected one of: {known}")
    return _method_kind(spec, name)
