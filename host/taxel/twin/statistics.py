"""Monitored quantities: how one step deviates from the reference, as a score and its information for each taxel.

A quantity is an amplitude b of a pattern a: the deviation r of a value has the expectation b a and the variance v. The
best estimate over the taxels of a place is the sum of u = a r / v divided by the sum of w = a^2 / v (weighted least
squares), so that u and w of each taxel are sufficient for every place.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from taxel.recording.grasp_format import ACTIVE_SIGNAL_COUNTS
from taxel.signal.rest_level import UNKNOWN_VARIANCE, RestLevel
from taxel.twin.live_session import LiveSession
from taxel.twin.noise_level import NoiseLevel
from taxel.twin.reference import LEAST_REPEATS, Reference, compute_signals
from taxel.twin.steps import CLOSING, HOLD, RECOVERY, RELEASE, REST, Step
from taxel.types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class Quantity:
    """A quantity that can change. name: in events. unit: of its amplitude. levels: of places at which it is tested.

    amplitudes: alternatives of the test, a factor of about three apart: a change between two of them loses little
    power. words: for people, with `{size}`.
    """

    name: str
    unit: str
    amplitudes: tuple[float, ...]
    levels: tuple[str, ...]
    words: str

    @property
    def is_one_sided(self) -> bool:
        """Whether only an increase is a change."""
        return min(self.amplitudes) > 0.0


_ALL: Final = ("taxel", "tx", "rx", "board", "skin")

QUANTITIES: Final = (
    Quantity("gain", "1", (-1.0, -0.6, -0.3, -0.1, 0.1, 0.3, 0.8), _ALL, "the response to contact"),
    Quantity("offset", "counts", (-100.0, -30.0, -10.0, 10.0, 30.0, 100.0), _ALL[:3], "the signal during a contact"),
    Quantity("delay", "s", (-0.2, -0.06, -0.02, 0.02, 0.06, 0.2), _ALL, "the delay of the response"),
    Quantity("recovery", "1", (-0.1, -0.03, 0.03, 0.1, 0.3), _ALL, "the signal after release"),
    Quantity("noise", "ln", (-4.0, -1.0, 0.4, 1.2, 4.0), _ALL, "the noise without contact"),
    Quantity("rest", "counts", (-100.0, -30.0, -10.0, -3.0, 3.0, 10.0, 30.0, 100.0), _ALL[:3], "the count at rest"),
    Quantity(
        "drift",
        "counts",
        (-1000.0, -300.0, -100.0, -30.0, -10.0, 10.0, 30.0, 100.0, 300.0, 1000.0),
        ("board", "skin"),
        "the common count at rest",
    ),
    Quantity("shape", "ln", (0.5, 1.5, 4.0), ("board", "skin"), "the pattern of a contact"),
    Quantity("missing", "1", (0.01, 0.05, 0.3, 1.0), ("board", "skin"), "the share of missing frames"),
)
"""All monitored quantities."""

OF_CONTACTS: Final = frozenset(("gain", "offset", "delay", "recovery", "shape"))
"""Quantities of a contact, whose variance differs between conditions."""

OF_CONDITIONS: Final = frozenset(("offset", "shape"))
"""Quantities of a contact whose changes have another size in each condition."""

Scores = dict[str, tuple[FloatArray, FloatArray]]
"""Score u and information w of each taxel, f64[n] each, by quantity."""

LEAST_FREE: Final = 5
"""Smallest number of taxels without load whose median is subtracted: the median of fewer is no better than one of
them."""

SHAPE_VARIANCE: Final = 0.1
"""Variance of the logarithm of a board's mean squared residual, before the fit of the null model (chosen: that of a
mean of twenty independent squares)."""


def compute_contact_scores(
    step: Step, reference: Reference, live: LiveSession, excluded: BoolArray
) -> tuple[Scores, FloatArray] | None:
    """Scores of a contact, and its signals f64[BINS, n]; None if the reference does not have its condition.

    live: earlier contacts of this session. excluded: bool[n], taxels that are not tested.
    """
    if step.contact is None or step.contact.condition not in reference.conditions:
        return None
    condition = step.contact.condition
    own = reference.conditions[condition]
    if own.repeats < LEAST_REPEATS:
        return None
    signal = compute_signals(step)
    expected, factor = live.predict(condition, own.mean, own.repeats)
    variance = reference.compute_variance(condition, step) * factor
    usable = np.isfinite(signal) & np.isfinite(variance) & ~excluded
    weight = np.where(usable, 1.0 / np.where(usable, variance, 1.0), 0.0)
    residual = np.where(usable, signal - expected, 0.0)
    board = reference.places.board
    scores: Scores = {}
    hold, hold_weight = residual[HOLD].mean(axis=0), _mean_weight(weight[HOLD])
    mean = expected[HOLD].mean(axis=0)
    # A response is compared where there is one: on the taxels that are active in this condition.
    pattern = np.where(mean > ACTIVE_SIGNAL_COUNTS, mean, 0.0)
    scores["gain"] = (pattern * hold * hold_weight, pattern**2 * hold_weight)
    loaded = _find_loaded(mean, board)
    own_hold = hold - _find_common_offset(hold, hold_weight, pattern, board)[board]
    scores["offset"] = (own_hold * hold_weight, hold_weight)
    # Delay and recovery are compared at the size that the contact has on its board.
    size = _fit_board_size(signal, expected, weight, board)
    rescaled = np.where(usable, signal - size[board] * expected, 0.0)
    scores["delay"] = _compute_delay(rescaled, expected, np.where(pattern > 0.0, weight, 0.0), step)
    # An active taxel after the release is pressed again by something that nobody has announced.
    late = rescaled[RECOVERY]
    pressed = np.bincount(board, late > ACTIVE_SIGNAL_COUNTS, len(size)) > 0
    late_weight = np.where(pressed[board], 0.0, weight[RECOVERY])
    scores["recovery"] = (pattern * late * late_weight, pattern**2 * late_weight)
    scores["shape"] = _compute_shape(rescaled[HOLD].mean(axis=0), hold_weight, loaded, board)
    return scores, signal


def compute_rest_scores(
    step: Step, level: RestLevel, noise: NoiseLevel, excluded: BoolArray, in_contact: BoolArray | None = None
) -> tuple[Scores, BoolArray]:
    """Scores of the interval without contact of a step, and the taxels that something touches, bool[n].

    level, noise: tracked counts at rest and noise; both are updated. in_contact: bool[n], taxels of boards that
    something presses without an announcement, perhaps too lightly to make a taxel active: their count at rest is not
    compared.
    """
    mean, lowest = step.compute_rest()
    touched = level.find_touched(mean, lowest, ACTIVE_SIGNAL_COUNTS)
    skip = excluded | touched | ~np.isfinite(mean)
    known = level.is_known
    pressed = skip if in_contact is None else skip | in_contact
    residual, variance = level.update(mean, step.count[REST], pressed)
    weight = np.where(pressed | (variance >= UNKNOWN_VARIANCE), 0.0, 1.0 / variance)
    value, information = noise.compare(step.squared_difference, step.pairs, skip)
    noise.add(step.squared_difference, step.pairs, skip)
    scores: Scores = {"rest": (residual * weight, weight), "noise": (value * information, information)}
    scores["drift"] = _compute_drift(level, step.end_s - step.start_s, ~pressed & known)
    return scores, touched


def _compute_drift(level: RestLevel, elapsed_s: float, usable: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Scores of the common change of each board, on the first taxel of the board.

    The change of a temperature is a random walk in short intervals: its variance is proportional to the time.
    """
    boards = len(level.common)
    has_data = np.bincount(level.board, usable, boards) > 1
    level.idle_s += max(elapsed_s, 1.0)
    information = np.where(has_data, 1.0 / level.idle_s, 0.0)
    level.idle_s[has_data] = 0.0
    return _put_on_first_taxels(level.common * information, information, level.board)


