"""Which taxels, lines and boards answer to nothing."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.effects.dead_places import (
    LOADED_COUNTS,
    SURE,
    answers_elsewhere,
    is_evident,
    lines_of,
    on_line,
    patches,
    touched_lines,
)
from taxel.gap.effects.dropout import Dropped
from taxel.gap.effects.shorts import find_shorts
from taxel.gap.features.features import COUNTS_MISSING, SessionMeans, known_mean
from taxel.gap.fitting.state import State
from taxel.types import FloatArray

FAINT_COUNTS: Final = 40.0
"""Largest drop that is expected of a taxel, from which on it tells something beside one of which more is expected."""

DEAD: Final = 0.2
"""Share of the expected drop below which a taxel does not answer."""

LOUD: Final = 0.35
"""Share of its expected drops, RMS, from which on a taxel answers, if not as expected: what wraps round, or is pressed
elsewhere, is not dead."""

MISSING: Final = 0.02
"""Share of missing frames beyond the simulator's that is no accident."""

ONE_SESSION: Final = 0.1
"""Standard error of the share of its expected drop that a taxel shows, where one session tells it."""

SURELY: Final = 3.0
"""Standard errors."""

STUCK: Final = 0.1
"""Noise below this share of the board's usual noise: the taxel does not even read noise."""


def find_dropped(
    state: State, real: SessionMeans, features: FloatArray, part: NDArray[np.bool_] | None = None
) -> Dropped:
    """Look at some taxels of some cells, bool[C, n]; None: at all. features: f64[C, F, n], what is expected."""
    n, sensor = state.pair.n, state.pair.groups.sensor
    real, features = _less_common(state, real, features)
    if part is not None:
        real = real.where(part)
        features = np.where(part[:, None], features, 0.0)
    answer, silent, expected = _answers(state, real, features)
    faint = (expected > FAINT_COUNTS).any(axis=0)
    noise = known_mean(real.value[:, :, state.layout.noise].reshape(-1, n), 0)
    usual = _median_of_board(noise, sensor)
    stuck = np.nan_to_num(noise, nan=np.inf) < STUCK * usual
    missing = np.zeros(int(sensor.max()) + 1)
    gone = np.nan_to_num(known_mean(real.value[:, :, state.layout.missing].reshape(-1, n), 0)) / COUNTS_MISSING
    simulated = features[:, state.layout.missing].mean(axis=0) / COUNTS_MISSING
    for board in range(len(missing)):
        extra = float(np.mean((gone - simulated)[sensor == board]))
        missing[board] = extra if extra > MISSING else 0.0
    mute = ((silent & faint) | stuck) & (missing[sensor] < 0.9)
    unheard = mute.copy()
    for line in touched_lines(state, mute & ~stuck & (expected > LOADED_COUNTS).any(axis=0)):
        if answers_elsewhere(state, real, features, line, unheard):
            mute &= ~on_line(state, line) | stuck
    known = np.where(faint, answer, np.nan)
    dead, evident = patches(state, known, mute, expected)
    dead |= mute & stuck
    lines = lines_of(state, dead, faint | stuck)
    lined = np.zeros(n, bool)
    for line in lines:
        lined |= on_line(state, line)
    shorts = find_shorts(state, real, features)
    evident = evident or any(is_evident(state, known, line) for line in lines)
    evident = evident or any(short.pairs > 1 for short in shorts)
    return Dropped(dead & ~lined, tuple(lines), missing, dead | lined, stuck, shorts, evident)


def _less_common(state: State, real: SessionMeans, features: FloatArray) -> tuple[SessionMeans, FloatArray]:
    """Both less what is expected where nothing touches the board: a drift is on taxels that do not answer as well, and
    is no part of an answer.
    """
    bins, common = state.layout.bins, np.zeros(features.shape)
    for taxels in (board.taxels for board in state.pair.boards):
        beside = np.where(state.untouched[:, None, taxels], features[:, :bins, taxels], np.nan)
        some = np.isfinite(beside).any(axis=2, keepdims=True)
        common[:, :bins, taxels] = np.nanmedian(np.where(some, beside, 0.0), axis=2, keepdims=True)
    return SessionMeans(real.value - common[:, None], real.count, real.spread), features - common


def _answers(
    state: State, real: SessionMeans, features: FloatArray
) -> tuple[FloatArray, NDArray[np.bool_], FloatArray]:
    """The share of its expected drop that each taxel shows, f64[n]; those that surely do not answer, bool[n]; and the
    largest drop that is expected of each in each cell, f64[C, n].
    """
    expected = features[:, : state.layout.bins]
    weight = state.layout.weight[: state.layout.bins, None]
    seen = np.nan_to_num(real.value[:, :, : state.layout.bins])
    known = np.isfinite(real.value[:, :, : state.layout.bins])
    power = np.einsum("csfn,cfn->sn", known * weight, expected**2)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.einsum("csfn,cfn->sn", weight * seen, expected) / power
    count = np.isfinite(ratio).sum(axis=0)
    mean = known_mean(ratio, 0)
    squares = np.where(np.isfinite(ratio), (ratio - mean) ** 2, 0.0).sum(axis=0)
    error = np.where(count > 1, np.sqrt(squares / np.maximum(count * (count - 1), 1)), ONE_SESSION)
    silent = (mean < DEAD) & (np.nan_to_num(mean + SURELY * error, nan=np.inf) < SURE)
    shown = np.nan_to_num(known_mean(real.value[:, :, : state.layout.bins], 1))
    there = known.any(axis=1) * weight
    silent &= np.einsum("cfn,cfn->n", there, shown**2) < LOUD**2 * np.einsum("cfn,cfn->n", there, expected**2)
    return mean, silent, np.asarray(expected.max(axis=1))


def _median_of_board(noise: FloatArray, sensor: NDArray[np.intp]) -> FloatArray:
    """Of each taxel's board, f64[n]; NaN where nothing is known."""
    result = np.full(len(noise), np.nan)
    for board in np.unique(sensor):
        known = noise[(sensor == board) & np.isfinite(noise)]
        if len(known):
            result[sensor == board] = np.median(known)
    return result
