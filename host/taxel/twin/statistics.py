"""Monitored quantities: how one step deviates from the reference, as a score and its information for each taxel.

A quantity is an amplitude b of a pattern a: the deviation r of a value has the expectation b a and the variance v. The
best estimate over the taxels of a place is the sum of the scores u = a r / v divided by the sum of the information
w = a^2 / v (weighted least squares), so that u and w of each taxel are sufficient for every place.
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
from taxel.twin.reference import Reference, compute_signals
from taxel.twin.steps import CLOSING, HOLD, RECOVERY, RELEASE, REST, Step
from taxel.types import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class Quantity:
    """A monitored property of the skin that a fault can change.

    name: name in events. unit: unit of the amplitude of a change. amplitudes: alternative amplitudes of the test, a
    factor of about three apart: the power for a change between two of them is hardly smaller. levels: levels of the
    places at which the quantity is tested (`places.LEVELS`). words: description in messages.
    """

    name: str
    unit: str
    amplitudes: tuple[float, ...]
    levels: tuple[str, ...]
    words: str

    @property
    def is_one_sided(self) -> bool:
        """Whether only an increase of the quantity is treated as a change."""
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
"""Quantities that are measured in a contact; their variance differs between conditions (object and approach)."""

OF_CONDITIONS: Final = frozenset(("offset", "shape"))
"""Quantities of a contact for which one fault causes changes of different size in different conditions."""

Scores = dict[str, tuple[FloatArray, FloatArray]]
"""Score u and information w of each taxel (see the top of this file), f64[n] each, by name of the quantity."""

Estimates = dict[str, tuple[FloatArray, FloatArray]]
"""Estimated amplitude of the change at each place and its information (inverse variance before the scale of the null
model), f64[P] each, by name of the quantity."""

LEAST_FREE: Final = 5
"""Smallest number of unloaded taxels whose median is subtracted: the median of fewer taxels is hardly more accurate
than the value of one taxel."""

SHAPE_VARIANCE: Final = 0.1
"""Variance of the logarithm of a board's mean squared residual, before the fit of the null model (chosen: that of a
mean of twenty independent squares)."""


def compute_contact_scores(
    step: Step, reference: Reference, live: LiveSession, excluded: BoolArray
) -> tuple[Scores, FloatArray] | None:
    """Compare a contact with the reference; return its scores by quantity, and its signals f64[BINS, n], counts.

    A score is a pair for each taxel: pattern times residual divided by the variance, and pattern squared divided by the
    variance (information). Their sums over a place give the weighted least-squares estimate of the amplitude there.
    The result is None if the step has no contact, if the reference does not contain its condition, or if the variance
    of the condition is unknown. live: earlier contacts of this session. excluded: bool[n], taxels that are not tested;
    their information is 0.
    """
    known = reference.expect(step)
    if step.contact is None or known is None or not reference.has_variance(known):
        return None
    signal = compute_signals(step)
    expected, factor = live.predict(step.contact.condition, known.mean, known.repeats)
    variance = reference.compute_variance(known, step) * factor
    usable = np.isfinite(signal) & np.isfinite(variance) & ~excluded
    weight = np.where(usable, 1.0 / np.where(usable, variance, 1.0), 0.0)
    residual = np.where(usable, signal - expected, 0.0)
    board = reference.places.board
    scores: Scores = {}
    hold, hold_weight = residual[HOLD].mean(axis=0), _mean_weight(weight[HOLD])
    mean = expected[HOLD].mean(axis=0)
    # Relative changes need a response: only the taxels that are active in this condition are compared.
    pattern = np.where(mean > ACTIVE_SIGNAL_COUNTS, mean, 0.0)
    scores["gain"] = (pattern * hold * hold_weight, pattern**2 * hold_weight)
    loaded = _find_loaded(mean, board)
    hold_without_drift = hold - _find_common_offset(hold, hold_weight, pattern, board)[board]
    scores["offset"] = (hold_without_drift * hold_weight, hold_weight)
    # Delay and recovery are compared after scaling the expectation to the strength of this contact on each board.
    size = _fit_board_size(signal, expected, weight, board)
    rescaled = np.where(usable, signal - size[board] * expected, 0.0)
    scores["delay"] = _compute_delay(rescaled, expected, np.where(pattern > 0.0, weight, 0.0), step)
    # A taxel that is active after the release is pressed again by an unannounced contact.
    late = rescaled[RECOVERY]
    pressed = np.bincount(board, late > ACTIVE_SIGNAL_COUNTS, len(size)) > 0
    late_weight = np.where(pressed[board], 0.0, weight[RECOVERY])
    scores["recovery"] = (pattern * late * late_weight, pattern**2 * late_weight)
    scores["shape"] = _compute_shape(rescaled[HOLD].mean(axis=0), hold_weight, loaded, board)
    return scores, signal


def compute_rest_scores(
    step: Step, level: RestLevel, noise: NoiseLevel, excluded: BoolArray, in_contact: BoolArray | None = None
) -> tuple[Scores, BoolArray]:
    """Compare the contact-free interval of a step with the tracked values; return scores by quantity, and bool[n].

    The second value marks the taxels that an unannounced contact touches. level, noise: tracked counts without contact
    and tracked noise; this function updates both. excluded: bool[n], taxels that are not tested. in_contact: bool[n],
    taxels of boards with an unannounced contact, perhaps too light to make a taxel active: their counts without contact
    are not compared. Taxels that are not compared have the information 0.
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
    """Compute the score and information, f64[n] each, of the change of the count that all taxels of a board share.

    They are stored at the first taxel of the board. The temperature follows a random walk over short intervals, so that
    the variance of the change is proportional to the time since the last step with data (`level.idle_s`, updated).
    """
    boards = len(level.common)
    has_data = np.bincount(level.board, usable, boards) > 1
    level.idle_s += max(elapsed_s, 1.0)
    information = np.where(has_data, 1.0 / level.idle_s, 0.0)
    level.idle_s[has_data] = 0.0
    return _put_on_first_taxels(level.common * information, information, level.board)


