"""Was a taxel touched while its baseline was being taken?

Problem: one baseline is a plain mean over about 100 samples, so a touch during some of them shifts it, and
every signal measured afterwards is short by that shift. The test has to see a touch and to ignore white
noise, single-sample impulses and slow drift.

Test: the running median over 13 consecutive samples, the last joined to the first. A median of 13 ignores up
to 6 impulses, and follows a touch held for 7 samples or more. A taxel is disturbed if the highest and the
lowest running median lie further apart than the limit (90 counts). Using the distance between the two, not a
signal below some level, makes it indifferent to whether the touch fills a tenth or nine tenths of the samples;
joining the ends makes it indifferent to where a touch of nine tenths lies.

A second test sees many short taps, which a running median ignores: the mean lies further than half the
limit from the median of all samples, so the mean is not where the taxel rests. Impulses of 256 counts on 17
of 100 samples, all of one sign, still pass it.

How the window and the limit were chosen, for 100 samples and white noise of sigma 28 counts, the worst
expected:

- False alarm: for two separate windows the chance that their medians differ by more than 90 counts is
  5.4e-11 (the median of 13 normal values has a known distribution, David and Nagaraja, Order Statistics,
  2003, section 2.1). Summed over the 4,950 pairs of windows this bounds the chance at 2.7e-7 per taxel,
  2.9e-4 for a skin of 1,073 taxels. Overlapping windows differ less: 20 million simulated taxels gave no
  false alarm at 90 counts, and a tenth of the bound at 75. At sigma 20 the bound is 6e-13 for the whole skin.
- Miss: of 20 million simulated touches of 150 counts each, 4 were missed that held for 10 of the 100 samples,
  none that held for 50, 5 that held for 90.
- Rejected: a limit of half the activation threshold (75 counts), which one skin in fifty would trip at
  sigma 28; a window of 15, which misses some 90 times more of the 10-sample touches.

A baseline that drifts by more than the limit while it is taken is called disturbed too, and rightly so.

Not seen from the samples alone: a touch that covers all of them, or all but 6. It shows later, when it is
released and the raw count rises above the baseline; see `Activation` and its `suspect_baseline`.
"""

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from taxel.signal._arrays import positive, raw_count_array
from taxel.types import BoolArray, CountArray, IntArray

# Counts; 0.6 of the activation threshold. Derived at the top of this file.
DISTURBANCE_LIMIT_COUNTS = 90.0

# Samples; odd, so that a median is one of the samples. Derived at the top of this file.
MEDIAN_WINDOW_SAMPLES = 13

# How far the mean may lie from the median, as a share of the limit. Derived at the top of this file.
MEAN_SHIFT_SHARE = 0.5


def find_disturbed_taxels(samples: npt.ArrayLike, max_disturbance_counts: float = DISTURBANCE_LIMIT_COUNTS) -> BoolArray:
    """Which taxels were touched while `samples` were taken.

    samples: raw counts u16[K, n], the K samples that make the baseline, oldest first, all valid.
    max_disturbance_counts: largest distance between running medians, in counts, that still counts as
    undisturbed.

    Returns bool[n]. A touch of 150 counts or more, held for 10 to K - 10 consecutive samples, is found; so
    are short taps that pull the mean by more than half the limit. A touch over all K samples cannot be
    found here. With K of 13 or fewer only the mean is tested. The method, its false alarms and its misses:
    top of this file.

    Raises ValueError for a wrong shape or dtype, no samples, or a limit that is not positive.
    """
    raw = raw_count_array(samples, 2)
    limit = positive("max_disturbance_counts", max_disturbance_counts)
    if raw.shape[0] == 0:
        raise ValueError("samples: expected at least 1 sample per taxel, found 0")
    medians = _running_medians(raw)
    spread = medians.max(axis=0) - medians.min(axis=0)
    mean_shift = np.abs(raw.sum(axis=0, dtype=np.int64) / raw.shape[0] - np.median(raw, axis=0))
    disturbed: BoolArray = (spread > limit) | (mean_shift > limit * MEAN_SHIFT_SHARE)
    return disturbed


def _running_medians(raw: CountArray) -> IntArray:
    window = min(MEDIAN_WINDOW_SAMPLES, raw.shape[0])
    # The end joins the start, so that rest split in two by a long touch still fills a window.
    ring = np.concatenate([raw, raw[: window - 1]])
    windows = sliding_window_view(ring, window, axis=0)
    middle = window // 2
    medians: IntArray = np.partition(windows, middle, axis=-1)[..., middle].astype(np.int64)
    return medians
