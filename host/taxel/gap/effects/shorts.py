"""Detection of shorts between neighbouring lines of a board."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.effects.dead_taxels import LOADED_COUNTS
from taxel.gap.effects.dropout import Short, find_crossing_pairs
from taxel.gap.features.features import SessionMeans, compute_known_mean
from taxel.gap.fitting.state import State
from taxel.types import FloatArray

MAX_DIFFERENCE_SHARE: Final = 0.03
"""Largest squared difference of the signals of two shorted lines, as a share of the expected squared difference.
Chosen: shorted lines have equal signals except for noise."""

MIN_SUM_SHARE: Final = 0.35
"""Smallest signal of a shorted line, as a share of the sum of the expected signals of both lines. Chosen: below the
ideal value 0.5. Equal lines with smaller signals have another cause."""

CLIPPED_GAINS: Final = tuple(np.geomspace(0.5, 3.0, 8).tolist())
"""Gains relative to the expected signal that are tried for lines whose signals end at a limit."""


def find_shorts(state: State, real: SessionMeans, features: FloatArray) -> tuple[Short, ...]:
    """Return the short circuits: neighbouring lines with equal measured signals on all common crossing lines, where
    different signals are expected.

    real: measured features of the sessions. features: expected features, f64[C, F, n] (C conditions, F features, n
    taxels). A pair of lines is not a short if a limit of the signals (saturation) explains the equal signals better.
    """
    bins = state.layout.bins
    expected = features[:, :bins]
    measured = np.nan_to_num(compute_known_mean(real.value, 1)[:, :bins])
    weight = state.layout.weight[:bins, None]
    shorts = []
    sensor = state.pair.taxels.sensor
    for axis, number in (("tx", state.pair.taxels.tx), ("rx", state.pair.taxels.rx)):
        for address in state.pair.sensors.address.tolist():
            for index in np.unique(number[sensor == address])[:-1].tolist():
                first, second = find_crossing_pairs(state.pair, address, axis, index)
                if len(first) < 2:
                    continue
                difference, total = (
                    expected[:, :, first] - expected[:, :, second],
                    expected[:, :, first] + expected[:, :, second],
                )
                pairs = int((np.abs(difference).max(axis=(0, 1)) > LOADED_COUNTS).sum())
                if not pairs:
                    continue
                squared_difference = float(np.sum(weight * (measured[:, :, first] - measured[:, :, second]) ** 2))
                if squared_difference > MAX_DIFFERENCE_SHARE * float(np.sum(weight * difference**2)):
                    continue
                # Each of the two lines measures `share` times the expected sum, so their measured sum is twice as
                # large.
                measured_total = measured[:, :, first] + measured[:, :, second]
                share = 0.5 * float(np.sum(weight * measured_total * total) / np.sum(weight * total**2))
                limit = float(measured[:, :, sensor == address].max())
                if share > MIN_SUM_SHARE and not _is_clipped(measured, expected, weight, (first, second), share, limit):
                    shorts.append(Short(address, axis, index, share, pairs))
    return tuple(shorts)


def _is_clipped(
    measured: FloatArray,
    expected: FloatArray,
    weight: FloatArray,
    lines: tuple[NDArray[np.intp], NDArray[np.intp]],
    share: float,
    limit: float,
) -> bool:
    """Return whether a limit of the signals explains the equal signals of two lines better than a short does.

    measured, expected: signals in B time bins, f64[C, B, n] (C conditions, n taxels), counts. weight: weights of the
    bins, f64[B, 1]. lines: taxels of the two lines, i64[k] each. share: share of the sum of both expected signals that
    each line shows if the lines are shorted. limit: largest measured signal of the board, counts.
    """
    line_signals = np.stack([measured[:, :, taxels] for taxels in lines])
    line_expected = np.stack([expected[:, :, taxels] for taxels in lines])
    short_error = float(np.sum(weight * (line_signals - share * line_expected.sum(axis=0)) ** 2))
    return any(
        float(np.sum(weight * (line_signals - np.minimum(gain * line_expected, limit)) ** 2)) < short_error
        for gain in CLIPPED_GAINS
    )
