"""YAML in which no key of a mapping occurs twice.

The YAML specification forbids it, but PyYAML takes the last one without a word: a setting that
somebody adds to a file would be lost, or would replace one that is there.
"""

from collections.abc import Hashable
from typing import Any

import yaml

_Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_MERGE = "tag:yaml.org,2002:merge"


class UniqueKeysLoader(_Loader):
    """A safe loader that raises ``yaml.YAMLError`` at the second occurrence of a key."""

    def construct_mapping(self, node: Any, deep: bool = False) -> Any:
        """See ``yaml.SafeLoader``."""
        seen = set()
        for key_node, _ in getattr(node, "value", ()):
            if key_node.tag == _MERGE:
                continue
            key = self.construct_object(key_node, deep=True)
            if not isinstance(key, Hashable):
                continue  # which is an error of its own
            if key in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f"the key '{key}' occurs twice in one mapping", key_node.start_mark
                )
            seen.add(key)
        return super().construct_mapping(node, deep)
