"""Samples of which `make test` runs a part, and `make test-long` the rest."""

from collections.abc import Iterable
from typing import Any

import pytest


def mostly_long(values: Iterable[Any], quick: int) -> list[Any]:
    """Arguments of ``parametrize``; all but the first ``quick`` ones are marked ``long``."""
    found: list[Any] = []
    for number, value in enumerate(values):
        given = value if isinstance(value, tuple) else (value,)
        found.append(value if number < quick else pytest.param(*given, marks=pytest.mark.long))
    return found
