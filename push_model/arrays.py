"""The array types of the project; shapes are given in each docstring."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Real numbers."""
Mask = NDArray[np.bool_]
"""Selections of elements."""
Rows = NDArray[np.intp]
"""Indices of elements."""