def _put_on_first_taxels(score: FloatArray, information: FloatArray, board: IntArray) -> tuple[FloatArray, FloatArray]:
    """Scores of boards f64[s] as scores of taxels f64[n]: on the first taxel of each board, 0 on the others."""
    first = np.array([np.flatnonzero(board == number)[0] for number in range(len(score))])
    found = np.zeros((2, len(board)))
    found[0, first], found[1, first] = score, information
    return found[0], found[1]


def compute_missing(step: Step, reference: Reference) -> tuple[FloatArray, FloatArray]:
    """Missing and expected frames of each board, f64[s] each."""
    return (step.expected - step.received).astype(np.float64), step.expected.astype(np.float64)


def _find_common_offset(hold: FloatArray, weight: FloatArray, pattern: FloatArray, board: IntArray) -> FloatArray:
    """Median residual of the taxels of each board that a contact does not load, f64[s]; 0 with few such taxels.

    The temperature of a board drifts in one direction for minutes, so that this part of successive contacts is not
    independent.
    """
    free = (weight > 0.0) & (pattern == 0.0)
    found = np.zeros(int(board.max()) + 1)
    for column in range(len(found)):
        own = free & (board == column)
        if own.sum() >= LEAST_FREE:
            found[column] = np.median(hold[own])
    return found


