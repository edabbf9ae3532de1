"""Lines of a board that touch."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.effects.dead_places import LOADED_COUNTS
from taxel.gap.effects.dropout import Short, crossings
from taxel.gap.features.features import SessionMeans, known_mean
from taxel.gap.fitting.state import State
from taxel.types import FloatArray

ALIKE: Final = 0.03
"""Share of the expected squared difference of two lines below which they show the same."""

HALF: Final = 0.35
"""Two lines in one show half of the sum of what they should; lines that are alike and show less have another cause."""

GAINS: Final = tuple(np.geomspace(0.5, 3.0, 8).tolist())
"""Sensitivities relative to the expected one that lines whose counts end may have."""


def find_shorts(state: State, real: SessionMeans, features: FloatArray) -> tuple[Short, ...]:
    """Neighbouring lines whose crossings all show the same where they should differ."""
    bins = state.layout.bins
    expected = features[:, :bins]
    seen = np.nan_to_num(known_mean(real.value, 1)[:, :bins])
    weight = state.layout.weight[:bins, None]
    found = []
    sensor = state.pair.taxels.sensor
    for axis, number in (("tx", state.pair.taxels.tx), ("rx", state.pair.taxels.rx)):
        for address in state.pair.sensors.address.tolist():
            for index in np.unique(number[sensor == address])[:-1].tolist():
                first, second = crossings(state.pair, address, axis, index)
                if len(first) < 2:
                    continue
                apart, together = (
                    expected[:, :, first] - expected[:, :, second],
                    expected[:, :, first] + expected[:, :, second],
                )
                pairs = int((np.abs(apart).max(axis=(0, 1)) > LOADED_COUNTS).sum())
                if not pairs:
                    continue
                differs = float(np.sum(weight * (seen[:, :, first] - seen[:, :, second]) ** 2))
                if differs > ALIKE * float(np.sum(weight * apart**2)):
                    continue
                total = seen[:, :, first] + seen[:, :, second]
                share = 0.5 * float(np.sum(weight * total * together) / np.sum(weight * together**2))
                end = float(seen[:, :, sensor == address].max())
                if share > HALF and not _only_ends(seen, expected, weight, (first, second), share, end):
                    found.append(Short(address, axis, index, share, pairs))
    return tuple(found)


def _only_ends(
    seen: FloatArray,
    expected: FloatArray,
    weight: FloatArray,
    lines: tuple[NDArray[np.intp], NDArray[np.intp]],
    share: float,
    end: float,
) -> bool:
    """Whether two lines are alike since counts end at `end`, whatever presses: that tells what they show better than a
    share of their sum does. seen, expected: f64[C, bins, n]. lines: their taxels, i64[k] each.
    """
    shown = np.stack([seen[:, :, own] for own in lines])
    meant = np.stack([expected[:, :, own] for own in lines])
    short = float(np.sum(weight * (shown - share * meant.sum(axis=0)) ** 2))
    return any(float(np.sum(weight * (shown - np.minimum(gain * meant, end)) ** 2)) < short for gain in GAINS)
