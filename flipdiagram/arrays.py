"""Types of NumPy arrays; a docstring gives the shape and the unit of each."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
"""Of any scalar: floats, or Drake's AutoDiffXd and Expression."""
Floats = NDArray[np.float64]
Complex = NDArray[np.complex128]
Indices = NDArray[np.int64]
