"""Messages of bags that were recorded with another version of this project's interfaces.

A bag carries the definitions of its messages. Where one differs from the present one, a message is
read by the definition of the bag and written anew by the present one: fields that only the bag has
are dropped, and fields that the bag does not have, or has as another type, are zero or empty.
"""

from typing import Any

import numpy as np
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from push_record.interfaces import typestore

_OWN = "push_msgs/"


class OlderMessages:
    """Converts messages by the definitions of one bag. types: those that differ, by name."""

    def __init__(self) -> None:
        self._present = typestore()
        self.types: dict[str, Typestore] = {}

    def define(self, name: str, definition: str) -> None:
        """Take a definition from the bag. One that cannot be read counts as the present one."""
        if not definition.strip() or not name.startswith(_OWN):
            return
        if name not in self._present.fielddefs:
            return
        try:
            found = get_types_from_msg(definition, name)
            own = {key: value for key, value in found.items() if key.startswith(_OWN)}
            if all(self._present.fielddefs.get(k, ([], []))[1] == v[1] for k, v in own.items()):
                return
            store = get_typestore(Stores.ROS2_JAZZY)
            store.register(own)
            store.generate_msgdef(name, ros_version=2)  # whether all types within it are known
        except TypesysError:
            return
        self.types[name] = store

    def present(self, name: str, data: bytes) -> bytes:
        """The bytes of a message by the present definition of its type."""
        store = self.types.get(name)
        if store is None:
            return data
        message = self._message(store, store.deserialize_cdr(data, name), name)
        return bytes(self._present.serialize_cdr(message, name))

    def _message(self, store: Typestore, older: Any, name: str) -> Any:
        """A message with the present fields of a type. older: None, or the message of the bag."""
        had = dict(store.fielddefs[name][1]) if older is not None else {}
        values = {}
        for field, what in self._present.fielddefs[name][1]:
            value = getattr(older, field) if had.get(field) == what else None
            values[field] = self._value(store, value, *what)
        return self._present.types[name](**values)

    def _value(self, store: Typestore, older: Any, kind: Any, value: Any) -> Any:
        if kind.name == "BASE":
            text = value[0] in ("string", "wstring")
            missing = "" if text else False if value[0] == "bool" else 0
            return missing if older is None else older
        if kind.name == "NAME":
            return self._message(store, older, value)
        (inner, what), count = value
        if inner.name == "NAME":
            items = [None] * count if older is None else older
            return [self._message(store, item, what) for item in items]
        if older is not None:
            return older
        strings = what[0] in ("string", "wstring")
        return [""] * count if strings else np.zeros(count, dtype=what[0])