def _put_on_first_taxels(score: FloatArray, information: FloatArray, board: IntArray) -> tuple[FloatArray, FloatArray]:
    """Store scores and information of boards, f64[s] each, at the first taxel of each board; return f64[n] each.

    board: i64[n], column of each taxel's board. All other taxels get 0, so that the sum over a board is its own value.
    """
    first = np.array([np.flatnonzero(board == number)[0] for number in range(len(score))])
    found = np.zeros((2, len(board)))
    found[0, first], found[1, first] = score, information
    return found[0], found[1]


def compute_missing(step: Step, reference: Reference) -> tuple[FloatArray, FloatArray]:
    """Return the numbers of missing and of expected frames of each board in a step, f64[s] each."""
    return (step.expected - step.received).astype(np.float64), step.expected.astype(np.float64)


def _find_common_offset(hold: FloatArray, weight: FloatArray, pattern: FloatArray, board: IntArray) -> FloatArray:
    """Return the median residual of the taxels of each board that the contact does not load, f64[s], counts.

    hold: f64[n], mean residual of each taxel in the hold, counts. weight: f64[n], 0 for an unusable taxel. pattern:
    f64[n], expected signal, counts; 0 for a taxel that the contact does not load. board: i64[n], column of each taxel's
    board. The median is 0 for a board with fewer than `LEAST_FREE` such taxels. The temperature of a board drifts in
    one direction for minutes; without this correction, its effect would be correlated between successive contacts.
    """
    is_unloaded = (weight > 0.0) & (pattern == 0.0)
    offset = np.zeros(int(board.max()) + 1)
    for column in range(len(offset)):
        unloaded = is_unloaded & (board == column)
        if unloaded.sum() >= LEAST_FREE:
            offset[column] = np.median(hold[unloaded])
    return offset


def _mean_weight(weight: FloatArray) -> FloatArray:
    """Return the weight (inverse variance) of each taxel's mean over time bins, f64[n], from weights f64[bins, n].

    The bins of one contact deviate together, so that averaging them does not reduce the variance: the weight of the
    mean is the mean of the weights.
    """
    return np.asarray(weight.mean(axis=0))


def _find_loaded(pattern: FloatArray, board: IntArray) -> BoolArray:
    """Return whether a contact loads each board, bool[s]: at least one taxel of the board is expected to be active."""
    largest = np.zeros(int(board.max()) + 1)
    np.maximum.at(largest, board, pattern)
    return np.asarray(largest > ACTIVE_SIGNAL_COUNTS)


def _fit_board_size(signal: FloatArray, expected: FloatArray, weight: FloatArray, board: IntArray) -> FloatArray:
    """Fit the factor between measured and expected signal in the hold phase for each board, f64[s]; near 1 without
    load.
    """
    pattern, hold_weight = expected[HOLD].mean(axis=0), _mean_weight(weight[HOLD])
    value = np.where(hold_weight > 0.0, np.nan_to_num(signal[HOLD].mean(axis=0)), 0.0)
    boards = int(board.max()) + 1
    product = np.bincount(board, pattern * value * hold_weight, boards)
    square = np.bincount(board, pattern**2 * hold_weight, boards)
    return np.asarray((product + 1.0) / (square + 1.0))  # 1.0: weak prior for the factor 1


def _compute_delay(
    residual: FloatArray, expected: FloatArray, weight: FloatArray, step: Step
) -> tuple[FloatArray, FloatArray]:
    """Compute the scores and the information of a delay, f64[n] each; 0 for a step without contact.

    A small delay changes the signal by the delay times minus the slope of the expected signal (counts per second).
    residual: f64[BINS, n], measured minus expected signal. weight: f64[BINS, n], 0 for taxels that are not active in
    this condition: the slope of their expected signal is only noise.
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
    """Compute the scores and the information, f64[n] each, of a change of the contact pattern on each loaded board.

    The estimate of a board is the logarithm of its mean squared residual (residual: f64[n], counts; weight: f64[n],
    inverse variance). It is stored at the first taxel of the board; the other taxels get 0.
    """
    boards = len(loaded)
    used = np.bincount(board, weight > 0.0, boards)
    square = np.bincount(board, residual**2 * weight, boards)
    value = np.log((square + 1.0) / (used + 1.0))  # 1.0: weak prior for the usual value 1
    information = np.where(loaded & (used > 1), 1.0 / SHAPE_VARIANCE, 0.0)
    return _put_on_first_taxels(value * information, information, board)


def sum_over_places(scores: Mapping[str, tuple[FloatArray, FloatArray]], reference: Reference) -> Estimates:
    """Combine the scores of the taxels of each place to the estimate of its change; the estimate is 0 without
    information.
    """
    members = reference.places.members
    estimates: Estimates = {}
    for name, (score, information) in scores.items():
        total, weight = members @ score, members @ information
        estimate = np.where(weight > 0.0, total / np.where(weight > 0.0, weight, 1.0), 0.0)
        estimates[name] = (np.asarray(estimate), weight)
    return estimates
