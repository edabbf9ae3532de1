"""Phases of a contact from its values, for a dataset that does not state the commanded phases."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.recording.grasp_format import Phase
from taxel.types import ByteArray, FloatArray

REST_SHARE: Final = 0.05
"""Share of the frames at the start that are assumed to be without contact; at least `LEAST_REST` frames."""

LEAST_REST: Final = 10

TOUCH_LEVEL, HOLD_LEVEL = 0.1, 0.8
"""Levels of the signal, relative to the plateau, at which a contact begins and the hold begins. 10 % is the usual level
of a rise time; 80 % instead of the usual 90 % keeps a hold together in which the skin creeps."""

LEAST_SIGNAL: Final = 8.0
"""Standard deviations of the signal without contact that the plateau must exceed: a contact is then certain."""


def detect_phases(values: FloatArray) -> ByteArray | None:
    """Detect the phases of one contact, u8[T]; None if the values contain no contact.

    values: f64[T, m], NaN where missing; the first frames are without contact. The signal is the change from the first
    frames, projected on the pattern of the frame with the largest change.
    """
    filled = fill_missing(values)
    rest = min(max(LEAST_REST, round(REST_SHARE * len(filled))), len(filled) // 2)
    change = filled - np.median(filled[:rest], axis=0)
    noise = np.maximum(change[:rest].std(axis=0), 1e-9 * max(float(np.abs(change).max()), 1e-300))
    weighted = change / np.maximum(noise, np.median(noise))
    pattern = weighted[int(np.argmax((weighted**2).sum(axis=1)))]
    signal = weighted @ pattern / max(float(np.linalg.norm(pattern)), 1e-300)
    large = signal > 0.5 * signal.max()
    plateau = float(np.median(signal[large])) if large.any() else 0.0
    if plateau <= LEAST_SIGNAL * max(float(signal[:rest].std()), 1e-12):
        return None
    touching, holding = np.flatnonzero(signal > TOUCH_LEVEL * plateau), np.flatnonzero(signal > HOLD_LEVEL * plateau)
    return _make_phases(len(signal), (touching[touching >= rest], holding[holding >= rest]))


def _make_phases(frames: int, found: tuple[NDArray[np.intp], NDArray[np.intp]]) -> ByteArray | None:
    """Phases from the frames with contact and those of the hold."""
    touching, holding = found
    if not len(holding):
        return None
    phase = np.full(frames, Phase.RECOVERY, np.uint8)
    phase[: touching[-1] + 1] = Phase.RELEASE
    phase[: holding[-1] + 1] = Phase.HOLD
    phase[: holding[0]] = Phase.CLOSING
    phase[: max(touching[0] - 1, 0)] = Phase.BASELINE  # the frame before the touch may contain a part of it
    return phase


def fill_missing(values: FloatArray) -> FloatArray:
    """Values f64[T, m] whose missing entries repeat the previous one of the component; 0 if it has none at all."""
    missing = np.isnan(values)
    if not missing.any():
        return values
    rows = np.where(missing, 0, np.arange(len(values))[:, None])
    last = np.maximum.accumulate(rows, axis=0)
    filled = np.take_along_axis(values, last, axis=0)
    first = np.take_along_axis(values, np.argmin(missing, axis=0)[None], axis=0)
    return np.asarray(np.nan_to_num(np.where(np.isnan(filled), first, filled)))
