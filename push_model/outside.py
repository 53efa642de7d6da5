"""What a name of the form ``MODULE:ATTRIBUTE`` stands for: parts from outside these packages."""

import importlib
from typing import Any

from push_model.settings import SettingsError


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
