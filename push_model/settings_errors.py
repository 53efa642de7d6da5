"""Error messages for settings: where the problem is, and what was expected."""

import contextlib
import dataclasses
import math
import types
import typing
from collections.abc import Iterator, Mapping
from typing import Annotated, Any

import pydantic

_TYPES = {
    "float_type": "a number",
    "finite_number": "a finite number",
    "int_type": "a whole number",
    "bool_type": "true or false",
    "string_type": "text",
    "dict_type": "a mapping",
    "dataclass_type": "a mapping",
    "model_attributes_type": "a mapping",
}
"""Expected value for each of pydantic's kinds of error."""


class SettingsError(ValueError):
    """A setting is unknown, missing, of the wrong type or out of range."""


class Gathered:
    """Collects the errors of parts that are read one after another.

    ``with gathered.part():`` around each part, then ``gathered.refuse()``.
    """

    def __init__(self) -> None:
        self._lines: list[str] = []

    @contextlib.contextmanager
    def part(self) -> Iterator[None]:
        """Read one part; its error is kept."""
        try:
            yield
        except SettingsError as error:
            self._lines.append(str(error))

    def refuse(self) -> None:
        """Raise a SettingsError with all errors so far, a line each, if there are any."""
        if self._lines:
            raise SettingsError("\n".join(self._lines))


def explained(
    error: pydantic.ValidationError, cls: type[Any], values: Any, where: str
) -> SettingsError:
    """The error of a settings class, with one line for each problem.

    Parameters
    ----------
    cls: class to be built. values: its arguments. where: their source.
    """
    lines = [_line(e, cls, values, where) for e in error.errors(include_url=False)]
    return SettingsError("\n".join(dict.fromkeys(lines)))


def _line(error: Any, cls: type[Any], values: Any, where: str) -> str:
    kind, value, context = error["type"], error["input"], error.get("ctx", {})
    if error["loc"] and error["loc"][-1] == "[key]":
        path, _, _ = _place(cls, values, where, error["loc"][:-2])
        return f"{path}: a key must be text, got {value!r}"
    absent = kind in ("missing", "unexpected_keyword_argument")
    parts = error["loc"][:-1] if absent else error["loc"]
    path, hint, field = _place(cls, values, where, parts)
    if kind == "unexpected_keyword_argument":
        known = ", ".join(sorted(_hints(hint))) if dataclasses.is_dataclass(hint) else "none"
        return f"{path}: unknown key '{error['loc'][-1]}'; expected one of: {known}"
    if kind == "missing":
        name = error["loc"][-1]
        return f"{path}: missing key '{name}' ({_name(_hints(hint)[name])})"
    if kind in ("greater_than_equal", "less_than_equal"):
        low, high = field.get("low", -math.inf), field.get("high", math.inf)
        return f"{path}: {value} is out of range, expected [{low}, {high}]"
    if kind == "union_tag_not_found":
        kinds = ", ".join(sorted(_kinds(hint)))
        return f"{path}: missing key 'kind', expected one of: {kinds}; got {value!r}"
    if kind == "union_tag_invalid":
        kinds = ", ".join(sorted(_kinds(hint)))
        return f"{path}.kind: expected one of: {kinds}; got {context['tag']!r}"
    if kind == "literal_error":
        return f"{path}: expected one of {list(typing.get_args(hint))}, got {value!r}"
    if kind in _TYPES:
        return f"{path}: expected {_TYPES[kind]}, got {value!r}"
    if "error" in context:  # raised by our own checks
        return f"{path}: {context['error']}"
    return f"{path}: {error['msg']}, got {value!r}"


def _place(
    hint: Any, value: Any, path: str, parts: tuple[Any, ...]
) -> tuple[str, Any, Mapping[str, Any]]:
    """Path, type and field metadata for a location of pydantic.

    Pydantic includes the kind of a union's member in the location; the path has it only if the
    file has it.
    """
    metadata: Mapping[str, Any] = {}
    for part in parts:
        hint = _bare(hint)
        shown = True
        if dataclasses.is_dataclass(hint):
            metadata = {f.name: f.metadata for f in dataclasses.fields(hint)}.get(part, {})
            hint = _hints(hint).get(part, Any)
        elif part in (kinds := _kinds(hint)):
            hint, shown = kinds[part], isinstance(value, Mapping) and part in value
        else:
            hint = _inside(hint, part)
        if shown:
            named = f".{part}" if path else str(part)
            path += f"[{part}]" if isinstance(part, int) else named
            value = _item(value, part)
    return path, _bare(hint), metadata


def _inside(hint: Any, part: Any) -> Any:
    """Type of an item of a tuple or a dict."""
    inner = typing.get_args(hint)
    if isinstance(part, str):
        return inner[-1] if inner else Any
    if inner[-1:] == (Ellipsis,):
        return inner[0]
    return inner[part] if part < len(inner) else Any


def _item(value: Any, part: Any) -> Any:
    if isinstance(value, Mapping):
        return value.get(part)
    if isinstance(value, (list, tuple)) and isinstance(part, int) and part < len(value):
        return value[part]
    return None


def _hints(cls: Any) -> dict[str, Any]:
    """Types of the fields of a dataclass."""
    hints = typing.get_type_hints(cls)
    return {f.name: hints[f.name] for f in dataclasses.fields(cls)}


def _bare(hint: Any) -> Any:
    """The type without annotations, and without None where it is optional."""
    if typing.get_origin(hint) is Annotated:
        return _bare(typing.get_args(hint)[0])
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        rest = [i for i in typing.get_args(hint) if i is not type(None)]
        if len(rest) == 1:
            return _bare(rest[0])
    return hint


def _kinds(hint: Any) -> dict[Any, Any]:
    """Members of a union of settings classes by their kind."""
    members = [_bare(i) for i in typing.get_args(hint)]
    return {
        f.default: m
        for m in members
        if dataclasses.is_dataclass(m)
        for f in dataclasses.fields(m)
        if f.name == "kind"
    }


def _name(hint: Any) -> str:
    if _kinds(hint):
        return f"a mapping of kind {' or '.join(sorted(_kinds(hint)))}"
    if dataclasses.is_dataclass(hint):
        return "a mapping"
    return str(getattr(hint, "__name__", hint))
