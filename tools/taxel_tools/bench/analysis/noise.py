"""Separation of the noise of an untouched board into components.

Components: independent in each taxel, shared along lines, shared by the board; white, 1/f and impulses. A cubic is
subtracted from the record of each taxel before the Fourier transform. Covariances between taxels on one TX line, on one
RX line, and on different lines determine the shared components (variance components of a two-way layout: Searle,
Casella, McCulloch, Variance Components, 1992, ch. 4). Above the band of 1/f noise, the spectrum is white; below, the
part that exceeds the white part is 1/f noise.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.hand import BoardKind
from taxel.types import BoolArray, CountArray, FloatArray

PINK_LOW_HZ: Final = 0.06
PINK_HIGH_HZ: Final = 8.0
"""Limits of the band over which 1/f noise is integrated."""
FIT_LOW_HZ: Final = 0.3
FIT_HIGH_HZ: Final = 6.0
WHITE_FROM_HZ: Final = 12.0
IMPULSE_S: Final = 0.004
IMPULSE_LEVELS: Final = 11.0
"""Ratio of an impulse to the level below which `LEVEL_SHARE` of the samples lie; noise does not reach this ratio."""
LEVEL_SHARE: Final = 0.68
COUNTS_MIN: Final = 1e-6
"""Smaller values are rounding errors."""
LAGS_S: Final = (0.06, 0.25, 1.0)
FRAMES_MIN: Final = 32
"""Fewer frames give no usable spectrum."""

ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class NoiseParts:
    """Components of noise as standard deviations in counts.

    `white`: white and independent in each taxel, root mean square over taxels. `white_by_taxel` f64[taxels]: all white
    components of each taxel. `tx`, `rx`, `board`: white and shared along TX lines, along RX lines, by the board.
    `pink`, `pink_board`: 1/f noise from 0.06 to 8 Hz, independent in each taxel and shared by the board. `mean_change`:
    root mean square change of the mean of the board within 0.25 s, without white noise. `mean_change_exponent`: growth
    of its square with the lag (0 for white noise, about 0.3 for 1/f noise, 1 for a random walk). `impulse`: largest
    impulse on successive conversions. `impulses_per_s`: rate of frames with an impulse. `frequency_hz` f64[k],
    `spectrum` f64[k]: counts^2/Hz, mean over taxels.
    """

    white: float
    white_by_taxel: FloatArray
    tx: float
    rx: float
    board: float
    pink: float
    pink_board: float
    mean_change: float
    mean_change_exponent: float
    impulse: float
    impulses_per_s: float
    frequency_hz: FloatArray
    spectrum: FloatArray

    def amplitudes(self) -> dict[str, float]:
        """Return the amplitudes of the noise components in counts, by the names of the measurements in plans and
        records.
        """
        return {
            "white": self.white,
            "tx": self.tx,
            "rx": self.rx,
            "board": self.board,
            "pink": self.pink,
            "pink_board": self.pink_board,
            "impulse": self.impulse,
            "wander": self.mean_change,
        }


@dataclass(frozen=True)
class _Components:
    independent: float
    tx: float
    rx: float
    board: float


def separate_noise(kind: BoardKind, raw_counts: CountArray, rate_hz: float, scan_s: float) -> NoiseParts:
    """Separate the noise of a record into its components.

    Drift (a cubic polynomial) is subtracted, impulses are replaced by medians, and the components follow from the
    spectrum of the rest: white noise from its highest frequencies, 1/f noise from the lower ones. `raw_counts`: u16[t,
    taxels] of an untouched board, 2 s or more; `rate_hz`: frames per second; `scan_s`: duration of a scan. Raises
    ValueError for fewer than 32 frames.
    """
    if len(raw_counts) < FRAMES_MIN:
        raise ValueError(f"expected at least {FRAMES_MIN} frames, found {len(raw_counts)}")
    residual = _subtract_cubic(raw_counts.astype(np.float64))
    is_impulse, impulse = _find_impulses(residual, scan_s)
    clean = residual.copy()
    clean[is_impulse] = np.nan
    clean = np.where(np.isnan(clean), np.nanmedian(clean, axis=0), clean)
    size = len(clean)
    window = np.hanning(size)[:, None]
    transform = np.fft.rfft(clean * window, axis=0) * np.sqrt(2.0 / (rate_hz * float((window**2).sum())))
    frequency = np.asarray(np.fft.rfftfreq(size, 1.0 / rate_hz), dtype=np.float64)
    nyquist = rate_hz / 2.0
    is_white_band = (frequency >= min(WHITE_FROM_HZ, 0.6 * nyquist)) & (frequency < nyquist)
    white = _fit_components(kind, transform[is_white_band])
    white_density_by_taxel = (np.abs(transform[is_white_band]) ** 2).mean(axis=0)
    pink, pink_board = _fit_pink(kind, transform, frequency, white)
    mean_change, exponent = _fit_mean_change(clean.mean(axis=1), rate_hz, white, kind)
    return NoiseParts(
        white=_compute_sigma(white.independent, nyquist),
        white_by_taxel=np.sqrt(white_density_by_taxel * nyquist),
        tx=_compute_sigma(white.tx, nyquist),
        rx=_compute_sigma(white.rx, nyquist),
        board=_compute_sigma(white.board, nyquist),
        pink=pink,
        pink_board=pink_board,
        mean_change=mean_change,
        mean_change_exponent=exponent,
        impulse=impulse,
        impulses_per_s=float(is_impulse.any(axis=1).sum()) * rate_hz / size,
        frequency_hz=frequency[1:],
        spectrum=(np.abs(transform[1:]) ** 2).mean(axis=1),
    )


def _compute_sigma(density: float, band_hz: float) -> float:
    """Compute the standard deviation of noise from its spectral density in counts^2/Hz and its bandwidth in Hz.

    Returns 0 for a negative density, which an estimate can have.
    """
    return float(np.sqrt(max(density, 0.0) * band_hz))


def _subtract_cubic(counts: FloatArray) -> FloatArray:
    """Subtract the best cubic polynomial in time from the counts f64[t, taxels] of each taxel, which removes drift."""
    time = np.linspace(-1.0, 1.0, len(counts))
    basis = np.linalg.qr(np.vander(time, 4))[0]
    return np.asarray(counts - basis @ (basis.T @ counts))


def _fit_components(kind: BoardKind, transform: ComplexArray) -> _Components:
    """Estimate the spectral densities of independent noise and of noise shared along TX lines, RX lines or by the
    board.

    transform: Fourier transform of the counts, c128[frequencies, taxels]. The noise of a taxel is the sum of these four
    parts. Two taxels on no common line share only the board noise, and two taxels on one line also the noise of the
    line. The mean covariances of these pairs follow from sums over lines, without a matrix of all pairs. An estimate
    can be negative.
    """
    tx, rx = kind.tx.astype(int), kind.rx.astype(int)
    power = float((np.abs(transform) ** 2).sum(axis=1).mean())
    taxels = transform.shape[1]
    by_tx, pairs_tx = _sum_line_pairs(transform, tx)
    by_rx, pairs_rx = _sum_line_pairs(transform, rx)
    all_pairs = float((np.abs(transform.sum(axis=1)) ** 2).mean()) - power
    pairs = taxels * (taxels - 1) - pairs_tx - pairs_rx
    board = (all_pairs - by_tx - by_rx) / pairs if pairs else 0.0
    along_tx = by_tx / pairs_tx - board if pairs_tx else 0.0
    along_rx = by_rx / pairs_rx - board if pairs_rx else 0.0
    return _Components(power / taxels - board - along_tx - along_rx, along_tx, along_rx, board)


def _sum_line_pairs(transform: ComplexArray, line: NDArray[np.int_]) -> tuple[float, int]:
    """Sum the covariances of all ordered pairs of different taxels on the same line.

    transform: Fourier transform of the counts, c128[frequencies, taxels]. line: number of the line of each taxel.
    Returns this sum, averaged over the frequencies, and the number of these pairs.
    """
    total, pairs = 0.0, 0
    for index in np.unique(line):
        rows = transform[:, line == index]
        count = rows.shape[1]
        pairs += count * (count - 1)
        total += float((np.abs(rows.sum(axis=1)) ** 2 - (np.abs(rows) ** 2).sum(axis=1)).mean())
    return total, pairs


def _fit_pink(
    kind: BoardKind, transform: ComplexArray, frequency: FloatArray, white: _Components
) -> tuple[float, float]:
    """Estimate the standard deviations of the 1/f noise in counts: independent in each taxel, and shared by the board.

    transform: Fourier transform of the counts, c128[frequencies, taxels]; frequency: f64[frequencies], Hz. A density
    k / f times the frequency is the constant k, so the mean of this product estimates k; the variance between two
    frequencies is k log(high / low). The white noise is subtracted. Returns (0, 0) if the record has fewer than 4
    frequencies in the fitted band.
    """
    band = (frequency >= FIT_LOW_HZ) & (frequency <= min(FIT_HIGH_HZ, 0.5 * frequency[-1]))
    if band.sum() < 4:
        return 0.0, 0.0
    weighted = _fit_components(kind, transform[band] * np.sqrt(frequency[band])[:, None])
    mean_hz = float(frequency[band].mean())
    log_band = float(np.log(PINK_HIGH_HZ / PINK_LOW_HZ))
    independent = max(weighted.independent - white.independent * mean_hz, 0.0)
    board = max(weighted.board - white.board * mean_hz, 0.0)
    return float(np.sqrt(independent * log_band)), float(np.sqrt(board * log_band))


def _fit_mean_change(mean: FloatArray, rate_hz: float, white: _Components, kind: BoardKind) -> tuple[float, float]:
    """Estimate the random change of the board's mean raw count, without the white noise.

    mean: f64[t], mean raw count per frame. Returns the root mean square change within 0.25 s in counts, and the
    exponent with which its square grows with the lag; (0, 0) for a record shorter than the longest lag.
    """
    taxels = kind.taxel_count
    nyquist = rate_hz / 2.0
    lines = white.tx / kind.tx_count + white.rx / kind.rx_count
    floor = 2.0 * nyquist * max(white.independent / taxels + lines + white.board, 0.0)
    # The floor is the mean square change by white noise: twice the variance of the mean of the board.
    squares = []
    for lag_s in LAGS_S:
        lag = max(round(lag_s * rate_hz), 1)
        if lag >= len(mean):
            return 0.0, 0.0
        squares.append(max(float(np.mean((mean[lag:] - mean[:-lag]) ** 2)) - floor, 1e-9))
    slope = np.polyfit(np.log(LAGS_S), np.log(squares), 1)[0]
    return float(np.sqrt(squares[1])), float(slope)  # number 1 of LAGS_S is 0.25 s


def _find_impulses(residual: FloatArray, scan_s: float) -> tuple[BoolArray, float]:
    """Find conversions that a short impulse disturbs, bool[t, taxels], and return the largest impulse in counts (0 if
    none).

    residual: f64[t, taxels], counts without drift; scan_s: duration of a scan. An impulse disturbs the successive
    conversions within about `IMPULSE_S`. The deviation of a count is its difference from the median of this, the
    previous and the next frame. Successive conversions are disturbed if the mean of their deviations exceeds
    `IMPULSE_LEVELS` times its usual size, the quantile `LEVEL_SHARE` over the whole record.
    """
    taxels = residual.shape[1]
    width = int(np.clip(round(IMPULSE_S / max(scan_s, 1e-4) * taxels), 1, taxels))
    neighbours = np.median(np.stack((np.roll(residual, 1, axis=0), residual, np.roll(residual, -1, axis=0))), axis=0)
    deviation = residual - neighbours
    sums = np.cumsum(np.pad(deviation, ((0, 0), (1, 0))), axis=1)
    means = (sums[:, width:] - sums[:, :-width]) / width
    # A third of the samples equals the median of three and gives 0, so a median of the sizes would be too low.
    size = np.abs(means)
    level = max(float(np.quantile(size, LEVEL_SHARE)), COUNTS_MIN)
    is_large = size > IMPULSE_LEVELS * level
    is_impulse = np.zeros(residual.shape, dtype=bool)
    for offset in range(width):
        is_impulse[:, offset : offset + is_large.shape[1]] |= is_large
    return is_impulse, float(size[is_large].max()) if is_large.any() else 0.0
