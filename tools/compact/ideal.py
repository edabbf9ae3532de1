"""Lower bounds for the size of coded raw counts: entropy of noise, and costs of ideal predictors."""

import math
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from taxel.types import IntArray

CAUCHY_SHARE = 0.005
CAUCHY_WIDTH = 3.0
REACH = 8.0
"""The distribution of SPEC.md, "Coding of compact snapshots": normal plus Cauchy, truncated at REACH scales."""
GAINS = (1 / 4, 1 / 8, 1 / 16, 1 / 32)
JUMPS = (4.0, 6.0, 8.0)
WARM_UP = 60
"""Frames at the start of a recording whose costs are not counted."""


def compute_noise_entropy(sigma: float, phases: int = 64) -> float:
    """Compute the entropy in bits of a normal random number rounded to an integer, with a known mean.

    sigma: standard deviation, in rounding steps. phases: the entropy depends on the fractional part of the mean, so the
    result is the average over `phases` equidistant fractional parts 0, 1 / phases, ...
    """
    reach = math.ceil(10 * sigma) + 2
    k = np.arange(-reach, reach + 1)[:, None]
    mean = np.arange(phases)[None, :] / phases
    share = ndtr((k + 0.5 - mean) / sigma) - ndtr((k - 0.5 - mean) / sigma)
    return float(-(share * np.log2(np.maximum(share, 1e-300))).sum(axis=0).mean())


def _compute_cumulative(distance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the cumulative distribution function with which the compact coder models a count's residual.

    distance: residual divided by the taxel's scale. The density is a normal one plus a small share of a Cauchy one.
    """
    limited = np.clip(distance, -REACH, REACH)
    wide = 0.5 + np.arctan(limited / CAUCHY_WIDTH) / (2 * math.atan(REACH / CAUCHY_WIDTH))
    probability: NDArray[np.float64] = (1 - CAUCHY_SHARE) * ndtr(limited) + CAUCHY_SHARE * wide
    return probability


def _compute_cost(counts: IntArray, mean: NDArray[np.float64], scale: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the bits that an ideal coder needs for each count.

    mean, scale: assumed parameters of each count's distribution. A count beyond the distribution's truncation costs 14
    bits plus the bits of its distance.
    """
    share = _compute_cumulative((counts + 0.5 - mean) / scale) - _compute_cumulative((counts - 0.5 - mean) / scale)
    # 9 bits announce the escape (probability 2^-9), and 5 bits state the sign and the number of bits of the distance.
    escape_bits = 9 + 5 + np.floor(np.log2(np.maximum(np.abs(counts - mean), 1.0)))
    return np.where(share > 2.0**-16, -np.log2(np.maximum(share, 2.0**-16)), escape_bits)


def compute_predictor_bits(counts: IntArray, mean_gain: float, scale_gain: float, jump: float) -> float:
    """Compute the bits per count of a predictor whose mean and scale follow the counts of every frame.

    counts: i64[T, n], T frames of n taxels. mean_gain, scale_gain: share of a deviation by which the mean, and the
    logarithm of the scale, follow it. jump: deviation in scales from which the mean follows a count at once. The scale
    grows with deviations above sqrt(2 / pi) scales, the mean deviation of a normal distribution, and shrinks with
    smaller ones; a deviation counts as at most 4 scales.
    """
    mean = counts[0].astype(float)
    scale = np.full(counts.shape[1], 4.0)
    total = 0.0
    for t in range(1, len(counts)):
        if t >= WARM_UP:
            total += float(_compute_cost(counts[t], mean, scale).sum())
        residual = counts[t] - mean
        size = np.abs(residual) / scale
        # In the first frames, a gain of 1 / (t + 1) makes the mean the average of all counts so far.
        gain = np.where(size >= jump, 1.0, max(mean_gain, 1 / (t + 1)))
        step = np.minimum(size, 4.0) * math.sqrt(math.pi / 2) - 1.0
        scale = np.where(size >= jump, scale, scale * np.exp(max(scale_gain, 1 / (t + 1)) * step))
        scale = np.clip(scale, 1 / 16, 4096.0)
        mean = mean + gain * residual
    return float(total / ((len(counts) - WARM_UP) * counts.shape[1]))


def compute_recording_entropy(counts: IntArray) -> float:
    """Compute the bits per count of the predictor that is best in hindsight.

    It codes every frame without delay, rounding and padding to bytes. counts: i64[T, n], T frames of n taxels.
    """
    return min(compute_predictor_bits(counts, *parameters) for parameters in product(GAINS, GAINS, JUMPS))
