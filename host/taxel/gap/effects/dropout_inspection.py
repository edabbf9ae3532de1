"""Inspection of the recordings for taxels, lines and boards without response."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.effects.dead_taxels import (
    LOADED_COUNTS,
    RESPONSE_SHARE,
    find_affected_lines,
    find_dead_lines,
    find_dead_taxels,
    find_taxels_on_line,
    is_line_evident,
    is_response_on_other_line,
)
from taxel.gap.effects.dropout import Defects
from taxel.gap.effects.shorts import find_shorts
from taxel.gap.features.features import COUNTS_MISSING, SessionMeans, compute_known_mean
from taxel.gap.fitting.state import State
from taxel.types import FloatArray

MIN_EXPECTED_COUNTS: Final = 40.0
"""Largest expected signal above which the response of a taxel is evaluated, counts.

Chosen: below `LOADED_COUNTS`, so that weakly loaded taxels beside a loaded dead taxel are evaluated too.
"""

MAX_DEAD_SHARE: Final = 0.2
"""Share of the expected signal below which a taxel does not respond. Chosen."""

RESPONSE_RMS_SHARE: Final = 0.35
"""RMS of the measured signals over the RMS of the expected signals, above which a taxel responds.

Chosen: a taxel with signals that overflow, or that is loaded in other conditions than expected, is not dead.
"""

MIN_MISSING_SHARE: Final = 0.02
"""Smallest reported share of missing frames of a board beyond the share in the simulation. Chosen: a smaller share
occurs by chance."""

SINGLE_SESSION_ERROR: Final = 0.1
"""Standard error of the response of a taxel if only one session is known, as a share of the expected signal. Chosen."""

CONFIDENCE_ERRORS: Final = 3.0
"""Distance to `RESPONSE_SHARE` at which a missing response is significant, in standard errors. Chosen."""

STUCK_NOISE_SHARE: Final = 0.1
"""Share of the median noise of the board below which a taxel has a constant raw count. Chosen."""


def find_defects(
    state: State, real: SessionMeans, features: FloatArray, selection: NDArray[np.bool_] | None = None
) -> Defects:
    """Return the dead and stuck taxels, dead lines, shorts, and missing frames of the real recording.

    real: measured features. features: f64[C, F, n] (C conditions, F features, n taxels), expected features. selection:
    bool[C, n], taxels and conditions that are inspected; None: all. A line without response is not reported as dead if
    another line of the board shows its expected signals: the two lines are then exchanged.
    """
    n, sensor = state.pair.n, state.pair.groups.sensor
    real, features = _subtract_common_drift(state, real, features)
    if selection is not None:
        real = real.select_taxels(selection)
        features = np.where(selection[:, None], features, 0.0)
    response, has_no_response, expected = _compute_responses(state, real, features)
    can_be_judged = (expected > MIN_EXPECTED_COUNTS).any(axis=0)
    noise = compute_known_mean(real.value[:, :, state.layout.noise].reshape(-1, n), 0)
    stuck = np.nan_to_num(noise, nan=np.inf) < STUCK_NOISE_SHARE * _compute_board_medians(noise, sensor)
    missing = np.zeros(int(sensor.max()) + 1)
    real_missing = compute_known_mean(real.value[:, :, state.layout.missing].reshape(-1, n), 0)
    real_missing = np.nan_to_num(real_missing) / COUNTS_MISSING
    simulated_missing = features[:, state.layout.missing].mean(axis=0) / COUNTS_MISSING
    for board in range(len(missing)):
        excess = float(np.mean((real_missing - simulated_missing)[sensor == board]))
        missing[board] = excess if excess > MIN_MISSING_SHARE else 0.0
    # A board without frames has no response either; its taxels are not dead.
    is_silent = ((has_no_response & can_be_judged) | stuck) & (missing[sensor] < 0.9)
    all_silent = is_silent.copy()
    for line in find_affected_lines(state, is_silent & ~stuck & (expected > LOADED_COUNTS).any(axis=0)):
        if is_response_on_other_line(state, real, features, line, all_silent):
            is_silent &= ~find_taxels_on_line(state, line) | stuck
    judged_response = np.where(can_be_judged, response, np.nan)
    dead, is_evident = find_dead_taxels(state, judged_response, is_silent, expected)
    dead |= is_silent & stuck
    lines = find_dead_lines(state, dead, can_be_judged | stuck)
    on_lines = np.zeros(n, bool)
    for line in lines:
        on_lines |= find_taxels_on_line(state, line)
    shorts = find_shorts(state, real, features)
    is_evident = is_evident or any(is_line_evident(state, judged_response, line) for line in lines)
    is_evident = is_evident or any(short.pairs > 1 for short in shorts)
    return Defects(dead & ~on_lines, tuple(lines), missing, dead | on_lines, stuck, shorts, is_evident)


def _subtract_common_drift(state: State, real: SessionMeans, features: FloatArray) -> tuple[SessionMeans, FloatArray]:
    """Return measured and expected features without the expected median signal of the unloaded taxels of each board.

    features: f64[C, F, n] (C conditions, F features, n taxels), expected features. The median is the drift that all
    taxels of the board share. It is not treated as a response, because drift also acts on dead taxels. Nothing is
    subtracted on a board without unloaded taxels.
    """
    bins, common = state.layout.bins, np.zeros(features.shape)
    for taxels in (board.taxels for board in state.pair.boards):
        unloaded = np.where(state.is_unloaded[:, None, taxels], features[:, :bins, taxels], np.nan)
        has_unloaded = np.isfinite(unloaded).any(axis=2, keepdims=True)
        common[:, :bins, taxels] = np.nanmedian(np.where(has_unloaded, unloaded, 0.0), axis=2, keepdims=True)
    return SessionMeans(real.value - common[:, None], real.count, real.repeat_variance), features - common


def _compute_responses(
    state: State, real: SessionMeans, features: FloatArray
) -> tuple[FloatArray, NDArray[np.bool_], FloatArray]:
    """Return the response of each taxel, whether the response is significantly missing, and the expected signals.

    real: measured features. features: f64[C, F, n] (C conditions, F features, n taxels), expected features.

    The returned arrays are:

    - Response, f64[n]: ratio of measured to expected signal, mean over the sessions; NaN without expected signal.
    - Whether the response is significantly missing, bool[n].
    - Largest magnitude of the expected signal in each condition, f64[C, n], counts. A component of a vector taxel can
      have negative signals only.
    """
    expected = features[:, : state.layout.bins]
    weight = state.layout.weight[: state.layout.bins, None]
    measured = np.nan_to_num(real.value[:, :, : state.layout.bins])
    is_known = np.isfinite(real.value[:, :, : state.layout.bins])
    # Ratio of measured to expected signal in each session, by weighted least squares. Axes: c conditions, s sessions,
    # f time bins, n taxels.
    power = np.einsum("csfn,cfn->sn", is_known * weight, expected**2)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.einsum("csfn,cfn->sn", weight * measured, expected) / power
    count = np.isfinite(ratio).sum(axis=0)
    mean = compute_known_mean(ratio, 0)
    squares = np.where(np.isfinite(ratio), (ratio - mean) ** 2, 0.0).sum(axis=0)
    error = np.where(count > 1, np.sqrt(squares / np.maximum(count * (count - 1), 1)), SINGLE_SESSION_ERROR)
    upper_limit = np.nan_to_num(mean + CONFIDENCE_ERRORS * error, nan=np.inf)
    has_no_response = (mean < MAX_DEAD_SHARE) & (upper_limit < RESPONSE_SHARE)
    session_mean = np.nan_to_num(compute_known_mean(real.value[:, :, : state.layout.bins], 1))
    known_weight = is_known.any(axis=1) * weight
    measured_power = np.einsum("cfn,cfn->n", known_weight, session_mean**2)
    expected_power = np.einsum("cfn,cfn->n", known_weight, expected**2)
    has_no_response &= measured_power < RESPONSE_RMS_SHARE**2 * expected_power
    return mean, has_no_response, np.asarray(np.abs(expected).max(axis=1))


def _compute_board_medians(noise: FloatArray, sensor: NDArray[np.intp]) -> FloatArray:
    """Return the median noise of the board of each taxel, f64[n] (n taxels); NaN for a board without known noise.

    noise: f64[n], NaN if unknown. sensor: [n], column of the board.
    """
    result = np.full(len(noise), np.nan)
    for board in np.unique(sensor):
        known = noise[(sensor == board) & np.isfinite(noise)]
        if len(known):
            result[sensor == board] = np.median(known)
    return result
