"""Array types of annotations: one name for each element type that the package uses.

The names state only the element type; the docstring of each function states shapes and units.
"""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
Float32Array: TypeAlias = NDArray[np.float32]
BoolArray: TypeAlias = NDArray[np.bool_]
IntArray: TypeAlias = NDArray[np.int64]
Int32Array: TypeAlias = NDArray[np.int32]
IndexArray: TypeAlias = NDArray[np.intp]
"""Positions in an array, as `numpy.flatnonzero` and `numpy.argsort` return them."""
CountArray: TypeAlias = NDArray[np.uint16]
"""Raw counts as the boards send them."""
ByteArray: TypeAlias = NDArray[np.uint8]
WordArray: TypeAlias = NDArray[np.uint32]
