"""Settings of a method's node as ROS parameters: those of the method by section, and its own."""

from collections.abc import Sequence
from typing import Any

from rclpy.node import Node

from push_estimation.pose_gate import PoseGateSettings
from push_job.method import MethodSpec, method_names, method_spec
from push_model.settings import SettingsError
from push_ros.parameters import declare_settings
from push_ros.roster import Roster, RosterSettings
from push_scenario.scenario import Scenario


def declare_method(
    node: Node, spec: MethodSpec, key: str, scenario: Scenario
) -> tuple[dict[str, Any], PoseGateSettings]:
    """Settings of the method by section, and of the pose gate.

    key: of the scenario's ``parameters`` that has them; ``roster`` among them is declared apart.
    """
    values = dict(scenario.parameters.get(key, {}))
    sections = {k: values.pop(k, {}) for k in (*spec.sections, "poses", "roster") if k}
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


def declare_roster(
    node: Node, scenario: Scenario, key: str, team: Sequence[str], item: str, open_team: bool
) -> Roster:
    """Who is in a team; its settings may be changed at any time.

    key: of the scenario's ``parameters``. open_team: whether further robots may take part.
    """
    made: list[Roster] = []

    def apply(settings: RosterSettings) -> None:
        for roster in made:
            roster.change(settings)

    values = scenario.parameters.get(key, {}).get("roster", {})
    where = f"{key}.roster"
    settings = declare_settings(node, RosterSettings, values, "roster", where, apply)
    others = {k: r for k, r in scenario.radii.items() if k not in (*team, item)}
    radius = scenario.radii[team[0]]
    made.append(Roster(settings, team, others, radius, open_team))
    return made[0]


def chosen_method(name: str) -> MethodSpec:
    """The method of a name; raises SettingsError where there is none."""
    spec = method_spec(name)
    if spec is None:
        known = ", ".join(method_names())
        raise SettingsError(
            f"there is no method '{name}'; expected one of: {known}, or MODULE:ATTRIBUTE"
        )
    return spec
