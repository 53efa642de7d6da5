"""What a name of the form ``MODULE:ATTRIBUTE`` stands for: parts from outside these packages."""

import hashlib
import importlib
import importlib.util
from pathlib import Path
from typing import Any

from push_model.settings import SettingsError


def source_digest(name: str) -> str:
    """Changes when the file of ``MODULE:ATTRIBUTE`` does; empty for other names, and where there is
    no file. Files that the module imports do not count."""
    module, colon, _ = name.partition(":")
    try:
        found = importlib.util.find_spec(module) if colon else None
    except (ImportError, ValueError):
        found = None
    if found is None or not found.has_location or found.origin is None:
        return ""
    return hashlib.sha256(Path(found.origin).read_bytes()).hexdigest()[:16]


def from_outside(name: str, where: str) -> Any:
    """What ``MODULE:ATTRIBUTE`` names; the module is imported.

    where: what asks for it, for the message.

    Raises
    ------
    SettingsError: the name has another form, or there is no such thing.
    """
    module, colon, attribute = name.partition(":")
    if not colon:
        raise SettingsError(f"{where}: expected MODULE:ATTRIBUTE, got '{name}'")
    try:
        return getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError) as error:
        raise SettingsError(f"{where}: '{name}': {error}") from None
