"""Detection of a touch while the baseline is taken.

Problem: the baseline is the mean of about 100 samples, so a touch during some of them shifts the baseline, and every
later signal is too small by this shift. The test must detect a touch and must ignore white noise, single-sample
impulses and slow drift.

Test 1: running median over 13 consecutive samples, with the last sample followed by the first. A median of 13 ignores
up to 6 impulses, and follows a touch of 7 or more samples. A taxel is disturbed if its largest and smallest running
medians differ by more than the limit (90 counts). The difference is used instead of an absolute level, so that touches
of a tenth and of nine tenths of the samples are detected equally; the circular window detects a touch of nine tenths
at any position.

Test 2 detects many short taps, which a running median ignores: the mean differs from the median of all samples by more
than half the limit. Impulses of 256 counts on 17 of 100 samples, all with the same sign, still pass this test.

Derivation of the window and the limit, for 100 samples and the largest expected white noise of sigma 28 counts:

- False alarm: for two disjoint windows the probability that their medians differ by more than 90 counts is
  5.4e-11 (the median of 13 normal values has a known distribution, David and Nagaraja, Order Statistics,
  2003, section 2.1). Summed over the 4,950 pairs of windows this bounds the probability to 2.7e-7 per taxel,
  2.9e-4 for a skin of 1,073 taxels. Overlapping windows differ less: in 20 million simulated taxels there was
  no false alarm at 90 counts, and a tenth of the bound at 75 counts. At sigma 20 the bound is 6e-13 for the whole skin.
- Miss: of 20 million simulated touches of 150 counts per duration, 4 were missed with a duration of 10 of the
  100 samples, none with 50, and 5 with 90.
- Rejected: a limit of half the activation threshold (75 counts), which gives a false alarm on one skin in fifty at
  sigma 28; a window of 15 samples, which misses about 90 times more of the 10-sample touches.

A baseline that drifts by more than the limit while it is taken is also reported as disturbed.

Not detectable from the samples: a touch that covers all of them, or all but 6. After its release the raw count exceeds
the baseline, which `Activation` reports as `suspect_baseline`.
"""

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from taxel.signal._arrays import check_positive, to_raw_count_array
from taxel.types import BoolArray, CountArray, IntArray

DISTURBANCE_LIMIT_COUNTS = 90.0
"""Largest difference of running medians of an undisturbed taxel, counts; 0.6 of the activation threshold.

Derived in the module docstring. A lower limit gives more false alarms, a higher limit misses light touches."""

MEDIAN_WINDOW_SAMPLES = 13
"""Window of the running median, samples; odd, so that the median is a sample. Derived in the module docstring."""

MEAN_SHIFT_SHARE = 0.5
"""Largest difference between mean and median, as a fraction of the limit. Derived in the module docstring."""


def find_disturbed_taxels(
    samples: npt.ArrayLike, max_disturbance_counts: float = DISTURBANCE_LIMIT_COUNTS
) -> BoolArray:
    """Return the taxels that were touched while `samples` were taken, bool[n].

    samples: raw counts u16[K, n] of the baseline, oldest first, all valid. max_disturbance_counts: largest difference
    of running medians, counts, of an undisturbed taxel.

    Detected: a touch of 150 counts or more for 10 to K - 10 consecutive samples, and short taps that shift the mean by
    more than half the limit. Not detected: a touch during all K samples. With K of 13 or fewer only the mean is
    tested. False alarms and misses: module docstring.

    Raises ValueError for a wrong shape or dtype, no samples, or a limit that is not positive.
    """
    raw = to_raw_count_array(samples, 2)
    limit = check_positive("max_disturbance_counts", max_disturbance_counts)
    if raw.shape[0] == 0:
        raise ValueError("samples: expected at least 1 sample per taxel, found 0")
    medians = _compute_running_medians(raw)
    median_range = medians.max(axis=0) - medians.min(axis=0)
    mean_shift = np.abs(raw.sum(axis=0, dtype=np.int64) / raw.shape[0] - np.median(raw, axis=0))
    disturbed: BoolArray = (median_range > limit) | (mean_shift > limit * MEAN_SHIFT_SHARE)
    return disturbed


def _compute_running_medians(raw: CountArray) -> IntArray:
    """Compute the running median of each taxel over K scans u16[K, n]: i64[K, n], counts."""
    window = min(MEDIAN_WINDOW_SAMPLES, raw.shape[0])
    # Circular: an untouched interval that a long touch splits in two still fills a window.
    ring = np.concatenate([raw, raw[: window - 1]])
    windows = sliding_window_view(ring, window, axis=0)
    middle = window // 2
    medians: IntArray = np.partition(windows, middle, axis=-1)[..., middle].astype(np.int64)
    return medians
