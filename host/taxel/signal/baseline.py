"""The baseline of each taxel: the plain mean of its first valid samples."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from taxel.signal._arrays import positive, raw_count_array, validity_mask
from taxel.signal.disturbance import DISTURBANCE_LIMIT_COUNTS, find_disturbed_taxels
from taxel.signal.errors import DisturbedBaselineError, TooFewSamplesError
from taxel.types import BoolArray, CountArray, FloatArray, IntArray

# Samples per taxel. Source: thesis, section 5.4 ("100 sampled readings").
BASELINE_SAMPLES = 100

# Samples. Above this K * (sum of squares of K u16 values) could pass 2**63: K**2 * 65535**2 < 2**63.
MAX_BASELINE_SAMPLES = 46_340


@dataclass(frozen=True, eq=False)
class BaselineResult:
    """A complete baseline of n taxels.

    mean: f64[n], counts, plain mean of the samples, also for a disturbed taxel.
    noise: f64[n], counts, standard deviation of the same samples with K - 1 in the denominator.
    disturbed: bool[n], touched while the samples were taken (see `disturbance.py` for what can be seen).
    count: int64[n], samples used.
    """

    mean: FloatArray
    noise: FloatArray
    disturbed: BoolArray
    count: IntArray

    def require_undisturbed(self) -> None:
        """Raise DisturbedBaselineError, naming the taxels, if any was disturbed."""
        if self.disturbed.any():
            raise DisturbedBaselineError(np.flatnonzero(self.disturbed).tolist(), self.disturbed.size)


class Baseline:
    """Takes the baseline frame by frame; each taxel counts its own valid samples.

    n_taxels: columns of every frame.
    samples: valid samples that make a baseline, 2 to 46,340.
    max_disturbance_counts: limit of the touch test in `disturbance.py`, counts.

    Samples are kept (K x n x 2 bytes) and all sums are exact integers, so the result equals that of
    `compute_baseline` to the last bit. Once a taxel is complete it takes no more. A disturbed baseline is
    reported, never repaired. A touch that lasts through all the samples cannot be told from a taxel that
    rests lower; `Activation` marks it as `suspect_baseline` after it has been released.

    Raises ValueError for a parameter out of range.
    """

    def __init__(
        self,
        n_taxels: int,
        samples: int = BASELINE_SAMPLES,
        max_disturbance_counts: float = DISTURBANCE_LIMIT_COUNTS,
    ) -> None:
        if n_taxels < 1:
            raise ValueError(f"n_taxels: expected at least 1, found {n_taxels}")
        self.n_taxels = n_taxels
        self.samples = _sample_count(samples)
        self.max_disturbance_counts = positive("max_disturbance_counts", max_disturbance_counts)
        self.reset()

    def reset(self) -> None:
        """Forget all samples and start again."""
        self._kept: CountArray = np.zeros((self.samples, self.n_taxels), dtype=np.uint16)
        self._count: IntArray = np.zeros(self.n_taxels, dtype=np.int64)

    def update(self, raw_counts: npt.ArrayLike, valid: npt.ArrayLike | None = None) -> bool:
        """Take one frame; True once every taxel is complete.

        raw_counts: u16[n]. valid: bool for the whole frame or bool[n]; a sample that is not valid contributes
        nothing. Raises ValueError for a wrong shape or dtype.
        """
        raw = raw_count_array(raw_counts, 1, self.n_taxels)
        wanted = validity_mask(valid, raw.shape) & ~self.ready_mask
        taxels = np.flatnonzero(wanted)
        self._kept[self._count[taxels], taxels] = raw[taxels]
        self._count[taxels] += 1
        return self.ready

    @property
    def ready_mask(self) -> BoolArray:
        """bool[n], which taxels are complete."""
        mask: BoolArray = self._count >= self.samples
        return mask

    @property
    def ready(self) -> bool:
        """Whether every taxel is complete."""
        return bool(self.ready_mask.all())

    @property
    def progress(self) -> float:
        """Share of the needed samples that have come, 0 to 1; 1 only when ready."""
        return int(self._count.sum()) / (self.samples * self.n_taxels)

    @property
    def count(self) -> IntArray:
        """int64[n], valid samples taken so far."""
        return self._count.copy()

    @property
    def mean(self) -> FloatArray:
        """f64[n], counts; NaN where not complete."""
        return self._where_ready(_mean_and_noise(self._kept)[0])

    @property
    def noise(self) -> FloatArray:
        """f64[n], standard deviation in counts; NaN where not complete."""
        return self._where_ready(_mean_and_noise(self._kept)[1])

    @property
    def disturbed(self) -> BoolArray:
        """bool[n], touched while the samples were taken; False where not complete."""
        return find_disturbed_taxels(self._kept, self.max_disturbance_counts) & self.ready_mask

    def result(self) -> BaselineResult:
        """The complete baseline; raises TooFewSamplesError before `ready`."""
        return _summary(self._kept, self._count, self.max_disturbance_counts)

    def require_undisturbed(self) -> None:
        """Raise DisturbedBaselineError if a taxel was disturbed, TooFewSamplesError before `ready`."""
        self.result().require_undisturbed()

    def _where_ready(self, values: FloatArray) -> FloatArray:
        return np.where(self.ready_mask, values, np.nan)


def compute_baseline(
    raw_counts: npt.ArrayLike,
    valid: npt.ArrayLike | None = None,
    samples: int = BASELINE_SAMPLES,
    max_disturbance_counts: float = DISTURBANCE_LIMIT_COUNTS,
) -> BaselineResult:
    """The baseline from the first `samples` valid samples of each taxel in a recording.

    raw_counts: u16[T, n]. valid: bool, bool[T] (whole frames) or bool[T, n]. samples: 2 to 46,340.
    max_disturbance_counts: limit of the touch test in `disturbance.py`, counts.

    Raises TooFewSamplesError if a taxel has fewer valid samples, ValueError for a wrong shape, dtype or
    parameter.
    """
    needed = _sample_count(samples)
    limit = positive("max_disturbance_counts", max_disturbance_counts)
    raw = raw_count_array(raw_counts, 2)
    mask = validity_mask(valid, raw.shape)
    order = np.cumsum(mask, axis=0, dtype=np.int64)
    frames, taxels = np.nonzero(mask & (order <= needed))
    kept = np.zeros((needed, raw.shape[1]), dtype=np.uint16)
    kept[order[frames, taxels] - 1, taxels] = raw[frames, taxels]
    count = np.minimum(mask.sum(axis=0, dtype=np.int64), needed)
    return _summary(kept, count, limit)


def _summary(kept: CountArray, count: IntArray, limit: float) -> BaselineResult:
    worst = int(np.argmin(count))
    if count[worst] < kept.shape[0]:
        raise TooFewSamplesError(worst, needed=kept.shape[0], found=int(count[worst]))
    mean, noise = _mean_and_noise(kept)
    return BaselineResult(mean, noise, find_disturbed_taxels(kept, limit), count.copy())


def _mean_and_noise(kept: CountArray) -> tuple[FloatArray, FloatArray]:
    k = kept.shape[0]
    counts = kept.astype(np.int64)
    total = counts.sum(axis=0)
    # K * sum(x^2) - sum(x)^2 in exact integers: no rounding before the one division.
    scatter = k * (counts * counts).sum(axis=0) - total * total
    return total / k, np.sqrt(scatter / (k * (k - 1)))


def _sample_count(samples: int) -> int:
    if not 2 <= samples <= MAX_BASELINE_SAMPLES:
        raise ValueError(f"samples: expected 2 to {MAX_BASELINE_SAMPLES}, found {samples}")
    return int(samples)
