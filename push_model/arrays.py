"""The array type of the project: float64, shape given in each docstring."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
