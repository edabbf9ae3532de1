"""Loading and unloading curves: raw counts over force (thesis, Figure 2.5), and the smallest detectable force."""

from dataclasses import dataclass

import numpy as np

from taxel.types import FloatArray


@dataclass(frozen=True, eq=False)
class Curve:
    """Loading curve of several taxels.

    `force_n` f64[k], increasing; `loading`, `unloading` f64[taxels, k]: raw count relative to the raw count at rest.
    """

    force_n: FloatArray
    loading: FloatArray
    unloading: FloatArray

    @property
    def hysteresis(self) -> float:
        """Hysteresis of the loading curve, 0 to 1.

        Largest distance of the mean loading and unloading branches, relative to the range of the mean loading
        branch.
        """
        loading, unloading = self.loading.mean(axis=0), self.unloading.mean(axis=0)
        span = float(loading.max() - loading.min())
        return float(np.abs(unloading - loading).max()) / span if span > 0.0 else float("nan")

    @property
    def area(self) -> float:
        """Area between the mean loading and unloading branches, relative to the area under the loading branch, 0 to
        1.
        """
        loading, unloading = self.loading.mean(axis=0), self.unloading.mean(axis=0)
        under = _integrate(loading[0] - loading, self.force_n)
        between = _integrate(np.abs(loading - unloading), self.force_n)
        return between / under if under > 0.0 else float("nan")

    @property
    def saturation_n(self) -> float:
        """Force in N at which the mean loading branch has reached 95 % of its change of counts, interpolated."""
        fall = self.loading.mean(axis=0)[0] - self.loading.mean(axis=0)
        target = 0.95 * float(fall[-1])
        # np.interp requires increasing values, but noise can reduce the fall from one force to the next.
        return float(np.interp(target, np.maximum.accumulate(fall), self.force_n)) if target > 0.0 else float("nan")

    @property
    def spread(self) -> float:
        """Standard deviation of the relative counts between taxels, averaged over the loading branch."""
        return float(self.loading.std(axis=0, ddof=1).mean()) if len(self.loading) > 1 else float("nan")

    @property
    def is_monotonic(self) -> bool:
        """Whether no step of the force increases the mean relative count by more than 0.001."""
        return bool((np.diff(self.loading.mean(axis=0)) < 1e-3).all())


def _integrate(values: FloatArray, positions: FloatArray) -> float:
    """Integrate `values` f64[k] over `positions` f64[k] by the trapezoidal rule (`numpy.trapezoid` needs numpy 2)."""
    return float((np.diff(positions) * (values[1:] + values[:-1]) / 2.0).sum())


def extrapolate_detectable_force(force_n: FloatArray, signal: FloatArray, error: float, sigmas: float = 3.0) -> float:
    """Extrapolate the smallest detectable force in N from the signals of small forces.

    At this force, a line through the signals reaches `sigmas` standard errors. force_n: f64[k], increasing;
    signal: f64[k], in counts; error: standard error of one signal. The line passes through the origin, because the
    response of a layer is linear for small forces. Returns NaN without a positive slope.
    """
    slope = float(force_n @ signal / (force_n @ force_n))
    return sigmas * error / slope if slope > 0.0 else float("nan")


def find_first_detected_force(force_n: FloatArray, signal: FloatArray, error: float, sigmas: float = 3.0) -> float:
    """Return the smallest tested force in N from which on all signals exceed `sigmas` standard errors, or NaN.

    force_n: f64[k], increasing; signal: f64[k], in counts; error: standard error of one signal.
    """
    is_detected = signal > sigmas * error
    undetected = np.nonzero(~is_detected)[0]
    first = int(undetected[-1]) + 1 if len(undetected) else 0
    return float(force_n[first]) if first < len(force_n) else float("nan")
