"""Changes of the sensitivity between sessions, and between the contacts of a session.

The excess contains only what all sessions have in common, and therefore none of these changes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.pair import Pair
from taxel.gap.features.distributions import compute_fisher_survival, compute_student_survival
from taxel.types import FloatArray

MIN_RELATIVE_LOAD: Final = 0.1
"""Sum of squared predicted signals of a board in a grasp, relative to the largest such sum of this board, above which
the sensitivity of the board is estimated. Chosen."""

SIGNIFICANCE_LEVEL: Final = 0.05
"""Largest corrected p-value of a significant result. Chosen: the usual level."""

WITHIN_SESSION_VARIANCE: Final = 1.0 / 12.0
"""Variance of a sensitivity that changes linearly by 1 over a session: the variance of a uniform distribution."""

MIN_SESSIONS_OF_TREND: Final = 4
"""Smallest number of sessions for which a change in the same direction from each session to the next is stated. Chosen:
S sessions without a trend are in ascending or descending order with the probability 2 / S!, 1/12 for 4 sessions, but
1/3 for 3 sessions."""


class SensitivityTest(NamedTuple):
    """Estimate and test of a change of the sensitivity of one board, or of the whole hand.

    size: change of the ratio of real to predicted signal (dimensionless): between sessions the standard deviation,
    within a session the change from the first to the last contact. p_value: of the hypothesis that there is no change;
    None if untested. is_monotone: whether the ratio changes in the same direction from each session to the next.
    size_error: standard error that the caller subtracts from `size` (in squares); 0 if `size` is already corrected for
    the error of the estimate.
    """

    size: float
    p_value: float | None
    is_monotone: bool
    size_error: float


_NO_CHANGE: Final = SensitivityTest(size=0.0, p_value=None, is_monotone=False, size_error=0.0)
"""Result of a test without sufficient data."""


@dataclass(frozen=True, eq=False)
class SensitivityChange:
    """A change of sensitivity.

    name: `session`, between sessions, or `presses`, between the contacts of a session. size: relative change of the
    hand: the standard deviation between sessions, negative if the sensitivity decreases from session to session, or the
    change from the first to the last contact of a session. added_gap2: contribution of the change to the squared gap,
    counts^2. p_value: corrected for the number of boards; None if untested. boards: boards with a significant change of
    their own, largest first. is_monotone: whether the sensitivity changes in the same direction from each session to
    the next.
    """

    name: str
    size: float
    added_gap2: float
    p_value: float | None
    boards: tuple[int, ...]
    is_monotone: bool = False


def compute_sensitivity_changes(pair: Pair, hold: FloatArray, counts2: float) -> list[SensitivityChange]:
    """Compute the changes of sensitivity between sessions and within sessions: one result for each, in this order.

    hold: f64[C, n] (C conditions, n taxels), predicted signals in hold, counts. counts2: weighted sum of squared
    predicted signals, with the weights of the squared gap, counts^2.
    """
    factor, weight = _estimate_factors(pair, hold)
    whole = np.einsum("rb,rb->r", np.nan_to_num(factor), weight) / np.where(
        weight.any(axis=1), weight.sum(axis=1), np.nan
    )
    columns = np.column_stack([whole, factor])  # ratio of real to predicted signal: whole hand, then each board
    session = np.searchsorted(pair.sessions, pair.real.session)
    changes = []
    for name, test, scale in (
        ("session", _test_between_sessions, 1.0),
        ("presses", _test_within_sessions, WITHIN_SESSION_VARIANCE),
    ):
        tests = [test(columns[:, k], pair.real.condition, session) for k in range(columns.shape[1])]
        p_values = [result.p_value for result in tests if result.p_value is not None]
        p_value = min(1.0, min(p_values) * len(p_values)) if p_values else None
        hand, board_tests = tests[0], tests[1:]
        boards = [k for k, result in enumerate(board_tests) if _is_significant(result.p_value, len(p_values))]
        boards.sort(key=lambda k: -abs(board_tests[k].size))
        # The squared relative change, without the variance of its estimate, times the squared signal.
        added_gap2 = scale * max(hand.size**2 - hand.size_error**2, 0.0) * counts2
        changes.append(SensitivityChange(name, hand.size, added_gap2, p_value, tuple(boards), hand.is_monotone))
    return changes


def _is_significant(p_value: float | None, tests: int) -> bool:
    """Return whether a p-value is significant among several tests (Bonferroni correction)."""
    return p_value is not None and p_value * tests < SIGNIFICANCE_LEVEL


def _estimate_factors(pair: Pair, hold: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Estimate the ratio of real to predicted signal of each board in each of the R real grasps, by least squares.

    Returns the ratios, f64[R, boards], NaN for a board that a grasp hardly loads, and the sums of squared predicted
    signals as their weights, counts^2, f64[R, boards].
    """
    sensor, count = pair.groups.sensor, len(pair.sensors.address)
    belongs = (sensor[:, None] == np.arange(count)).astype(np.float64)
    predicted = np.nan_to_num(hold)[pair.real.condition]
    known = np.isfinite(pair.real.hold_signal_counts)
    squares = np.where(known, predicted**2, 0.0) @ belongs
    shared = np.where(known, predicted * np.nan_to_num(pair.real.hold_signal_counts), 0.0) @ belongs
    is_loaded = squares > MIN_RELATIVE_LOAD * squares.max(axis=0, initial=0.0)
    ratio = np.where(is_loaded, shared / np.where(is_loaded, squares, 1.0), np.nan)
    return ratio, np.where(is_loaded, squares, 0.0)


