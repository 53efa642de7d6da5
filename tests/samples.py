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


def slice_and_study(values: Iterable[Any], count: int) -> list[Any]:
    """Arguments of ``parametrize``: the first ``count`` ones are marked ``long``, the others
    ``study``."""
    found: list[Any] = []
    for number, value in enumerate(values):
        given = value if isinstance(value, tuple) else (value,)
        mark = pytest.mark.long if number < count else pytest.mark.study
        found.append(pytest.param(*given, marks=mark))
    return found
