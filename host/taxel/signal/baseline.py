"""Baseline of each taxel: the arithmetic mean of its first valid samples."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from taxel.signal._arrays import check_positive, to_raw_count_array, to_validity_mask
from taxel.signal.disturbance import DISTURBANCE_LIMIT_COUNTS, find_disturbed_taxels
from taxel.signal.errors import DisturbedBaselineError, TooFewSamplesError
from taxel.types import BoolArray, CountArray, FloatArray, IntArray

BASELINE_SAMPLES = 100
"""Default number of samples of each taxel in the baseline. Source: thesis, section 5.4 ("100 sampled readings")."""

MAX_BASELINE_SAMPLES = 46_340
"""Largest number K of samples for which K times the sum of K squared u16 values fits in 63 bits."""


@dataclass(frozen=True, eq=False)
class BaselineResult:
    """Complete baseline of n taxels.

    mean: f64[n], counts, arithmetic mean of the samples, also for a disturbed taxel.
    noise: f64[n], counts, standard deviation of the same samples with K - 1 in the denominator.
    disturbed: bool[n], touched while the samples were taken (detectable cases: see `disturbance.py`).
    count: int64[n], number of samples used.
    """

    mean: FloatArray
    noise: FloatArray
    disturbed: BoolArray
    count: IntArray

    def require_undisturbed(self) -> None:
        """Raise DisturbedBaselineError, which names the taxels, if a taxel was touched during the baseline."""
        if self.disturbed.any():
            raise DisturbedBaselineError(np.flatnonzero(self.disturbed).tolist(), self.disturbed.size)


class Baseline:
    """Baseline from successive frames; the valid samples of each taxel are counted separately.

    All samples are stored (2 bytes each) and all sums are exact integers, so the result is identical to the result of
    `compute_baseline`. A taxel with enough samples ignores further ones. A disturbed baseline is reported, never
    corrected. A touch during all samples cannot be distinguished from a lower baseline; after its release, `Activation`
    reports it as `suspect_baseline`.
    """

    def __init__(
        self,
        n_taxels: int,
        samples: int = BASELINE_SAMPLES,
        max_disturbance_counts: float = DISTURBANCE_LIMIT_COUNTS,
    ) -> None:
        """Create an empty baseline for frames of `n_taxels` taxels.

        samples: number of valid samples of each taxel in a complete baseline, 2 to 46,340. max_disturbance_counts:
        limit of the test for a touch during the baseline, counts. Raises ValueError for a parameter out of range.
        """
        if n_taxels < 1:
            raise ValueError(f"n_taxels: expected at least 1, found {n_taxels}")
        self.n_taxels = n_taxels
        self.samples = _check_sample_count(samples)
        self.max_disturbance_counts = check_positive("max_disturbance_counts", max_disturbance_counts)
        self.reset()

    def reset(self) -> None:
        """Discard all samples of the baseline."""
        self._stored: CountArray = np.zeros((self.samples, self.n_taxels), dtype=np.uint16)
        self._count: IntArray = np.zeros(self.n_taxels, dtype=np.int64)

    def update(self, raw_counts: npt.ArrayLike, valid: npt.ArrayLike | None = None) -> bool:
        """Add one frame to the baseline; return whether every taxel has enough samples.

        raw_counts: u16[n]. valid: bool for the whole frame or bool[n]; invalid samples are ignored. Raises ValueError
        for a wrong shape or dtype.
        """
        raw = to_raw_count_array(raw_counts, 1, self.n_taxels)
        taxels = np.flatnonzero(to_validity_mask(valid, raw.shape) & ~self.ready_mask)
        self._stored[self._count[taxels], taxels] = raw[taxels]
        self._count[taxels] += 1
        return self.is_ready

    @property
    def ready_mask(self) -> BoolArray:
        """Taxels with a complete baseline, bool[n]."""
        mask: BoolArray = self._count >= self.samples
        return mask

    @property
    def is_ready(self) -> bool:
        """Whether every taxel has the required number of valid samples."""
        return bool(self.ready_mask.all())

    @property
    def progress(self) -> float:
        """Received share of the required samples, 0 to 1; 1 only when `is_ready`."""
        return int(self._count.sum()) / (self.samples * self.n_taxels)

    @property
    def count(self) -> IntArray:
        """Number of valid samples per taxel, int64[n]."""
        return self._count.copy()

    @property
    def mean(self) -> FloatArray:
        """Mean of the samples, f64[n], counts; NaN where not complete."""
        return self._mask_unready(_compute_mean_and_noise(self._stored)[0])

    @property
    def noise(self) -> FloatArray:
        """Standard deviation of the samples, f64[n], counts; NaN where not complete."""
        return self._mask_unready(_compute_mean_and_noise(self._stored)[1])

    @property
    def disturbed(self) -> BoolArray:
        """Taxels touched while the samples were taken, bool[n]; False where not complete."""
        return find_disturbed_taxels(self._stored, self.max_disturbance_counts) & self.ready_mask

    def result(self) -> BaselineResult:
        """Return the complete baseline; raises TooFewSamplesError before `is_ready`."""
        return _build_result(self._stored, self._count, self.max_disturbance_counts)

    def require_undisturbed(self) -> None:
        """Raise DisturbedBaselineError if a taxel was disturbed, TooFewSamplesError before `is_ready`."""
        self.result().require_undisturbed()

    def _mask_unready(self, values: FloatArray) -> FloatArray:
        """Return the values f64[n] with NaN for taxels whose baseline is not complete."""
        return np.where(self.ready_mask, values, np.nan)


def compute_baseline(
    raw_counts: npt.ArrayLike,
    valid: npt.ArrayLike | None = None,
    samples: int = BASELINE_SAMPLES,
    max_disturbance_counts: float = DISTURBANCE_LIMIT_COUNTS,
) -> BaselineResult:
    """Compute the baseline from the first `samples` valid samples of each taxel in a recording.

    raw_counts: u16[T, n]. valid: bool, bool[T] (whole frames) or bool[T, n]. samples: 2 to 46,340.
    max_disturbance_counts: limit of the touch test in `disturbance.py`, counts.

    Raises TooFewSamplesError if a taxel has fewer valid samples, ValueError for a wrong shape, dtype or
    parameter.
    """
    required = _check_sample_count(samples)
    limit = check_positive("max_disturbance_counts", max_disturbance_counts)
    raw = to_raw_count_array(raw_counts, 2)
    mask = to_validity_mask(valid, raw.shape)
    order = np.cumsum(mask, axis=0, dtype=np.int64)
    frames, taxels = np.nonzero(mask & (order <= required))
    stored = np.zeros((required, raw.shape[1]), dtype=np.uint16)
    stored[order[frames, taxels] - 1, taxels] = raw[frames, taxels]
    count = np.minimum(mask.sum(axis=0, dtype=np.int64), required)
    return _build_result(stored, count, limit)


def _build_result(stored: CountArray, count: IntArray, limit: float) -> BaselineResult:
    """Compute the baseline from K stored scans u16[K, n]; count: i64[n], stored samples of each taxel.

    limit: largest difference of running medians of an undisturbed taxel, counts. Raises TooFewSamplesError for a taxel
    with fewer than K samples.
    """
    worst = int(np.argmin(count))
    if count[worst] < stored.shape[0]:
        raise TooFewSamplesError(worst, needed=stored.shape[0], found=int(count[worst]))
    mean, noise = _compute_mean_and_noise(stored)
    return BaselineResult(mean, noise, find_disturbed_taxels(stored, limit), count.copy())


def _compute_mean_and_noise(stored: CountArray) -> tuple[FloatArray, FloatArray]:
    """Compute mean and sample standard deviation of each taxel over K scans u16[K, n]: f64[n] each, counts."""
    k = stored.shape[0]
    counts = stored.astype(np.int64)
    total = counts.sum(axis=0)
    # K * sum(x^2) - sum(x)^2 in exact integers: no rounding before the one division.
    squares = k * (counts * counts).sum(axis=0) - total * total
    return total / k, np.sqrt(squares / (k * (k - 1)))


def _check_sample_count(samples: int) -> int:
    """Return `samples` unchanged; raise ValueError for a number outside 2 to `MAX_BASELINE_SAMPLES`."""
    if not 2 <= samples <= MAX_BASELINE_SAMPLES:
        raise ValueError(f"samples: expected 2 to {MAX_BASELINE_SAMPLES}, found {samples}")
    return int(samples)
