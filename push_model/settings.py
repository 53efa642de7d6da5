"""Settings: frozen dataclasses filled from mappings, with every error naming file, key and value.

A settings class is a frozen dataclass. A field may carry bounds in its metadata, put there with
``bounded``. Cross-field checks go into ``__post_init__`` and raise ``SettingsError``.
"""

import dataclasses
import math
import types
import typing
from collections.abc import Mapping
from typing import Any, TypeVar

T = TypeVar("T")


class SettingsError(ValueError):
    """A setting is unknown, missing, of the wrong type or out of range."""


def bounded(
    default: Any = dataclasses.MISSING,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    doc: str = "",
) -> Any:
    """A dataclass field with a value in [low, high]; ``doc`` says what it is, in which unit."""
    metadata = {"low": low, "high": high, "doc": doc}
    if default is dataclasses.MISSING:
        return dataclasses.field(metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def from_mapping(cls: type[T], values: Mapping[str, Any] | None, where: str = "settings") -> T:
    """Build the settings class from a mapping.

    Parameters
    ----------
    cls: a dataclass; nested dataclass fields take nested mappings.
    values: keys are field names; absent keys take the field's default.
    where: names the source in error messages, e.g. a file and a key path.

    Raises
    ------
    SettingsError: unknown or missing key, wrong type, out of range; says what was expected.
    """
    if values is None:
        values = {}
    if not isinstance(values, Mapping):
        raise SettingsError(f"{where}: expected a mapping, got {values!r}")
    fields = {f.name: f for f in dataclasses.fields(cls)}  # type: ignore[arg-type]
    for key in values:
        if key not in fields:
            known = ", ".join(sorted(fields))
            raise SettingsError(f"{where}: unknown key '{key}'; expected one of: {known}")
    hints = typing.get_type_hints(cls)
    arguments: dict[str, Any] = {}
    for name, field in fields.items():
        if name in values:
            arguments[name] = convert(hints[name], values[name], f"{where}.{name}", field.metadata)
        elif field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
            raise SettingsError(f"{where}: missing key '{name}' ({_type_name(hints[name])})")
    try:
        return cls(**arguments)
    except SettingsError as error:
        raise SettingsError(f"{where}: {error}") from None


def convert(hint: Any, value: Any, where: str, metadata: Mapping[str, Any] | None = None) -> Any:
    """The value as the hinted type, checked against the bounds in the metadata."""
    origin = typing.get_origin(hint)
    if origin in (typing.Union, types.UnionType):
        options = typing.get_args(hint)
        if value is None and type(None) in options:
            return None
        rest = [o for o in options if o is not type(None)]
        if len(rest) == 1:
            return convert(rest[0], value, where, metadata)
    if dataclasses.is_dataclass(hint) and isinstance(hint, type):
        return value if isinstance(value, hint) else from_mapping(hint, value, where)
    if origin is tuple:
        return _convert_tuple(hint, value, where, metadata)
    if origin is dict:
        if not isinstance(value, Mapping):
            raise SettingsError(f"{where}: expected a mapping, got {value!r}")
        item = typing.get_args(hint)[1]
        return {str(k): convert(item, v, f"{where}.{k}") for k, v in value.items()}
    if hint is Any:
        return value
    if hint is float:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise SettingsError(f"{where}: expected a number, got {value!r}")
        value = float(value)
        if math.isnan(value):
            raise SettingsError(f"{where}: expected a number, got nan")
        _check_range(value, where, metadata)
        return value
    if hint is int:
        if isinstance(value, bool) or not isinstance(value, int):
            raise SettingsError(f"{where}: expected a whole number, got {value!r}")
        _check_range(value, where, metadata)
        return value
    if hint is bool or hint is str:
        if not isinstance(value, hint):
            raise SettingsError(f"{where}: expected {_type_name(hint)}, got {value!r}")
        return value
    if origin is typing.Literal:
        options = typing.get_args(hint)
        if value not in options:
            raise SettingsError(f"{where}: expected one of {list(options)}, got {value!r}")
        return value
    raise SettingsError(f"{where}: no conversion to {_type_name(hint)}")


def _convert_tuple(
    hint: Any, value: Any, where: str, metadata: Mapping[str, Any] | None
) -> tuple[Any, ...]:
    if isinstance(value, str) or not isinstance(value, (list, tuple)):
        raise SettingsError(f"{where}: expected a list, got {value!r}")
    items = typing.get_args(hint)
    if len(items) == 2 and items[1] is Ellipsis:
        items = (items[0],) * len(value)
    if len(items) != len(value):
        raise SettingsError(f"{where}: expected {len(items)} values, got {len(value)}: {value!r}")
    return tuple(
        convert(item, v, f"{where}[{i}]", metadata)
        for i, (item, v) in enumerate(zip(items, value, strict=True))
    )


def _check_range(value: float, where: str, metadata: Mapping[str, Any] | None) -> None:
    low = (metadata or {}).get("low", -math.inf)
    high = (metadata or {}).get("high", math.inf)
    if not low <= value <= high:
        raise SettingsError(f"{where}: {value} is out of range, expected [{low}, {high}]")


def _type_name(hint: Any) -> str:
    return getattr(hint, "__name__", str(hint))
