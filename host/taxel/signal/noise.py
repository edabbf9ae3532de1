"""Noise of an untouched skin (white, total, common-mode, drift) and signal-to-noise ratio."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from taxel.signal._arrays import to_raw_count_array, to_validity_mask
from taxel.types import BoolArray, FloatArray, IntArray

MAD_TO_SIGMA = 1.482602218505602
"""1 / (third quartile of the standard normal): Rousseeuw and Croux, J. Am. Stat. Assoc. 88 (1993) 1273."""

DIFFERENCE_TO_SAMPLE = 2.0**-0.5
"""The difference of two independent samples has twice their variance: von Neumann et al., Ann. Math. Stat. 12 (1941)
153."""

MIN_SAMPLES = 3
"""A straight line has two degrees of freedom; a third sample leaves one for the residual."""


@dataclass(frozen=True, eq=False)
class NoiseReport:
    """Noise of n taxels, counts; NaN where a taxel or line has too few valid samples.

    white_sigma: f64[n], standard deviation of the sample-to-sample noise, insensitive to drift and rare impulses.
    total_std: f64[n], standard deviation including drift and impulses.
    drift_slope: f64[n], counts per sample, slope of the least-squares line.
    count: int64[n], number of valid samples.
    lines: int64[L], the line labels in ascending order; None without labels.
    common_mode_sigma: f64[L], noise common to the taxels of a line; NaN for a line of one taxel; None without labels.
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
    """Measure the noise of a recording of an untouched skin.

    raw_counts: u16[T, n]. line_of: integer label[n] of the line (TX, RX or board) of each taxel.
    valid: a bool, bool[T] (whole frames) or bool[T, n].

    white_sigma = 1.4826 * median(abs(first differences)) / sqrt(2), over pairs of consecutive valid samples (Rousseeuw
    and Croux 1993; von Neumann et al. 1941). The median is interpolated within its one-count class, because a median of
    integers has steps of one count; a sigma below about half a count gives 0.

    common_mode_sigma: square root of the mean covariance over all pairs of taxels of the line, after removal of the
    linear drift of each taxel (0 if the covariance is negative). Noise of a single taxel does not contribute. Only
    frames with a valid value of every taxel of the line are used; the resolution is about
    white_sigma / sqrt(taxels * sqrt(T)).

    Raises ValueError for a wrong shape or dtype, or fewer than 3 frames.
    """
    raw = to_raw_count_array(raw_counts, 2)
    if raw.shape[0] < MIN_SAMPLES:
        raise ValueError(f"raw_counts: expected at least {MIN_SAMPLES} frames, found {raw.shape[0]}")
    mask = to_validity_mask(valid, raw.shape)
    labels = None if line_of is None else _check_labels(line_of, raw.shape[1])
    count = mask.sum(axis=0, dtype=np.int64)
    has_enough = count >= MIN_SAMPLES
    centred = _subtract_mean(raw.astype(np.float64), mask)
    slope, residual = _fit_line(centred, mask)
    lines = None if labels is None else np.unique(labels)
    total_std = np.sqrt((centred**2).sum(axis=0) / np.maximum(count - 1, 1))
    return NoiseReport(
        white_sigma=np.where(has_enough, _compute_white_sigma(raw, mask), np.nan),
        total_std=np.where(has_enough, total_std, np.nan),
        drift_slope=np.where(has_enough, slope, np.nan),
        count=count,
        lines=lines,
        common_mode_sigma=None
        if lines is None
        else np.array([_compute_common_mode(residual[:, labels == line], mask[:, labels == line]) for line in lines]),
    )


def snr(signal_mean: npt.ArrayLike, noise_sigma: npt.ArrayLike) -> FloatArray:
    """Compute the signal-to-noise ratio: mean signal under contact divided by the noise without contact.

    signal_mean, noise_sigma: counts, shapes that broadcast; NaN (missing) gives NaN. Definition as in TI SLAA843A
    (2019) section 3.5, with sigma as the noise; CapSense guides divide by the peak-to-peak noise, which gives smaller
    values. Returns f64, 0-d for two scalars. Raises ValueError if a noise is 0, negative or infinite.
    """
    sigma = np.asarray(noise_sigma, dtype=np.float64)
    if ((sigma <= 0) | np.isinf(sigma)).any():
        raise ValueError("noise_sigma: expected finite counts above 0; a taxel without noise does not measure")
    return np.asarray(np.asarray(signal_mean, dtype=np.float64) / sigma)


