"""Noise of an untouched skin: white, total, common to a line, drift; and signal to noise."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from taxel.signal._arrays import raw_count_array, validity_mask
from taxel.types import BoolArray, FloatArray, IntArray

# 1 / (third quartile of the standard normal): Rousseeuw and Croux, J. Am. Stat. Assoc. 88 (1993) 1273.
MAD_TO_SIGMA = 1.482602218505602

# The difference of two samples of independent noise has twice their variance: von Neumann et al., Ann.
# Math. Stat. 12 (1941) 153.
DIFFERENCE_TO_SAMPLE = 2.0**-0.5

# A straight line takes two degrees of freedom; one more sample leaves something to measure.
MIN_SAMPLES = 3


@dataclass(frozen=True, eq=False)
class NoiseReport:
    """Noise of n taxels; counts, NaN where a taxel or line has too few valid samples.

    white_sigma: f64[n], sample-to-sample noise, own and shared, blind to drift and to rare impulses.
    total_std: f64[n], standard deviation of everything, drift and impulses included.
    drift_slope: f64[n], counts per sample, least-squares straight line.
    count: int64[n], valid samples.
    lines: int64[L], the line labels in rising order; None if no labels were given.
    common_mode_sigma: f64[L], noise shared by the taxels of a line; NaN for a line of one taxel; None
    without labels.
    """

    white_sigma: FloatArray
    total_std: FloatArray
    drift_slope: FloatArray
    count: IntArray
    lines: IntArray | None
    common_mode_sigma: FloatArray | None


def measure_noise(
    raw_counts: npt.ArrayLike,
    line_of: npt.ArrayLike | None = None,
    valid: npt.ArrayLike | None = None,
) -> NoiseReport:
    """Noise figures of a recording taken with nothing on the skin.

    raw_counts: u16[T, n]. line_of: integer label[n] of the line (TX, RX or board) each taxel sits on.
    valid: a bool, bool[T] (whole frames) or bool[T, n].

    white_sigma = 1.4826 * median(abs(first differences)) / sqrt(2), over pairs of neighbouring samples that
    are both valid (Rousseeuw and Croux 1993; von Neumann et al. 1941). The median is interpolated inside
    its one-count class, or it would only take steps of a whole count; a sigma under about half a count
    reads 0.

    common_mode_sigma: mean covariance over all pairs of taxels of the line, after taking the straight-line
    drift of each taxel away, square root (0 if the covariance is negative): noise of one taxel alone drops
    out of it. It uses the frames in which the whole line is valid, and resolves about white_sigma /
    sqrt(taxels * sqrt(T)).

    Raises ValueError for a wrong shape or dtype, or fewer than 3 frames.
    """
    raw = raw_count_array(raw_counts, 2)
    if raw.shape[0] < MIN_SAMPLES:
        raise ValueError(f"raw_counts: expected at least {MIN_SAMPLES} frames, found {raw.shape[0]}")
    mask = validity_mask(valid, raw.shape)
    labels = None if line_of is None else _labels(line_of, raw.shape[1])
    count = mask.sum(axis=0, dtype=np.int64)
    enough = count >= MIN_SAMPLES
    centred = _centred(raw.astype(np.float64), mask)
    slope, residual = _straight_line(centred, mask)
    lines = None if labels is None else np.unique(labels)
    total_std = np.sqrt((centred**2).sum(axis=0) / np.maximum(count - 1, 1))
    return NoiseReport(
        white_sigma=np.where(enough, _white_sigma(raw, mask), np.nan),
        total_std=np.where(enough, total_std, np.nan),
        drift_slope=np.where(enough, slope, np.nan),
        count=count,
        lines=lines,
        common_mode_sigma=None
        if lines is None
        else np.array([_common_mode(residual[:, labels == line], mask[:, labels == line]) for line in lines]),
    )


def snr(signal_mean: npt.ArrayLike, noise_sigma: npt.ArrayLike) -> FloatArray:
    """Signal to noise: mean signal under contact over the noise without contact, any shapes that broadcast.

    signal_mean and noise_sigma in counts; NaN (missing) stays NaN. Signal over noise as in TI SLAA843A (2019)
    section 3.5, with sigma for the noise. CapSense guides divide by the peak-to-peak noise, which gives
    smaller numbers. Returns f64, 0-d for two scalars. Raises ValueError if a noise is 0, negative or
    infinite.
    """
    sigma = np.asarray(noise_sigma, dtype=np.float64)
    if ((sigma <= 0) | np.isinf(sigma)).any():
        raise ValueError("noise_sigma: expected finite counts above 0; a taxel without any noise is not measuring")
    return np.asarray(np.asarray(signal_mean, dtype=np.float64) / sigma)


def snr_db(signal_mean: npt.ArrayLike, noise_sigma: npt.ArrayLike) -> FloatArray:
    """`snr` in decibels, 20 log10 since counts are an amplitude; -inf where the signal is 0 or negative.

    Shapes, units and errors as in `snr`.
    """
    with np.errstate(divide="ignore"):
        return np.asarray(20.0 * np.log10(np.maximum(snr(signal_mean, noise_sigma), 0.0)))


def _labels(line_of: npt.ArrayLike, n_taxels: int) -> IntArray:
    labels = np.asarray(line_of)
    if labels.shape != (n_taxels,) or labels.dtype.kind not in "iu":
        raise ValueError(f"line_of: expected {n_taxels} integers, found {labels.dtype} of shape {labels.shape}")
    return labels.astype(np.int64)


def _centred(values: FloatArray, mask: BoolArray) -> FloatArray:
    """Values less their mean over the mask, 0 outside it."""
    mean = np.where(mask, values, 0.0).sum(axis=0) / np.maximum(mask.sum(axis=0), 1)
    return np.where(mask, values - mean, 0.0)


def _straight_line(centred: FloatArray, mask: BoolArray) -> tuple[FloatArray, FloatArray]:
    frames = np.arange(centred.shape[0], dtype=np.float64)[:, np.newaxis]
    time = _centred(np.broadcast_to(frames, centred.shape), mask)
    scatter = (time**2).sum(axis=0)
    slope = (time * centred).sum(axis=0) / np.where(scatter > 0, scatter, 1.0)
    return slope, centred - slope * time


def _white_sigma(raw: npt.NDArray[np.uint16], mask: BoolArray) -> FloatArray:
    jumps = np.abs(np.diff(raw.astype(np.int64), axis=0))
    both = mask[1:] & mask[:-1]
    columns = (_median_of_counts(jumps[both[:, taxel], taxel]) for taxel in range(raw.shape[1]))
    return MAD_TO_SIGMA * DIFFERENCE_TO_SAMPLE * np.fromiter(columns, np.float64, raw.shape[1])


def _median_of_counts(counts: IntArray) -> float:
    """Median of whole numbers, interpolated inside the class c - 0.5 .. c + 0.5 that holds it."""
    if counts.size == 0:
        return np.nan
    median = float(np.median(counts))
    middle = np.floor(median)
    inside = int((counts == middle).sum())
    if middle == 0 or inside == 0:
        return median
    below = int((counts < middle).sum())
    return float(middle - 0.5 + (counts.size / 2 - below) / inside)


def _common_mode(residual: FloatArray, mask: BoolArray) -> float:
    whole = mask.all(axis=1)
    taxels, frames = residual.shape[1], int(whole.sum())
    if taxels < 2 or frames < MIN_SAMPLES:
        return np.nan
    rows = residual[whole]
    pairs = (rows.sum(axis=1) ** 2).sum() - (rows**2).sum()
    covariance = pairs / (taxels * (taxels - 1) * (frames - 2))
    return float(np.sqrt(max(covariance, 0.0)))
