"""The array types of the project; shapes are given in each docstring."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Quantities."""
Mask = NDArray[np.bool_]
"""Which of them."""
Rows = NDArray[np.intp]
"""Indices into them."""
