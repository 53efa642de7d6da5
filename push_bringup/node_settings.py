"""All settings of the nodes, so that a scenario's can be checked before anything starts."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from push_bringup.node_kinds import KINDS, SECTIONS, kind_of
from push_model.settings import SettingsError, from_mapping
from push_mpc.controllers import controller_kind
from push_scenario.scenario import Scenario
from sim_bridge.worlds import world_kind


def sections_of(node: str, values: Mapping[str, Any]) -> dict[str, type[Any]]:
    """The settings classes of a node whose values are these. Another world or another controller
    has its own in the place of ``physics`` or ``mpc``.

    Raises
    ------
    SettingsError: a world or a controller that there is not.
    """
    sections = dict(kind_of(node).sections)
    if node == "bridge" and "world" in values:
        sections["physics"] = world_kind(str(values["world"])).settings
    if node == "controller" and "controller" in values:
        sections["mpc"] = controller_kind(str(values["controller"])).settings
    return sections


def check_settings(scenario: Scenario) -> None:
    """Raise SettingsError for settings in a scenario that a node would refuse."""
    for node, values in scenario.parameters.items():
        try:
            sections = sections_of(node, values)
        except SettingsError as error:
            raise SettingsError(f"{scenario.name}.parameters: {error}") from None
        if node in KINDS and not sections:
            raise SettingsError(f"{scenario.name}.parameters: '{node}' has no settings")
        own = dict(values)
        for section, cls in sections.items():
            if section:
                from_mapping(cls, own.pop(section, None), f"{scenario.name}.{node}.{section}")
        if "" in sections:
            from_mapping(sections[""], own, f"{scenario.name}.{node}")
        elif own:
            known = ", ".join(sections)
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
    for node in dict.fromkeys((*SECTIONS, *scenario.parameters)):
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