def snr_db(signal_mean: npt.ArrayLike, noise_sigma: npt.ArrayLike) -> FloatArray:
    """Compute the signal-to-noise ratio in decibels (20 log10, since counts are an amplitude).

    The result is -inf for a signal of 0 or below.

    Shapes, units and errors as in `snr`.
    """
    with np.errstate(divide="ignore"):
        return np.asarray(20.0 * np.log10(np.maximum(snr(signal_mean, noise_sigma), 0.0)))


def _check_labels(line_of: npt.ArrayLike, n_taxels: int) -> IntArray:
    """Return the line label of each taxel as i64[n]. Raises ValueError for another shape or type."""
    labels = np.asarray(line_of)
    if labels.shape != (n_taxels,) or labels.dtype.kind not in "iu":
        raise ValueError(f"line_of: expected {n_taxels} integers, found {labels.dtype} of shape {labels.shape}")
    return labels.astype(np.int64)


def _subtract_mean(values: FloatArray, mask: BoolArray) -> FloatArray:
    """Subtract from each column of `values` [T, n] its mean over the entries with mask True; other entries become 0."""
    mean = np.where(mask, values, 0.0).sum(axis=0) / np.maximum(mask.sum(axis=0), 1)
    return np.where(mask, values - mean, 0.0)


def _fit_line(centred: FloatArray, mask: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Fit a line to each column of `centred` f64[T, n]; return (slope, counts per frame, f64[n]; residual f64[T, n]).

    mask: bool[T, n], valid entries; the mean of each column over its valid entries is 0.
    """
    frames = np.arange(centred.shape[0], dtype=np.float64)[:, np.newaxis]
    time = _subtract_mean(np.broadcast_to(frames, centred.shape), mask)
    squares = (time**2).sum(axis=0)
    slope = (time * centred).sum(axis=0) / np.where(squares > 0, squares, 1.0)
    return slope, centred - slope * time


def _compute_white_sigma(raw: npt.NDArray[np.uint16], mask: BoolArray) -> FloatArray:
    """Estimate the standard deviation of each taxel's white noise, f64[n], counts.

    The estimate uses differences of successive frames, in which drift and slow disturbances cancel. NaN for a taxel
    without two successive valid frames.
    """
    steps = np.abs(np.diff(raw.astype(np.int64), axis=0))
    are_valid = mask[1:] & mask[:-1]
    columns = (_compute_interpolated_median(steps[are_valid[:, taxel], taxel]) for taxel in range(raw.shape[1]))
    return MAD_TO_SIGMA * DIFFERENCE_TO_SAMPLE * np.fromiter(columns, np.float64, raw.shape[1])


def _compute_interpolated_median(counts: IntArray) -> float:
    """Compute the median of integers, interpolated within the class from c - 0.5 to c + 0.5 of the median count c.

    NaN without any number.
    """
    if counts.size == 0:
        return np.nan
    median = float(np.median(counts))
    middle = np.floor(median)
    count_in_class = int((counts == middle).sum())
    if middle == 0 or count_in_class == 0:
        return median
    count_below = int((counts < middle).sum())
    return float(middle - 0.5 + (counts.size / 2 - count_below) / count_in_class)


def _compute_common_mode(residual: FloatArray, mask: BoolArray) -> float:
    """Compute the standard deviation of the noise that all taxels of a line share, counts.

    The result is the root of the mean covariance of all pairs of taxels. residual: f64[T, k], counts without mean and
    drift. mask: bool[T, k], valid entries. NaN for fewer than two taxels or too few complete frames.
    """
    is_complete = mask.all(axis=1)
    taxels, frames = residual.shape[1], int(is_complete.sum())
    if taxels < 2 or frames < MIN_SAMPLES:
        return np.nan
    rows = residual[is_complete]
    # Sum of the products of all pairs. The fits of mean and drift remove two degrees of freedom of each taxel.
    pairs = (rows.sum(axis=1) ** 2).sum() - (rows**2).sum()
    covariance = pairs / (taxels * (taxels - 1) * (frames - 2))
    return float(np.sqrt(max(covariance, 0.0)))
