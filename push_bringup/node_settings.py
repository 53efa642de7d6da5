"""All settings of the nodes, so that a scenario's can be checked before anything starts."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from push_estimation.pose_gate import PoseGateSettings
from push_model.settings import SettingsError, from_mapping
from push_mpc import MpcSettings, TrackerSettings
from push_planner import PlannerSettings
from push_scenario.scenario import Scenario
from push_supervisor import SupervisorSettings
from sim_bridge.settings import BridgeSettings, MotionCaptureSettings, PhysicsSettings

SECTIONS: dict[str, dict[str, type[Any]]] = {
    "bridge": {
        "": BridgeSettings,
        "motion_capture": MotionCaptureSettings,
        "physics": PhysicsSettings,
    },
    "planner": {"": PlannerSettings},
    "controller": {"mpc": MpcSettings, "tracker": TrackerSettings, "poses": PoseGateSettings},
    "supervisor": {"": SupervisorSettings, "poses": PoseGateSettings},
}
"""Node to its settings classes by section; the section "" is the node's own level."""


def check_settings(scenario: Scenario) -> None:
    """Raise SettingsError for settings in a scenario that a node would refuse."""
    for node, values in scenario.parameters.items():
        sections = SECTIONS.get(node)
        if sections is None:
            known = ", ".join(SECTIONS)
            raise SettingsError(
                f"{scenario.name}.parameters: unknown node '{node}'; expected one of: {known}"
            )
        own = dict(values)
        for section, cls in sections.items():
            if section:
                from_mapping(cls, own.pop(section, None), f"{scenario.name}.{node}.{section}")
        if "" in sections:
            from_mapping(sections[""], own, f"{scenario.name}.{node}")
        elif own:
            raise SettingsError(
                f"{scenario.name}.{node}: unknown key '{next(iter(own))}'; expected one of: "
                + ", ".join(sections)
            )


def defaults() -> dict[str, dict[str, Any]]:
    """Every setting of every node, as it is where nobody says otherwise."""
    result: dict[str, dict[str, Any]] = {}
    for node, sections in SECTIONS.items():
        values: dict[str, Any] = {}
        for section, cls in sections.items():
            settings = asdict(cls())
            if section:
                values[section] = settings
            else:
                values.update(settings)
        result[node] = values
    return result


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
