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
    """Entropy in bits of a rounded normal random number with known mean and standard deviation `sigma`.

    The result is the mean over `phases` uniformly distributed fractions of the mean.
    """
    reach = math.ceil(10 * sigma) + 2
    k = np.arange(-reach, reach + 1)[:, None]
    mean = np.arange(phases)[None, :] / phases
    share = ndtr((k + 0.5 - mean) / sigma) - ndtr((k - 0.5 - mean) / sigma)
    return float(-(share * np.log2(np.maximum(share, 1e-300))).sum(axis=0).mean())


def _compute_cumulative(distance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cumulative distribution function with which the compact coder models the residual of a count.

    distance: residual divided by the scale of the taxel. The density is a normal one plus a small share of a Cauchy
    one.
    """
    limited = np.clip(distance, -REACH, REACH)
    wide = 0.5 + np.arctan(limited / CAUCHY_WIDTH) / (2 * math.atan(REACH / CAUCHY_WIDTH))
    probability: NDArray[np.float64] = (1 - CAUCHY_SHARE) * ndtr(limited) + CAUCHY_SHARE * wide
    return probability


def _compute_cost(counts: IntArray, mean: NDArray[np.float64], scale: NDArray[np.float64]) -> NDArray[np.float64]:
    """Bits that an ideal coder needs for each count, with the assumed mean and scale of the count's distribution.

    A count beyond the truncation of the distribution costs 14 bits plus the bits of its distance.
    """
    share = _compute_cumulative((counts + 0.5 - mean) / scale) - _compute_cumulative((counts - 0.5 - mean) / scale)
    escape_bits = 9 + 5 + np.floor(np.log2(np.maximum(np.abs(counts - mean), 1.0)))
    return np.where(share > 2.0**-16, -np.log2(np.maximum(share, 2.0**-16)), escape_bits)


def compute_predictor_bits(counts: IntArray, mean_gain: float, scale_gain: float, jump: float) -> float:
    """Bits per count of a predictor with sliding mean and scale, updated by every frame. counts: i[T, n].

    jump: distance in scales from which the mean follows a count at once.
    """
    mean = counts[0].astype(float)
    scale = np.full(counts.shape[1], 4.0)
    total = 0.0
    for t in range(1, len(counts)):
        if t >= WARM_UP:
            total += float(_compute_cost(counts[t], mean, scale).sum())
        residual = counts[t] - mean
        size = np.abs(residual) / scale
        gain = np.where(size >= jump, 1.0, max(mean_gain, 1 / (t + 1)))
        step = np.minimum(size, 4.0) * math.sqrt(math.pi / 2) - 1.0
        scale = np.where(size >= jump, scale, scale * np.exp(max(scale_gain, 1 / (t + 1)) * step))
        scale = np.clip(scale, 1 / 16, 4096.0)
        mean = mean + gain * residual
    return float(total / ((len(counts) - WARM_UP) * counts.shape[1]))


def compute_recording_entropy(counts: IntArray) -> float:
    """Bits per count of the best predictor, selected in hindsight, without delay, rounding and padding to bytes."""
    return min(compute_predictor_bits(counts, *parameters) for parameters in product(GAINS, GAINS, JUMPS))
