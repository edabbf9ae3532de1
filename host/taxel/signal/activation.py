"""Signal and activation of taxels.

Contact lowers a raw count. The signal of a taxel is its baseline minus its raw count, in counts; a taxel is active when
its signal exceeds a threshold.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from taxel.signal._arrays import RAW_COUNT_MAX, check_positive, check_shape, to_validity_mask
from taxel.types import BoolArray, FloatArray

ACTIVATION_THRESHOLD_COUNTS = 150.0
"""Signal, counts, above which a taxel is active. Source: thesis section 3.4. A lower value detects
lighter contacts and more noise."""


@dataclass(frozen=True, eq=False)
class ActivationFrame:
    """Signal and state of each taxel; every field has the shape of the raw counts, [n] or [T, n].

    signal_counts: f64, baseline minus raw count, so contact is positive; NaN where missing.
    active: bool, signal > threshold, strictly; False where missing.
    missing: bool, no valid measurement; such a taxel is neither active nor inactive.
    saturated: bool, the raw count is at most the floor, or 65,535. The true signal may exceed `signal_counts`, or the
        line is broken or shorted. A saturated taxel can be active.
    suspect_baseline: bool, the raw count exceeds the baseline by more than the threshold. Contact cannot raise a raw
        count, so the taxel was touched during the baseline, or the baseline has drifted.
    """

    signal_counts: FloatArray
    active: BoolArray
    missing: BoolArray
    saturated: BoolArray
    suspect_baseline: BoolArray


class Activation:
    """Comparison of raw counts with a baseline: signal = baseline - raw count; active if signal > threshold, strictly.

    baseline_mean: f64[n], counts, all finite.
    threshold: counts, above 0. Default and definition: thesis section 3.4.
    saturation_floor_counts: f64[n] or one number, counts; a raw count at or below it is saturated. None: 0, the end of
        the u16 range.

    The definition has a single threshold, so there is no hysteresis.
    Raises ValueError for a wrong shape, a baseline or floor that is not finite, or a threshold that is not positive.
    """

    def __init__(
        self,
        baseline_mean: npt.ArrayLike,
        threshold: float = ACTIVATION_THRESHOLD_COUNTS,
        saturation_floor_counts: npt.ArrayLike | None = None,
    ) -> None:
        """Prepare the comparison of raw counts with a baseline.

        baseline_mean: f64[n], counts, finite. threshold: signal (baseline minus raw count) above which a taxel is
        active, counts. saturation_floor_counts: f64[n] or one number; a raw count at or below this floor is saturated;
        None: 0. Raises ValueError for a wrong shape, a number that is not finite, or a threshold that is not positive.
        """
        mean = np.array(baseline_mean, dtype=np.float64)
        check_shape("baseline_mean", mean, (1,), None)
        if not np.isfinite(mean).all():
            first = int(np.flatnonzero(~np.isfinite(mean))[0])
            raise ValueError(
                f"baseline_mean: expected finite counts, found {mean[first]} at taxel {first}; complete the baseline"
            )
        self.baseline_mean: FloatArray = mean
        self.threshold = check_positive("threshold", threshold)
        self.saturation_floor_counts = _expand_floor(saturation_floor_counts, mean.size)

    @property
    def n_taxels(self) -> int:
        """Number of taxels of a frame."""
        return int(self.baseline_mean.size)

    def __call__(self, raw_counts: npt.ArrayLike, valid: npt.ArrayLike | None = None) -> ActivationFrame:
        """Determine signal, activity and validity of each taxel from raw counts; every sample is evaluated separately.

        raw_counts: u16 or float counts (a mean of frames), [n] or [T, n]; NaN is missing. valid: for [n] a bool or
        bool[n]; for [T, n] a bool, bool[T] (whole frames) or bool[T, n]. Returns an ActivationFrame of the same shape.
        Raises ValueError for a wrong shape or dtype, or a valid count outside 0..65,535.
        """
        raw = np.asarray(raw_counts)
        check_shape("raw_counts", raw, (1, 2), self.n_taxels)
        if raw.dtype.kind not in "iuf":
            raise ValueError(f"raw_counts: expected integers or floats, found dtype {raw.dtype}")
        counts = raw.astype(np.float64)
        counts[~to_validity_mask(valid, raw.shape)] = np.nan
        if ((counts < 0) | (counts > RAW_COUNT_MAX)).any():
            found = f"{np.nanmin(counts):g}..{np.nanmax(counts):g}"
            raise ValueError(f"raw_counts: expected 0..{RAW_COUNT_MAX}, found {found}")
        return self._evaluate(counts, self._is_saturated(counts))

    def _is_saturated(self, counts: npt.NDArray[np.uint16] | FloatArray) -> BoolArray:
        """Whether each sample is at a limit of the converter: at most the saturation floor, or the largest count."""
        is_saturated: BoolArray = (counts <= self.saturation_floor_counts) | (counts >= RAW_COUNT_MAX)
        return is_saturated

    def _evaluate(self, counts: FloatArray, saturated: BoolArray) -> ActivationFrame:
        """Compare counts of one or many frames, f64[n] or f64[T, n], with the baseline; NaN is a missing taxel.

        saturated: whether each count is saturated, bool of the same shape.
        """
        signal = self.baseline_mean - counts
        # A comparison with NaN is False, so a missing taxel is neither active nor suspect.
        return ActivationFrame(
            signal_counts=signal,
            active=signal > self.threshold,
            missing=np.isnan(counts),
            saturated=saturated,
            suspect_baseline=-signal > self.threshold,
        )


def _expand_floor(floor: npt.ArrayLike | None, n_taxels: int) -> FloatArray:
    """Return the saturation floor of each taxel, counts, f64[n]; None gives 0. Raises ValueError for another shape."""
    if floor is None:
        return np.zeros(n_taxels)
    values = np.asarray(floor, dtype=np.float64)
    if values.shape not in ((), (n_taxels,)):
        raise ValueError(f"saturation_floor_counts: expected a number or shape ({n_taxels},), found {values.shape}")
    if not (np.isfinite(values).all() and (values >= 0).all()):
        raise ValueError("saturation_floor_counts: expected finite counts of 0 or more")
    return np.broadcast_to(values, (n_taxels,)).copy()
