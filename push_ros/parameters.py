"""ROS parameters from settings dataclasses: same names, types, ranges and descriptions."""

import dataclasses
import math
import typing
from collections.abc import Callable, Mapping
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
        SettingsError to refuse. Without it the parameters are read-only.
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

    def current() -> dict[str, Any]:
        return {f: _plain(node.get_parameter(n).value) for f, n in names.items()}

    settings = from_mapping(cls, current(), f"{node.get_name()} parameters")
    if apply is not None:
        fields = {n: f for f, n in names.items()}

        def on_set(parameters: list[Any]) -> SetParametersResult:
            ours = {fields[p.name]: _plain(p.value) for p in parameters if p.name in fields}
            if not ours:
                return SetParametersResult(successful=True)
            try:
                apply(from_mapping(cls, {**current(), **ours}, f"{node.get_name()} parameters"))
            except SettingsError as error:
                return SetParametersResult(successful=False, reason=str(error))
            return SetParametersResult(successful=True)

        node.add_on_set_parameters_callback(on_set)
    return settings


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
