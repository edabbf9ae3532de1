"""Parts of injected causes that several functional forms share."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from taxel.blind.injection.skin_counts import GraspSignal, Injection, SkinTable
from taxel.types import FloatArray


def spread(kernel: FloatArray, keeps_total: bool) -> Injection:
    """Make the injection in which every taxel passes a share of its signal to others with the weights of a kernel.

    kernel: f64[n, n], not normalised. keeps_total: whether the share is subtracted from the signal of the taxel.
    """
    kernel = kernel / np.maximum(kernel.sum(axis=1, keepdims=True), 1e-12)

    def inject(grasp: GraspSignal, strength: float) -> FloatArray:
        """Pass a share of each signal f64[T, n] to other taxels. strength: this share, limited to 0.9."""
        share = min(strength, 0.9)
        kept = (1.0 - share) if keeps_total else 1.0
        return kept * grasp.signal + share * (grasp.signal @ kernel)

    return inject


def kill(dead: np.ndarray) -> Injection:
    """Make the injection that replaces the signals of the taxels with the indices `dead` by noise of 4 counts."""

    def inject(grasp: GraspSignal, strength: float) -> FloatArray:
        """Replace the signals of the dead taxels by noise of 4 counts; any strength above 0 has the same result."""
        result = grasp.signal.copy()
        if strength > 0.0:
            result[:, dead] = grasp.rng.normal(0.0, 4.0, (len(result), len(dead)))
        return result

    return inject


def choose_boards(skin: SkinTable, rng: np.random.Generator, most: int) -> list[np.ndarray]:
    """Choose one to `most` boards."""
    count = min(int(rng.integers(1, most + 1)), len(skin.boards))
    return [skin.boards[index] for index in rng.permutation(len(skin.boards))[:count]]


def low_pass(values: FloatArray, share: float) -> FloatArray:
    """Apply a first-order low-pass filter along the frames. share: share of a step that passes in one frame."""
    return np.asarray(lfilter([share], [1.0, share - 1.0], values, axis=0))


def delay(values: FloatArray, time_s: FloatArray, delay_s: float | FloatArray) -> FloatArray:
    """Delay the values f64[T, m] by `delay_s`, one number or f64[T], with linear interpolation between frames."""
    at = np.interp(time_s - delay_s, time_s, np.arange(len(time_s)))
    low = np.floor(at).astype(int)
    high = np.minimum(low + 1, len(time_s) - 1)
    share = (at - low)[:, None]
    return np.asarray((1.0 - share) * values[low] + share * values[high])
