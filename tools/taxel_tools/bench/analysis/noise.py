"""Noise of an untouched board, taken apart: each taxel's own, shared along lines, shared by the board; white, 1/f,
impulses.

Each taxel's record is cut of a cubic and Fourier transformed. Covariances between taxels on one TX line, on one RX
line, and on neither tell what is shared (variance components of a two-way layout: Searle, Casella, McCulloch, Variance
Components, 1992, ch. 4). Above the band of 1/f noise what is left is white; below it, what the white part does not
explain is 1/f.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.hand import BoardKind

PINK_LOW_HZ: Final = 0.06
PINK_HIGH_HZ: Final = 8.0
"""Band over which 1/f noise is summed up."""
FIT_LOW_HZ: Final = 0.3
FIT_HIGH_HZ: Final = 6.0
WHITE_FROM_HZ: Final = 12.0
IMPULSE_S: Final = 0.004
IMPULSE_LEVELS: Final = 11.0
"""How far an impulse stands above the usual level, below which 68 % of the samples are: nothing does so by chance."""
USUAL_SHARE: Final = 0.68
COUNTS_MIN: Final = 1e-6
"""Less is rounding."""
LAGS_S: Final = (0.06, 0.25, 1.0)
FRAMES_MIN: Final = 32
"""Fewer have no spectrum worth the name."""


@dataclass(frozen=True, eq=False)
class NoiseParts:
    """Standard deviations in counts.

    `white`: each taxel's own, root mean square over taxels; `white_by_taxel` f64[taxels]: what each taxel shows of all
    white parts; `tx`, `rx`, `board`: shared along TX lines, RX lines, by the board, white; `pink`, `pink_board`: 1/f
    from 0.06 to 8 Hz, each taxel's own and the board's. `wander`: root mean square change of the board's mean within
    0.25 s that white noise does not explain; `wander_exponent`: how its square grows with the lag (0 white, about 0.3
    for 1/f, 1 for a random walk). `impulse`: largest impulse on neighbouring conversions; `impulses_per_s`: frames with
    one, a second. `frequency_hz` f64[k], `spectrum` f64[k]: counts^2/Hz, mean over taxels.
    """

    white: float
    white_by_taxel: NDArray[np.float64]
    tx: float
    rx: float
    board: float
    pink: float
    pink_board: float
    wander: float
    wander_exponent: float
    impulse: float
    impulses_per_s: float
    frequency_hz: NDArray[np.float64]
    spectrum: NDArray[np.float64]


@dataclass(frozen=True)
class _Components:
    own: float
    tx: float
    rx: float
    board: float


def noise_parts(kind: BoardKind, raw_counts: NDArray[np.uint16], rate_hz: float, scan_s: float) -> NoiseParts:
    """Take a record apart.

    raw_counts: u16[t, taxels], an untouched board, 2 s or more. rate_hz: frames a second. scan_s: how long a scan
    takes. Raises ValueError for fewer than 32 frames.
    """
    if len(raw_counts) < FRAMES_MIN:
        raise ValueError(f"expected at least {FRAMES_MIN} frames, found {len(raw_counts)}")
    residual = _without_cubic(raw_counts.astype(np.float64))
    hits, impulse = _impulses(residual, scan_s)
    clean = residual.copy()
    clean[hits] = np.nan
    clean = np.where(np.isnan(clean), np.nanmedian(clean, axis=0), clean)
    size = len(clean)
    window = np.hanning(size)[:, None]
    transform = np.fft.rfft(clean * window, axis=0) * np.sqrt(2.0 / (rate_hz * float((window**2).sum())))
    frequency = np.asarray(np.fft.rfftfreq(size, 1.0 / rate_hz), dtype=np.float64)
    nyquist = rate_hz / 2.0
    high = (frequency >= min(WHITE_FROM_HZ, 0.6 * nyquist)) & (frequency < nyquist)
    white = _components(kind, transform[high])
    own_by_taxel = (np.abs(transform[high]) ** 2).mean(axis=0)
    pink_own, pink_board = _pink(kind, transform, frequency, white)
    wander, exponent = _wander(clean.mean(axis=1), rate_hz, white, kind)
    return NoiseParts(
        white=_sigma(white.own, nyquist),
        white_by_taxel=np.sqrt(own_by_taxel * nyquist),
        tx=_sigma(white.tx, nyquist),
        rx=_sigma(white.rx, nyquist),
        board=_sigma(white.board, nyquist),
        pink=pink_own,
        pink_board=pink_board,
        wander=wander,
        wander_exponent=exponent,
        impulse=impulse,
        impulses_per_s=float(hits.any(axis=1).sum()) * rate_hz / size,
        frequency_hz=frequency[1:],
        spectrum=(np.abs(transform[1:]) ** 2).mean(axis=1),
    )


def _sigma(density: float, band_hz: float) -> float:
    return float(np.sqrt(max(density, 0.0) * band_hz))


def _without_cubic(counts: NDArray[np.float64]) -> NDArray[np.float64]:
    time = np.linspace(-1.0, 1.0, len(counts))
    basis = np.linalg.qr(np.vander(time, 4))[0]
    return np.asarray(counts - basis @ (basis.T @ counts))


def _components(kind: BoardKind, transform: NDArray[np.complex128]) -> _Components:
    """Variance components of the two-way layout, from sums over lines: no matrix of all pairs."""
    tx, rx = kind.tx.astype(int), kind.rx.astype(int)
    power = float((np.abs(transform) ** 2).sum(axis=1).mean())
    taxels = transform.shape[1]
    by_tx, pairs_tx = _line_pairs(transform, tx)
    by_rx, pairs_rx = _line_pairs(transform, rx)
    everything = float((np.abs(transform.sum(axis=1)) ** 2).mean()) - power
    pairs = taxels * (taxels - 1) - pairs_tx - pairs_rx
    board = (everything - by_tx - by_rx) / pairs if pairs else 0.0
    along_tx = by_tx / pairs_tx - board if pairs_tx else 0.0
    along_rx = by_rx / pairs_rx - board if pairs_rx else 0.0
    return _Components(power / taxels - board - along_tx - along_rx, along_tx, along_rx, board)


def _line_pairs(transform: NDArray[np.complex128], line: NDArray[np.int_]) -> tuple[float, int]:
    """Sum of the covariances of ordered pairs on one line, and how many there are."""
    total, pairs = 0.0, 0
    for index in np.unique(line):
        rows = transform[:, line == index]
        count = rows.shape[1]
        pairs += count * (count - 1)
        total += float((np.abs(rows.sum(axis=1)) ** 2 - (np.abs(rows) ** 2).sum(axis=1)).mean())
    return total, pairs


def _pink(
    kind: BoardKind, transform: NDArray[np.complex128], frequency: NDArray[np.float64], white: _Components
) -> tuple[float, float]:
    """1/f noise of each taxel and of the board: densities times frequency over the band, less the white part."""
    band = (frequency >= FIT_LOW_HZ) & (frequency <= min(FIT_HIGH_HZ, 0.5 * frequency[-1]))
    if band.sum() < 4:
        return 0.0, 0.0
    weighted = _components(kind, transform[band] * np.sqrt(frequency[band])[:, None])
    mean_hz = float(frequency[band].mean())
    octaves = float(np.log(PINK_HIGH_HZ / PINK_LOW_HZ))
    own = max(weighted.own - white.own * mean_hz, 0.0)
    board = max(weighted.board - white.board * mean_hz, 0.0)
    return float(np.sqrt(own * octaves)), float(np.sqrt(board * octaves))


def _wander(mean: NDArray[np.float64], rate_hz: float, white: _Components, kind: BoardKind) -> tuple[float, float]:
    """Root mean square change within 0.25 s, and how its square grows with the lag."""
    taxels = kind.taxel_count
    nyquist = rate_hz / 2.0
    lines = white.tx / kind.tx_count + white.rx / kind.rx_count
    floor = 2.0 * nyquist * max(white.own / taxels + lines + white.board, 0.0)
    squares = []
    for lag_s in LAGS_S:
        lag = max(round(lag_s * rate_hz), 1)
        if lag >= len(mean):
            return 0.0, 0.0
        squares.append(max(float(np.mean((mean[lag:] - mean[:-lag]) ** 2)) - floor, 1e-9))
    slope = np.polyfit(np.log(LAGS_S), np.log(squares), 1)[0]
    return float(np.sqrt(squares[1])), float(slope)


def _impulses(residual: NDArray[np.float64], scan_s: float) -> tuple[NDArray[np.bool_], float]:
    """Conversions hit by something short that is shared by neighbours in time, and the largest of such hits, in counts.

    An impulse of 5 ms covers the conversions of that time; a mean over as many of them stands out of their noise.
    """
    taxels = residual.shape[1]
    width = int(np.clip(round(IMPULSE_S / max(scan_s, 1e-4) * taxels), 1, taxels))
    neighbours = np.median(np.stack((np.roll(residual, 1, axis=0), residual, np.roll(residual, -1, axis=0))), axis=0)
    sharp = residual - neighbours
    sums = np.cumsum(np.pad(sharp, ((0, 0), (1, 0))), axis=1)
    means = (sums[:, width:] - sums[:, :-width]) / width
    # A third of the samples is its own median and therefore 0: a median of sizes would be far too low a level.
    size = np.abs(means)
    usual = max(float(np.quantile(size, USUAL_SHARE)), COUNTS_MIN)
    far = size > IMPULSE_LEVELS * usual
    hits = np.zeros(residual.shape, dtype=bool)
    for offset in range(width):
        hits[:, offset : offset + far.shape[1]] |= far
    return hits, float(size[far].max()) if far.any() else 0.0
