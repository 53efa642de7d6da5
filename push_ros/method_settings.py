"""Settings of a method's node as ROS parameters: those of the method by section, and its own."""

from typing import Any

from rclpy.node import Node

from push_estimation.pose_gate import PoseGateSettings
from push_job.method import MethodSpec, method_names, method_spec
from push_model.settings import SettingsError
from push_ros.parameters import declare_settings
from push_scenario.scenario import Scenario


def declare_method(
    node: Node, spec: MethodSpec, key: str, scenario: Scenario
) -> tuple[dict[str, Any], PoseGateSettings]:
    """Settings of the method by section, and of the pose gate.

    key: of the scenario's ``parameters`` that has them.
    """
    values = dict(scenario.parameters.get(key, {}))
    sections = {k: values.pop(k, {}) for k in (*spec.sections, "poses") if k}
    made = {
        k: declare_settings(node, cls, sections[k], k, f"{spec.name}.{k}")
        for k, cls in spec.sections.items()
        if k
    }
    if "" in spec.sections:
        made[""] = declare_settings(node, spec.sections[""], values, where=spec.name)
    elif values:
        raise SettingsError(f"{spec.name}: unknown key '{next(iter(values))}'")
    gate = declare_settings(
        node, PoseGateSettings, sections["poses"], "poses", f"{spec.name}.poses"
    )
    return made, gate


def chosen_method(name: str) -> MethodSpec:
    """The method of a name; raises SettingsError where there is none."""
    spec = method_spec(name)
    if spec is None:
        known = ", ".join(method_names())
        raise SettingsError(f"no method called '{name}'; expected one of: {known}, or MODULE:NAME")
    return spec