def _make_dummies(labels: NDArray[np.intp]) -> FloatArray:
    """Return a column of zeros and ones for each distinct label."""
    return np.asarray(labels[:, None] == np.unique(labels)).astype(np.float64)


def _subtract_fit(values: FloatArray, columns: FloatArray) -> FloatArray:
    """Return values minus their least-squares fit by columns."""
    return np.asarray(values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0])


def _test_between_sessions(
    factor: FloatArray, condition: NDArray[np.intp], session: NDArray[np.intp]
) -> SensitivityTest:
    """Estimate the standard deviation between sessions, and test it by an F test (two-way analysis of variance).

    factor: f64[R] (R grasps), ratio of real to predicted signal of each real grasp, NaN if unknown. condition, session:
    [R], condition and session of each real grasp. The model is additive in condition and session; the error is their
    interaction.

    The size of the result is the standard deviation of the ratio between sessions. It is negative if the ratio
    decreases from each session to the next, in `MIN_SESSIONS_OF_TREND` sessions or more. The variance of the
    interaction is already subtracted from the squared size; the field `size_error` is therefore 0. `_NO_CHANGE` is
    returned for a single session, or if no degrees of freedom remain for the error.
    """
    known = np.isfinite(factor)
    keys, number = np.unique(np.column_stack([condition, session])[known], axis=0, return_inverse=True)
    mean = np.bincount(number.ravel(), factor[known]) / np.bincount(number.ravel()) if len(keys) else np.zeros(0)
    sessions = len(np.unique(keys[:, 1])) if len(keys) else 0
    conditions = len(np.unique(keys[:, 0])) if len(keys) else 0
    degrees_of_freedom = len(keys) - conditions - sessions + 1
    if sessions < 2 or degrees_of_freedom < 1:
        return _NO_CHANGE
    by_condition = _make_dummies(keys[:, 0])
    by_both = np.hstack([_make_dummies(keys[:, 0]), _make_dummies(keys[:, 1])])
    coefficients = np.linalg.lstsq(by_both, mean, rcond=None)[0]
    error = float(np.sum((mean - by_both @ coefficients) ** 2)) / degrees_of_freedom
    between = (float(np.sum(_subtract_fit(mean, by_condition) ** 2)) - degrees_of_freedom * error) / (sessions - 1)
    # The variance between sessions is the excess of their mean square over the error, per condition of a session.
    size = float(np.sqrt(max(between - error, 0.0) * sessions / len(keys)))
    steps = np.diff(coefficients[conditions:])
    is_monotone = sessions >= MIN_SESSIONS_OF_TREND and bool((steps > 0).all() or (steps < 0).all())
    signed_size = size * (1.0 if steps.sum() > 0 else -1.0) if is_monotone else size
    if error > 0:
        p_value = compute_fisher_survival(between / error, sessions - 1, degrees_of_freedom)
    else:  # the additive model is exact, and any difference between sessions is significant
        p_value = 0.0 if between > 0 else 1.0
    return SensitivityTest(size=signed_size, p_value=p_value, is_monotone=is_monotone, size_error=0.0)


def _test_within_sessions(
    factor: FloatArray, condition: NDArray[np.intp], session: NDArray[np.intp]
) -> SensitivityTest:
    """Estimate the change from the first to the last contact of a session, and test it by a t test.

    factor: f64[R] (R grasps), ratio of real to predicted signal of each real grasp, NaN if unknown. condition, session:
    [R], condition and session of each real grasp. The model contains effects of condition and session, and a change
    that is linear in the order of the contacts and equal in all sessions.

    The size of the result is negative for a decrease. The p-value is the larger of two: that of ordinary least squares,
    and that of errors that are correlated within a session (Liang and Zeger 1986); None below 3 sessions. `size_error`
    is the larger of the two standard errors. `_NO_CHANGE` is returned if fewer than 2 degrees of freedom remain, or if
    the effects of condition and session explain the order of the contacts completely.
    """
    known = np.isfinite(factor)
    position = np.zeros(len(factor))
    for number in np.unique(session):
        grasps = np.flatnonzero(session == number)  # grasps are in order of time
        position[grasps] = np.linspace(-0.5, 0.5, len(grasps)) if len(grasps) > 1 else 0.0
    columns = (
        np.hstack([_make_dummies(condition[known]), _make_dummies(session[known])]) if known.any() else np.zeros((0, 1))
    )
    sessions = len(np.unique(session[known]))
    degrees_of_freedom = int(known.sum()) - len(np.unique(condition[known])) - sessions
    if degrees_of_freedom < 2:
        return _NO_CHANGE
    regressor, value = _subtract_fit(position[known], columns), _subtract_fit(factor[known], columns)
    square = float(regressor @ regressor)
    if square < 1e-9:
        return _NO_CHANGE
    slope = float(regressor @ value) / square
    residual = value - slope * regressor
    error = float(np.sqrt(residual @ residual / degrees_of_freedom / square))
    p = 2.0 * compute_student_survival(abs(slope) / error, degrees_of_freedom) if error > 0 else 0.0
    if sessions < 3:
        return SensitivityTest(size=slope, p_value=None, is_monotone=False, size_error=error)
    scores = np.bincount(session[known], regressor * residual)
    clustered_error = float(np.sqrt(sessions / (sessions - 1) * scores @ scores)) / square
    clustered_p = (
        2.0 * compute_student_survival(abs(slope) / clustered_error, sessions - 1) if clustered_error > 0 else 0.0
    )
    return SensitivityTest(
        size=slope, p_value=max(p, clustered_p), is_monotone=False, size_error=max(error, clustered_error)
    )