def _mean_weight(weight: FloatArray) -> FloatArray:
    """Weight of the mean of bins whose deviations are common to the bins, f64[n]: the mean of the weights."""
    return np.asarray(weight.mean(axis=0))


def _find_loaded(pattern: FloatArray, board: IntArray) -> BoolArray:
    """Boards that a contact loads: at least one taxel is expected to be active, bool[s]."""
    largest = np.zeros(int(board.max()) + 1)
    np.maximum.at(largest, board, pattern)
    return np.asarray(largest > ACTIVE_SIGNAL_COUNTS)


def _fit_board_size(signal: FloatArray, expected: FloatArray, weight: FloatArray, board: IntArray) -> FloatArray:
    """Size of the contact in the hold relative to the expectation, for each board, f64[s]; near 1 without load."""
    pattern, own = expected[HOLD].mean(axis=0), _mean_weight(weight[HOLD])
    value = np.where(own > 0.0, np.nan_to_num(signal[HOLD].mean(axis=0)), 0.0)
    boards = int(board.max()) + 1
    product = np.bincount(board, pattern * value * own, boards)
    square = np.bincount(board, pattern**2 * own, boards)
    return np.asarray((product + 1.0) / (square + 1.0))


def _compute_delay(
    residual: FloatArray, expected: FloatArray, weight: FloatArray, step: Step
) -> tuple[FloatArray, FloatArray]:
    """Scores of a delay: the pattern is minus the slope of the expected signal, counts per second.

    weight: f64[BINS, n], 0 for taxels that are not active in this condition, whose slopes are those of noise.
    """
    score, information = np.zeros(residual.shape[1]), np.zeros(residual.shape[1])
    if step.contact is None:
        return score, information
    times = step.contact.times_s
    for bins, begin, end in ((CLOSING, times[0], times[1]), (RELEASE, times[2], times[3])):
        width = max((end - begin) / (bins.stop - bins.start), 1e-3)
        for number in range(bins.start, bins.stop):
            slope = (expected[number + 1] - expected[number - 1]) / (2.0 * width)
            score -= slope * residual[number] * weight[number]
            information += slope**2 * weight[number]
    return score, information


def _compute_shape(
    residual: FloatArray, weight: FloatArray, loaded: BoolArray, board: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Scores of the residual pattern of each loaded board: log of its mean square, on the first taxel of the board."""
    boards = len(loaded)
    used = np.bincount(board, weight > 0.0, boards)
    square = np.bincount(board, residual**2 * weight, boards)
    value = np.log((square + 1.0) / (used + 1.0))
    information = np.where(loaded & (used > 1), 1.0 / SHAPE_VARIANCE, 0.0)
    return _put_on_first_taxels(value * information, information, board)


def sum_over_places(scores: Mapping[str, tuple[FloatArray, FloatArray]], reference: Reference) -> Scores:
    """Estimate and information of each place, f64[P] each, by quantity; the estimate is 0 without information."""
    members = reference.places.members
    found: Scores = {}
    for name, (score, information) in scores.items():
        total, weight = members @ score, members @ information
        found[name] = (np.asarray(np.where(weight > 0.0, total / np.where(weight > 0.0, weight, 1.0), 0.0)), weight)
    return found
