"""Distances of clouds to CAD models from the thesis, mm. Rows: clouds; columns: CAD models; both in OBJECTS order.

Source: thesis, Tables I-13 to I-18. Two rows of Table I-17 are inconsistent: the root of squared mean plus squared
standard deviation is not the RMS (7.3 instead of 5.94 for the rectangular prism, 6.8 instead of 6.14 for the cylinder).
The values are those of the thesis. The other rows are consistent, except those of real clouds to their own models.
"""

from dataclasses import dataclass

import numpy as np

from taxel.types import FloatArray

OBJECTS = ("rectangular", "cylindrical", "triangular")

TOP_GRASP_SHARES = (10 / 54, 10 / 50, 10 / 40)
"""Share of top grasps among all grasps of each object. Source: thesis, Table 5.1."""


@dataclass(frozen=True, eq=False)
class CloudTable:
    """Distances for one source of clouds, "sim" or "real", f64[3, 3] each, mm. deviation: standard deviation."""

    source: str
    mean: FloatArray
    rms: FloatArray
    largest: FloatArray
    deviation: FloatArray


SIMULATED = CloudTable(
    "sim",
    mean=np.array([[1.52, 9.46, 14.19], [2.85, 1.20, 6.89], [3.91, 4.31, 1.90]]),
    rms=np.array([[1.667, 11.431, 15.742], [4.49, 1.30, 7.81], [5.87, 5.28, 2.21]]),
    largest=np.array([[8.91, 20.42, 27.89], [16.8, 6.0, 16.6], [16.8, 9.5, 10.1]]),
    deviation=np.array([[0.77, 6.421, 6.804], [3.47, 0.40, 3.67], [4.37, 3.05, 1.13]]),
)

REAL = CloudTable(
    "real",
    mean=np.array([[2.896, 10.608, 14.989], [3.58, 2.71, 7.41], [4.92, 5.25, 4.42]]),
    rms=np.array([[3.296, 12.737, 17.091], [4.85, 3.30, 8.62], [5.94, 6.14, 4.72]]),
    largest=np.array([[7.64, 24.17, 31.01], [16.9, 7.86, 20.25], [16.9, 11.8, 10.3]]),
    deviation=np.array([[0.889, 7.044, 8.211], [3.28, 0.904, 4.393], [5.44, 4.26, 1.63]]),
)
