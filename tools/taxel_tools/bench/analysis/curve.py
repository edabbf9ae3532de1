"""Loading and unloading: how counts follow force, up and down again (thesis, Figure 2.5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import trapezoid


@dataclass(frozen=True, eq=False)
class Curve:
    """`force_n` f64[k], rising; `loading`, `unloading` f64[taxels, k]: count over count at rest."""

    force_n: NDArray[np.float64]
    loading: NDArray[np.float64]
    unloading: NDArray[np.float64]

    @property
    def hysteresis(self) -> float:
        """Largest distance between the mean branches over the mean loading branch's range, 0 to 1."""
        loading, unloading = self.loading.mean(axis=0), self.unloading.mean(axis=0)
        span = float(loading.max() - loading.min())
        return float(np.abs(unloading - loading).max()) / span if span > 0.0 else float("nan")

    @property
    def area(self) -> float:
        """Area between the mean branches over the area under the loading branch's fall, 0 to 1."""
        loading, unloading = self.loading.mean(axis=0), self.unloading.mean(axis=0)
        under = float(trapezoid(loading[0] - loading, self.force_n))
        between = float(trapezoid(np.abs(loading - unloading), self.force_n))
        return between / under if under > 0.0 else float("nan")

    @property
    def saturation_n(self) -> float:
        """Force at which the mean loading branch has made 95 % of its fall, interpolated."""
        fall = self.loading.mean(axis=0)[0] - self.loading.mean(axis=0)
        goal = 0.95 * float(fall[-1])
        return float(np.interp(goal, np.maximum.accumulate(fall), self.force_n)) if goal > 0.0 else float("nan")

    @property
    def spread(self) -> float:
        """Standard deviation over taxels of the count ratio, averaged over the loading branch."""
        return float(self.loading.std(axis=0, ddof=1).mean()) if len(self.loading) > 1 else float("nan")

    @property
    def is_monotonic(self) -> bool:
        """Whether more force never raises a mean count by more than a thousandth of its rest."""
        return bool((np.diff(self.loading.mean(axis=0)) < 1e-3).all())


def smallest_visible(
    force_n: NDArray[np.float64], signal: NDArray[np.float64], error: float, sigmas: float = 3.0
) -> float:
    """Smallest force with a visible signal: where the line through the signals crosses `sigmas` standard errors.

    force_n: f64[k], rising, all small; signal: f64[k], counts; error: standard error of one signal. A straight line
    through the origin is fitted, since a layer is linear at first. NaN if counts do not fall with force at all.
    """
    slope = float(force_n @ signal / (force_n @ force_n))
    return sigmas * error / slope if slope > 0.0 else float("nan")


def first_visible(
    force_n: NDArray[np.float64], signal: NDArray[np.float64], error: float, sigmas: float = 3.0
) -> float:
    """Smallest force of the ladder from which on all signals are `sigmas` standard errors or more; NaN: none."""
    seen = signal > sigmas * error
    hidden = np.nonzero(~seen)[0]
    first = int(hidden[-1]) + 1 if len(hidden) else 0
    return float(force_n[first]) if first < len(force_n) else float("nan")
