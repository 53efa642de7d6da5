"""Checks before a suite starts. Nothing is started here."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from push_bringup.failures import DomainInUse
from push_bringup.launcher import Child
from push_bringup.node_kinds import NodeSpec
from push_bringup.node_settings import changed, resolved
from push_bringup.systems import LIVE, nodes_of, recorder
from push_model.settings import SettingsError
from push_ros.claims import world_is_claimed
from push_ros.latched import has_publisher
from push_ros.names import space
from push_scenario.scenario import Scenario, load_scenario

_DISCOVERY = 1.0  # [s] wall time to discover another bridge


@dataclass(frozen=True)
class SuiteSetup:
    """A suite that can start: its resolved scenario and its nodes. namespace: of the world."""

    scenario: Scenario
    nodes: tuple[NodeSpec, ...]
    namespace: str
    bag: Path | None

    def write(self, folder: Path) -> list[Child]:
        """Write the resolved scenario into a folder; return the processes that read it there."""
        file = folder / f"{self.scenario.name}.yaml"
        file.write_text(self.scenario.text, encoding="utf-8")
        children = []
        for node in self.nodes:
            bag = self.bag if node.kind == "recorder" else None
            children.append(Child(node.name, node.traits.module, node.words(str(file)), bag))
        return children


def prepare(
    scenario: str | Scenario,
    *,
    system: str = "single",
    parameters: Mapping[str, Mapping[str, Any]] | None = None,
    namespace: str = "",
    record: str | Path = "",
    factor: float | None = None,
) -> SuiteSetup:
    """Check everything that can be wrong with the arguments, and report it in one place.

    Parameters
    ----------
    scenario: name, path, or a Scenario.
    parameters: node name to settings that replace the scenario's, nested as in its file.
    record: folder of the bag, which must not exist. factor: simulated over wall time;
        default: the scenario's, or 1.

    Raises
    ------
    SettingsError: scenario, settings, system or namespace. FileExistsError: the bag folder.
    """
    made = load_scenario(scenario) if isinstance(scenario, str) else scenario
    made = changed(made, parameters or {})
    made = changed(made, LIVE, only_missing=True)
    if factor is not None:
        if made.on == "lab":
            raise SettingsError("a lab runs in real time; leave the factor out")
        made = made.settings("bridge", real_time_factor=float(factor))
    made = resolved(made)
    nodes = nodes_of(system, made, namespace)
    bag = Path(record) if str(record) else None
    if bag is not None:
        check_bag(bag)
        # it is there before the others
        nodes = (recorder(str(bag), namespace, system), *nodes)
    return SuiteSetup(replace(made, name=made.name or "scenario"), nodes, namespace, bag)


def check_bag(folder: Path) -> None:
    """Raise unless a bag can be written there: FileExistsError, or SettingsError."""
    if folder.exists():
        raise FileExistsError(f"{folder} exists already; choose another folder for the bag")
    above = next(p for p in folder.absolute().parents if p.exists())
    if not above.is_dir() or not os.access(above, os.W_OK | os.X_OK):
        raise SettingsError(f"{folder}: a bag cannot be written below {above}")


def check_domain(namespace: str = "", context: Any = None) -> None:
    """Raise DomainInUse if a bridge, or another source of poses, exists already."""
    domain = os.environ.get("ROS_DOMAIN_ID") or "0"
    if context is not None:
        domain = str(context.get_domain_id())
    here = space(namespace)
    if not world_is_claimed(domain, here) and not has_publisher(
        f"{here}poses", _DISCOVERY, context, "push_msgs/msg/Poses"
    ):
        return
    where = f" in namespace {namespace.strip('/')}" if namespace.strip("/") else ""
    raise DomainInUse(
        f"a bridge already runs in domain {domain}{where}, or a calibration or drive test; stop "
        "it, choose another --namespace, or set ROS_DOMAIN_ID"
    )
