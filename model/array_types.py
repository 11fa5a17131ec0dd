"""The type of most arrays here: numbers of double precision; what they are is said where they
stand."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
