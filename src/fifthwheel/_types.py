"""Array types of the whole package."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Floating-point array; each docstring gives its shape."""
