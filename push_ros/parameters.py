"""ROS parameters from settings dataclasses: same names, types, ranges and descriptions."""

import contextlib
import dataclasses
import math
import typing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node

from push_model.settings import SettingsError, from_mapping

T = TypeVar("T")


def declare_settings(
    node: Node,
    cls: type[T],
    values: Mapping[str, Any] | None = None,
    prefix: str = "",
    where: str = "parameters",
    apply: Callable[[T], None] | None = None,
) -> T:
    """Declare every field of a settings class and return the settings.

    Parameters
    ----------
    values: defaults that replace the class's own, e.g. from a scenario.
    prefix: put before the names, with a dot.
    apply: called with the new settings after a change at run time has been checked; it may raise
        SettingsError to refuse, and is called again with the old ones if a group of settings that
        is changed together with this one refuses. Without it the parameters are read-only.
    """
    defaults = from_mapping(cls, values, where)
    hints = typing.get_type_hints(cls)
    names = {f.name: f"{prefix}.{f.name}" if prefix else f.name for f in dataclasses.fields(cls)}  # type: ignore[arg-type]
    for field in dataclasses.fields(cls):  # type: ignore[arg-type]
        value = getattr(defaults, field.name)
        if isinstance(value, tuple):  # of an empty list nobody knows the type
            value = list(value) or ([""] if hints[field.name] == tuple[str, ...] else [])
        # A descriptor belongs to one parameter: rclpy changes the one it is given.
        descriptor = _descriptor(cls, field, read_only=apply is None)
        node.declare_parameter(names[field.name], value, descriptor)

    group = _Group(node, cls, names, apply)
    settings: T = group.settings()
    if apply is not None:
        _changes_of(node).groups.append(group)
    return settings


@dataclass(frozen=True)
class _Group:
    """Settings of one class. names: of the parameters, by field."""

    node: Node
    cls: type[Any]
    names: Mapping[str, str]
    apply: Callable[[Any], None] | None

    def settings(self, parameters: Sequence[Any] = ()) -> Any:
        """As they are, but for some parameters. Raises SettingsError."""
        get, given = self.node.get_parameter, {p.name: p.value for p in parameters}
        values = {f: given[n] if n in given else get(n).value for f, n in self.names.items()}
        plain = {f: _plain(v) for f, v in values.items()}
        return from_mapping(self.cls, plain, f"{self.node.get_name()} parameters")


class _Changes:
    """What one request changes in the groups of a node is used as a whole, or not at all."""

    def __init__(self) -> None:
        self.groups: list[_Group] = []

    def on_set(self, parameters: Sequence[Any]) -> SetParametersResult:
        """Check and use what is asked for; the node then sets the parameters."""
        asked = {p.name for p in parameters}
        used: list[tuple[Callable[[Any], None], Any]] = []  # how to go back
        try:
            changed = [
                (g.apply, g.settings(parameters), g.settings())
                for g in self.groups
                if g.apply is not None and not asked.isdisjoint(g.names.values())
            ]
            for apply, new, old in changed:
                used.append((apply, old))
                apply(new)
        except SettingsError as error:
            for apply, old in reversed(used):
                with contextlib.suppress(SettingsError):  # who refused may refuse this, too
                    apply(old)
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)


def _changes_of(node: Node) -> _Changes:
    """Those of a node, which answers for all its groups at once."""
    found: _Changes | None = getattr(node, "_settings_changes", None)
    if found is None:
        found = _Changes()
        node._settings_changes = found
        node.add_on_set_parameters_callback(found.on_set)
    return found


def _plain(value: Any) -> Any:
    return tuple(value) if not isinstance(value, (str, bool, int, float)) else value


def _descriptor(cls: type[Any], field: Any, read_only: bool) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(
        description=str(field.metadata.get("doc", "")), read_only=read_only
    )
    low = field.metadata.get("low", -math.inf)
    high = field.metadata.get("high", math.inf)
    hint = typing.get_type_hints(cls)[field.name]
    if hint is float and math.isfinite(low) and math.isfinite(high):
        descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
    if hint is int and math.isfinite(low) and math.isfinite(high):
        descriptor.integer_range = [
            IntegerRange(from_value=int(low), to_value=int(min(high, 2**62)), step=1)
        ]
    return descriptor
