"""What a recording of raw counts costs at least, by the definitions that entropy.py prints."""

import math
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from taxel.types import IntArray

TAIL = 0.005
TAIL_WIDTH = 3.0
REACH = 8.0
GAINS = (1 / 4, 1 / 8, 1 / 16, 1 / 32)
JUMPS = (4.0, 6.0, 8.0)
WARM_UP = 60
"""Frames before a predictor is held to its costs."""


def noise_entropy(sigma: float, phases: int = 64) -> float:
    """Bits of a count that is a normal deviate of known mean and standard deviation `sigma`, rounded.

    The mean is known to the coder; its fraction is uniform over the taxels.
    """
    reach = math.ceil(10 * sigma) + 2
    k = np.arange(-reach, reach + 1)[:, None]
    mean = np.arange(phases)[None, :] / phases
    share = ndtr((k + 0.5 - mean) / sigma) - ndtr((k - 0.5 - mean) / sigma)
    return float(-(share * np.log2(np.maximum(share, 1e-300))).sum(axis=0).mean())


def _cumulative(distance: NDArray[np.float64]) -> NDArray[np.float64]:
    cut = np.clip(distance, -REACH, REACH)
    wide = 0.5 + np.arctan(cut / TAIL_WIDTH) / (2 * math.atan(REACH / TAIL_WIDTH))
    inside: NDArray[np.float64] = (1 - TAIL) * ndtr(cut) + TAIL * wide
    return inside


def _cost(counts: IntArray, mean: NDArray[np.float64], scale: NDArray[np.float64]) -> NDArray[np.float64]:
    """Bits of each count; what lies beyond the reach costs nine bits and its size."""
    share = _cumulative((counts + 0.5 - mean) / scale) - _cumulative((counts - 0.5 - mean) / scale)
    far = 9 + 5 + np.floor(np.log2(np.maximum(np.abs(counts - mean), 1.0)))
    return np.where(share > 2.0**-16, -np.log2(np.maximum(share, 2.0**-16)), far)


def predictor_bits(counts: IntArray, mean_gain: float, scale_gain: float, jump: float) -> float:
    """Bits a count of a predictor that learns from every frame at once: sliding mean and scale, u[T, n] counts."""
    mean = counts[0].astype(float)
    scale = np.full(counts.shape[1], 4.0)
    total = 0.0
    for t in range(1, len(counts)):
        if t >= WARM_UP:
            total += float(_cost(counts[t], mean, scale).sum())
        residual = counts[t] - mean
        size = np.abs(residual) / scale
        gain = np.where(size >= jump, 1.0, max(mean_gain, 1 / (t + 1)))
        step = np.minimum(size, 4.0) * math.sqrt(math.pi / 2) - 1.0
        scale = np.where(size >= jump, scale, scale * np.exp(max(scale_gain, 1 / (t + 1)) * step))
        scale = np.clip(scale, 1 / 16, 4096.0)
        mean = mean + gain * residual
    return float(total / ((len(counts) - WARM_UP) * counts.shape[1]))


def recording_entropy(counts: IntArray) -> float:
    """Bits a count of the best predictor of the class, chosen in hindsight: no delay, no rounding, no whole bytes."""
    return min(predictor_bits(counts, *choice) for choice in product(GAINS, GAINS, JUMPS))
