"""Settings: frozen dataclasses whose values are checked, with errors naming file, key and value.

``@settings`` makes a class a frozen dataclass that pydantic checks whenever it is built, from a
file or in code. A field may carry bounds, put there with ``bounded``. Checks across fields go into
``__post_init__`` and raise ``SettingsError``. The member of a union of settings
classes is chosen by its field ``kind``, a ``Literal`` with that default.

Types are strict: text and truth values are no numbers, and infinities and nan are refused. An
integer is accepted for a float, and a list for a tuple.
"""

import dataclasses
import functools
import inspect
import math
import types
import typing
from collections.abc import Mapping
from typing import Annotated, Any, TypeVar

import pydantic
import pydantic.dataclasses
from annotated_types import Ge, Le
from pydantic import AllowInfNan, BeforeValidator, Strict
from pydantic_core import core_schema

from push_model.settings_errors import SettingsError, explained

__all__ = ["SettingsError", "bounded", "from_mapping", "settings", "told_by_key"]

T = TypeVar("T")
_CONFIG = pydantic.ConfigDict(extra="forbid", validate_default=True)


def bounded(
    default: Any = dataclasses.MISSING,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    doc: str = "",
) -> Any:
    """A dataclass field with a value in [low, high]; ``doc`` gives meaning and unit.

    Bounds hold for each number of a tuple, and for an optional number when it is given.
    """
    metadata = {"low": low, "high": high, "doc": doc}
    if default is dataclasses.MISSING:
        return dataclasses.field(metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


@dataclasses.dataclass(frozen=True)
class _ToldByKey:
    kinds: tuple[str, ...]

    def by_kind(self, value: Any) -> Any:
        if isinstance(value, Mapping) and "kind" not in value:
            kind, inner = next(iter(value.items()), (None, None))
            if len(value) == 1 and kind in self.kinds and isinstance(inner, Mapping):
                return {**inner, "kind": kind}
        elif isinstance(value, Mapping) or dataclasses.is_dataclass(value):
            return value
        known = ", ".join(self.kinds)
        raise SettingsError(f"expected one key of {known} with a mapping, got {value!r}")

    def __get_pydantic_core_schema__(
        self, source: Any, handler: pydantic.GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.no_info_before_validator_function(self.by_kind, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: pydantic.GetJsonSchemaHandler
    ) -> dict[str, Any]:
        union = handler(schema)
        keyed = [
            {
                "type": "object",
                "properties": {kind: {"$ref": reference}},
                "required": [kind],
                "additionalProperties": False,
            }
            for kind, reference in union["discriminator"]["mapping"].items()
        ]
        return {"anyOf": [*keyed, union]}


def told_by_key(*kinds: str) -> Any:
    """Accept ``{rectangle: {...}}`` for ``{kind: rectangle, ...}``; used within ``Annotated``."""
    return _ToldByKey(kinds)


@typing.dataclass_transform(frozen_default=True, field_specifiers=(dataclasses.field,))
def settings(cls: type[T]) -> type[T]:
    """Make a class a frozen dataclass whose values are checked when it is built.

    Raises
    ------
    SettingsError: by the class's constructor, ``dataclasses.replace`` and ``from_mapping``.
    """
    hints = typing.get_type_hints(cls, include_extras=True)
    annotations = {}
    for name in inspect.get_annotations(cls):
        field = cls.__dict__.get(name)
        metadata = field.metadata if isinstance(field, dataclasses.Field) else {}
        hint = _checked(hints[name], metadata.get("low", -math.inf), metadata.get("high", math.inf))
        if metadata.get("doc"):
            hint = Annotated[hint, pydantic.Field(description=metadata["doc"])]
        annotations[name] = hint
    cls.__annotations__ = annotations
    made: Any = pydantic.dataclasses.dataclass(frozen=True, config=_CONFIG)(cls)
    validate = made.__init__
    places = [f.name for f in dataclasses.fields(made) if f.init and not f.kw_only]

    @functools.wraps(validate)
    def __init__(self: Any, *args: Any, **values: Any) -> None:  # noqa: N807
        if len(args) > len(places):
            raise TypeError(f"{made.__name__} takes {len(places)} positional values")
        for name, value in zip(places, args, strict=False):
            if name in values:
                raise TypeError(f"{made.__name__} got two values for '{name}'")
            values[name] = value
        try:
            validate(self, **values)
        except pydantic.ValidationError as error:
            raise explained(error, made, values, made.__name__) from None

    made.__init__ = __init__
    return typing.cast(type[T], made)


def from_mapping(cls: type[T], values: Mapping[str, Any] | None, where: str = "settings") -> T:
    """Build a settings class from a mapping.

    Parameters
    ----------
    cls: made by ``settings``; nested settings take nested mappings.
    values: keys are field names; absent keys take the field's default.
    where: names the source in error messages, e.g. a file and a key path.

    Raises
    ------
    SettingsError: unknown or missing key, wrong type, out of range; says what was expected,
        one line for each problem.
    """
    if "__pydantic_validator__" not in vars(cls):
        raise TypeError(f"{cls.__name__} is not made by @settings")
    if values is None:
        values = {}
    if not isinstance(values, Mapping):
        raise SettingsError(f"{where}: expected a mapping, got {values!r}")
    try:
        return pydantic.TypeAdapter(cls).validate_python(dict(values))
    except pydantic.ValidationError as error:
        raise explained(error, cls, values, where) from None


def _checked(hint: Any, low: float = -math.inf, high: float = math.inf) -> Any:
    """The type with the checks that pydantic applies to it and to its elements."""
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if origin is Annotated:
        return Annotated[_checked(inner[0], low, high), *inner[1:]]
    if hint is float or hint is int:
        checks: list[Any] = [Strict(), AllowInfNan(False)] if hint is float else [Strict()]
        checks += [Ge(low)] if math.isfinite(low) else []
        checks += [Le(high)] if math.isfinite(high) else []
        return Annotated[hint, *checks]
    if hint is bool or hint is str:
        return Annotated[hint, Strict()]
    if origin is tuple:
        many = len(inner) == 2 and inner[1] is Ellipsis
        items = tuple(i if i is Ellipsis else _checked(i, low, high) for i in inner)
        listed = functools.partial(_listed, None if many else len(inner))
        return Annotated[tuple[items], BeforeValidator(listed)]  # type: ignore[valid-type]
    if origin is dict:
        return dict[str, _checked(inner[1], low, high)]  # type: ignore[misc]
    if origin in (typing.Union, types.UnionType):
        union: Any = typing.Union[tuple(_checked(i, low, high) for i in inner)]  # noqa: UP007
        kinds = [i for i in inner if dataclasses.is_dataclass(i)]
        return Annotated[union, pydantic.Field(discriminator="kind")] if len(kinds) > 1 else union
    return hint


def _listed(count: int | None, value: Any) -> Any:
    if not isinstance(value, (list, tuple)):
        raise SettingsError(f"expected a list, got {value!r}")
    if count is not None and len(value) != count:
        raise SettingsError(f"expected {count} values, got {len(value)}: {value!r}")
    return tuple(value)
