"""Detection of the phases of a contact from its values, for a dataset that does not state the commanded phases."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.recording.grasp_format import Phase
from taxel.types import ByteArray, FloatArray

REST_SHARE: Final = 0.05
"""Share of the frames at the start that are assumed to be without contact; at least `LEAST_REST` frames."""

LEAST_REST: Final = 10
"""Smallest number of frames at the start that are assumed to be without contact."""

TOUCH_LEVEL, HOLD_LEVEL = 0.1, 0.8
"""Levels of the signal, relative to its plateau in contact, at which contact and hold begin. 10 % is the usual level
of a rise time; 80 % instead of the usual 90 % keeps a hold together in which the skin creeps."""

LEAST_SIGNAL: Final = 8.0
"""Smallest ratio of the signal's plateau to the standard deviation of the signal without contact at which the values
are taken to contain a contact.
"""


def detect_phases(values: FloatArray) -> ByteArray | None:
    """Detect the phases of one contact, u8[T]; None if the values contain no contact.

    values: f64[T, m], m components of all taxels in T frames, NaN where missing; the first frames are without contact.
    The signal of a frame is its change from the first frames, in units of the noise, projected on the pattern of the
    frame with the largest change. The plateau is the median of the signals above half of the largest signal; contact
    and hold begin at fixed shares of the plateau (`TOUCH_LEVEL`, `HOLD_LEVEL`).
    """
    filled = fill_missing(values)
    baseline_frames = min(max(LEAST_REST, round(REST_SHARE * len(filled))), len(filled) // 2)
    change = filled - np.median(filled[:baseline_frames], axis=0)
    # The small limits here and below only prevent a division by 0 for values without noise.
    noise = np.maximum(change[:baseline_frames].std(axis=0), 1e-9 * max(float(np.abs(change).max()), 1e-300))
    weighted = change / np.maximum(noise, np.median(noise))
    pattern = weighted[int(np.argmax((weighted**2).sum(axis=1)))]
    signal = weighted @ pattern / max(float(np.linalg.norm(pattern)), 1e-300)
    large = signal > 0.5 * signal.max()
    plateau = float(np.median(signal[large])) if large.any() else 0.0
    if plateau <= LEAST_SIGNAL * max(float(signal[:baseline_frames].std()), 1e-12):
        return None
    touching, holding = np.flatnonzero(signal > TOUCH_LEVEL * plateau), np.flatnonzero(signal > HOLD_LEVEL * plateau)
    return _make_phases(len(signal), touching[touching >= baseline_frames], holding[holding >= baseline_frames])


def _make_phases(frames: int, touching: NDArray[np.intp], holding: NDArray[np.intp]) -> ByteArray | None:
    """Return the phase of each frame, u8[frames]; None without a frame of the hold.

    touching, holding: indices of the frames with contact, and of those above the hold level, increasing.
    """
    if not len(holding):
        return None
    # From the last phase to the first: each assignment overwrites the start of the assignment before.
    phase = np.full(frames, Phase.RECOVERY, np.uint8)
    phase[: touching[-1] + 1] = Phase.RELEASE
    phase[: holding[-1] + 1] = Phase.HOLD
    phase[: holding[0]] = Phase.CLOSING
    phase[: max(touching[0] - 1, 0)] = Phase.BASELINE  # the last frame before contact may contain the onset
    return phase


def fill_missing(values: FloatArray) -> FloatArray:
    """Replace missing entries (NaN) of f64[T, m] by the previous entry of the same component.

    An entry before the first value of its component gets that value; a component without any value becomes 0.
    """
    missing = np.isnan(values)
    if not missing.any():
        return values
    # Row of the latest value up to each row; 0 if there is none.
    rows = np.where(missing, 0, np.arange(len(values))[:, None])
    last = np.maximum.accumulate(rows, axis=0)
    filled = np.take_along_axis(values, last, axis=0)
    # First value of each component: argmin returns the first False of `missing`.
    first = np.take_along_axis(values, np.argmin(missing, axis=0)[None], axis=0)
    return np.asarray(np.nan_to_num(np.where(np.isnan(filled), first, filled)))
