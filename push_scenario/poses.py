"""Poses in files."""

import math
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator

from push_model.arrays import Array
from push_model.settings import SettingsError


def _pose(value: Any) -> Any:
    if isinstance(value, (list, tuple)) and len(value) == 3 and all(map(_is_finite, value)):
        return value
    raise SettingsError(f"expected [x, y, theta] in m and rad, got {value!r}")


def _is_finite(value: Any) -> bool:
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return number and abs(value) < 1e9 and math.isfinite(value)


PoseValue = Annotated[tuple[float, float, float], BeforeValidator(_pose)]
"""[x, y, theta] in [m, m, rad], finite."""


def to_array(value: tuple[float, float, float]) -> Array:
    """``(3,)``."""
    return np.array(value, dtype=np.float64)


def to_value(pose: Array) -> list[float]:
    """A pose ``(3,)`` in the form of a file."""
    return [float(v) for v in pose]
