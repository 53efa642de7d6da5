"""All settings of the nodes, so that a scenario's can be checked before anything starts."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from grasp_opt.group_control import GroupControlSettings
from grasp_opt.group_job import GroupJobSettings
from grasp_opt.group_push import GroupPushSettings
from grasp_opt.moves import MoveSettings
from grasp_opt.placement import PlacementSettings
from grasp_opt.step_planner import StepSettings
from push_estimation.pose_gate import PoseGateSettings
from push_model.settings import SettingsError, from_mapping
from push_mpc.controllers import controller_kind
from push_mpc.settings import ControllerSettings, MpcSettings, TrackerSettings
from push_mpc.torque_friction import FrictionTrustSettings
from push_mpc.torque_observer import TorqueObserverSettings
from push_mpc.torque_tracker import TorqueTrackerSettings
from push_mpc.wheel_slip_nmpc import WheelSlipSettings
from push_planner import PlannerSettings
from push_scenario.scenario import Scenario
from push_supervisor import SupervisorSettings
from sim_bridge.settings import BridgeSettings, MotionCaptureSettings, PhysicsSettings
from sim_bridge.worlds import world_kind
from swarm_push.agent import AgentSettings
from swarm_push.crescent_law import CrescentLawSettings
from swarm_push.laws import LawSettings
from swarm_push.object_track import TrackSettings
from swarm_push.swarm_job import SwarmJobSettings
from swarm_push.thesis_law import ThesisLawSettings

SECTIONS: dict[str, dict[str, type[Any]]] = {
    "bridge": {
        "": BridgeSettings,
        "motion_capture": MotionCaptureSettings,
        "physics": PhysicsSettings,
    },
    "planner": {"": PlannerSettings},
    "controller": {
        "": ControllerSettings,
        "mpc": MpcSettings,
        "tracker": TrackerSettings,
        "poses": PoseGateSettings,
    },
    "supervisor": {"": SupervisorSettings, "poses": PoseGateSettings},
    "group": {
        "": GroupJobSettings,
        "push": GroupPushSettings,
        "control": GroupControlSettings,
        "moves": MoveSettings,
        "poses": PoseGateSettings,
    },
    "optimizer": {"": StepSettings, "placement": PlacementSettings},
    "swarm": {
        "": SwarmJobSettings,
        "law": LawSettings,
        "crescent": CrescentLawSettings,
        "thesis": ThesisLawSettings,
        "track": TrackSettings,
        "agents": AgentSettings,
        "poses": PoseGateSettings,
    },
    "torque_controller": {
        "nmpc": WheelSlipSettings,
        "tracker": TorqueTrackerSettings,
        "observer": TorqueObserverSettings,
        "friction": FrictionTrustSettings,
        "poses": PoseGateSettings,
    },
}
"""Node to its settings classes by section; the section "" is the node's own level. Another world
or another controller has its own in the place of ``physics`` or ``mpc``."""


def sections_of(node: str, values: Mapping[str, Any]) -> dict[str, type[Any]]:
    """The settings classes of a node whose values are these.

    Raises
    ------
    SettingsError: a world or a controller that there is not.
    """
    sections = dict(SECTIONS[node])
    if node == "bridge" and "world" in values:
        sections["physics"] = world_kind(str(values["world"])).settings
    if node == "controller" and "controller" in values:
        sections["mpc"] = controller_kind(str(values["controller"])).settings
    return sections


def check_settings(scenario: Scenario) -> None:
    """Raise SettingsError for settings in a scenario that a node would refuse."""
    for node, values in scenario.parameters.items():
        if node not in SECTIONS:
            known = ", ".join(SECTIONS)
            raise SettingsError(
                f"{scenario.name}.parameters: unknown node '{node}'; expected one of: {known}"
            )
        own = dict(values)
        for section, cls in sections_of(node, values).items():
            if section:
                from_mapping(cls, own.pop(section, None), f"{scenario.name}.{node}.{section}")
        if "" in SECTIONS[node]:
            from_mapping(SECTIONS[node][""], own, f"{scenario.name}.{node}")
        elif own:
            known = ", ".join(SECTIONS[node])
            raise SettingsError(
                f"{scenario.name}.{node}: unknown key '{next(iter(own))}'; expected one of: {known}"
            )


def resolved(scenario: Scenario) -> Scenario:
    """The scenario with every setting of every node written out, defaults included.

    Raises
    ------
    SettingsError: see ``check_settings``.
    """
    check_settings(scenario)
    nodes: dict[str, dict[str, Any]] = {}
    for node in SECTIONS:
        values: dict[str, Any] = {}
        for section, cls in sections_of(node, scenario.parameters.get(node, {})).items():
            settings = {k: list(v) if isinstance(v, tuple) else v for k, v in asdict(cls()).items()}
            if section:
                values[section] = settings
            else:
                values.update(settings)
        nodes[node] = values
    return scenario.with_defaults(nodes)


def changed(
    scenario: Scenario, parameters: Mapping[str, Mapping[str, Any]], only_missing: bool = False
) -> Scenario:
    """The scenario with settings of some nodes replaced, or filled in where it is silent."""
    for node, values in parameters.items():
        if not isinstance(values, Mapping):
            raise SettingsError(f"parameters.{node}: expected a mapping, got {values!r}")
        flat = dict(_flat(values))
        if only_missing:
            given = dict(_flat(scenario.parameters.get(node, {})))
            flat = {k: v for k, v in flat.items() if k not in given}
        scenario = scenario.settings(node, **flat)
    return scenario


def _flat(values: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    """Nested mappings as ``a__b`` keys, which ``Scenario.settings`` takes."""
    result: list[tuple[str, Any]] = []
    for key, value in values.items():
        if isinstance(value, Mapping):
            result += _flat(value, f"{prefix}{key}__")
        else:
            result.append((f"{prefix}{key}".replace(".", "__"), value))
    return result
