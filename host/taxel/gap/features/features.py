"""Features of every grasp and taxel, all in counts, with the weights of the method (docs/gap-diagnosis.md)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.pair import Pair
from taxel.gap.data.reading import Recording
from taxel.gap.data.time_grid import TimeGrid
from taxel.recording.grasp_format import Phase
from taxel.types import FloatArray

COUNTS_PER_SECOND: Final = 300.0
"""Factor from an onset in seconds to counts. Chosen: an onset that is 0.1 s late is an error of 30 counts on
each taxel of the board."""

COUNTS_MISSING: Final = 1000.0
"""Factor from the share of missing frames to counts. Chosen: a board without any frame is an error of 1000
counts on its loaded taxels."""

UNLOADED_COUNTS: Final = 20.0
"""Largest simulated signal of an unloaded taxel, counts, without the noise (see `find_unloaded_taxels`)."""

WEIGHTS: Final = {"hold": 0.35, "closing": 0.2, "release": 0.1, "recovery": 0.1, "noise": 0.1, "missing": 0.05}
"""Weight of each family of features in the squared gap. Together with onset and drift residual the sum is 1."""

POOLED_SHARE: Final = 0.5
"""Share of the mean over the conditions in the estimated variance of a feature. Chosen: half of the estimate."""

ONSET_WEIGHT: Final = 0.05
"""Weight of the onset in the squared gap."""

DRIFT_RESIDUAL_WEIGHT: Final = 0.05
"""Weight of the drift residual in the squared gap."""

_PHASE_NAMES: Final = {
    Phase.CLOSING: "closing",
    Phase.HOLD: "hold",
    Phase.RELEASE: "release",
    Phase.RECOVERY: "recovery",
}


@dataclass(frozen=True, eq=False)
class FeatureLayout:
    """Positions and weights of the F features of a taxel.

    The order is: signal in B bins, noise in baseline and in hold, missing frames, onset, drift residual. phase: u8[F],
    phase to which a feature belongs. weight: f64[F], weights in the squared gap, with the sum 1. bins: B.
    """

    phase: NDArray[np.uint8]
    weight: FloatArray
    bins: int

    @property
    def noise(self) -> slice:
        """Positions of the two noise features."""
        return slice(self.bins, self.bins + 2)

    @property
    def missing(self) -> int:
        """Position of the share of missing frames, times `COUNTS_MISSING`."""
        return self.bins + 2

    @property
    def onset(self) -> int:
        """Position of the onset of the board, times `COUNTS_PER_SECOND`."""
        return self.bins + 3

    @property
    def drift_residual(self) -> int:
        """Position of the drift residual: RMS of the signal after release, of unloaded taxels only."""
        return self.bins + 4

    @property
    def count(self) -> int:
        """Number of features, F."""
        return self.bins + 5

    @property
    def families(self) -> tuple[slice, ...]:
        """Positions of each family: signal, noise, missing frames, onset, drift residual."""
        single = (self.missing, self.onset, self.drift_residual)
        return (slice(0, self.bins), self.noise, *(slice(one, one + 1) for one in single))

    def compute_scale(self, conditions: int, taxels: int) -> FloatArray:
        """Return the factor from a squared difference to its contribution to the squared gap, f64[F, 1] (F features).

        The difference is that of one feature of one taxel in one condition. conditions, taxels: their numbers, C and n.
        """
        return self.weight[:, None] / (conditions * taxels)

    @classmethod
    def from_time_grid(cls, time_grid: TimeGrid) -> FeatureLayout:
        """Return the layout for a time grid. The weight of an absent phase is distributed to all other features."""
        phases = [int(phase) for phase, _ in time_grid.bins]
        weights = [WEIGHTS[_PHASE_NAMES[phase]] / len(time_grid.find_bins(phase)) for phase, _ in time_grid.bins]
        # noise in baseline and in hold, missing frames, onset, drift residual
        phases += [Phase.BASELINE, Phase.HOLD, Phase.HOLD, Phase.CLOSING, phases[-1]]
        weights += [WEIGHTS["noise"] / 2, WEIGHTS["noise"] / 2, WEIGHTS["missing"], ONSET_WEIGHT, DRIFT_RESIDUAL_WEIGHT]
        weight = np.array(weights)
        return cls(np.array(phases, np.uint8), weight / weight.sum(), len(time_grid.bins))


@dataclass(frozen=True, eq=False)
class SessionMeans:
    """Mean features over the repeats of each condition in each session.

    value: f64[C, S, F, n] (C conditions, F features, n taxels), counts; NaN where unknown, and where a session lacks
    the condition. count: i64[C, S], number of repeats. repeat_variance: f64[C, F, n], counts^2, pooled variance of one
    grasp about the mean of its session; NaN for conditions without repeats.
    """

    value: FloatArray
    count: NDArray[np.int64]
    repeat_variance: FloatArray

    @cached_property
    def is_known(self) -> NDArray[np.bool_]:
        """Which values are known, bool[C, S, F, n] (C conditions, S sessions, F features, n taxels)."""
        return np.isfinite(self.value)

    @cached_property
    def mean(self) -> FloatArray:
        """Mean over the sessions, f64[C, F, n] (C conditions, F features, n taxels); NaN where it is unknown."""
        return compute_known_mean(self.value, 1)

    @cached_property
    def variance(self) -> FloatArray:
        """Variance of the value of one session, counts^2, f64[C, F, n] (C conditions, F features, n taxels).

        If a condition has a value of only one session, the variance is that of its repeats divided by their number, or
        else the mean variance of the other conditions.
        """
        count = self.is_known.sum(axis=1)
        squares = np.where(self.is_known, (self.value - self.mean[:, None]) ** 2, 0.0).sum(axis=1)
        between = squares / np.where(count > 1, count - 1, np.nan)
        within = self.repeat_variance / np.maximum(self.count.sum(axis=1), 1)[:, None, None]
        result = np.where(np.isfinite(between), between, within)
        return np.where(np.isfinite(result), result, compute_known_mean(result, 0))

    @cached_property
    def mean_variance(self) -> FloatArray:
        """Variance of `mean`, counts^2, f64[C, F, n] (C conditions, F features, n taxels); 0 where unknown.

        One half of the variance is the mean over the conditions: few repeats estimate a variance poorly, and shrinkage
        towards the mean is the usual remedy (Smyth 2004).
        """
        variance = np.nan_to_num(self.variance) / np.maximum(self.is_known.sum(axis=1), 1)
        return np.asarray((1.0 - POOLED_SHARE) * variance + POOLED_SHARE * variance.mean(axis=0))

    def compute_residual(self, features: FloatArray) -> FloatArray:
        """Return the values minus features f64[C, F, n] (C conditions, F features, n taxels) as f64[C, S, F, n] (S
        sessions); 0 where unknown.
        """
        return np.where(self.is_known, self.value - features[:, None], 0.0)

    @cached_property
    def pair_weight(self) -> FloatArray:
        """Number of all pairs of sessions divided by the number of pairs in which both have a value, f64[C, F, n] (C
        conditions, F features, n taxels).

        With this weight the products of different sessions have the sum that is expected without unknown values. 0 if
        fewer than two sessions have the value; 1 everywhere in a dataset of one session.
        """
        sessions, count = self.is_known.shape[1], self.is_known.sum(axis=1)
        if sessions < 2:
            return np.ones(count.shape)
        return np.where(count > 1, sessions * (sessions - 1) / np.maximum(count * (count - 1), 1), 0.0)

    def compute_squared_difference(self, session: int, features: FloatArray, scale: FloatArray) -> float:
        """Return the sum of the squared differences between a session and features f64[C, F, n] (C conditions, F
        features, n taxels), each times `scale`, f64[F, 1].

        If the session lacks values that other sessions have, the sum is scaled up by the ratio of the weights.
        """
        known, residual = self.is_known[:, session], self.compute_residual(features)[:, session]
        weight_of_all, weight_of_known = (
            float(np.sum(np.where(mask, scale, 0.0))) for mask in (self.is_known.any(axis=1), known)
        )
        return float(np.sum(scale * residual**2)) * (weight_of_all / weight_of_known if weight_of_known > 0 else 0.0)

    def restrict_to_known(self, other: SessionMeans) -> SessionMeans:
        """Return these means with NaN for each feature that no session of another recording has.

        For example, the onset of a board has no counterpart if the other recording does not load this board.
        """
        has_counterpart = np.any(other.is_known, axis=1, keepdims=True)
        return SessionMeans(np.where(has_counterpart, self.value, np.nan), self.count, self.repeat_variance)

    def with_reference_variance(self, other: SessionMeans) -> SessionMeans:
        """Return these means with the variance between the sessions of a reference recording added.

        The mean of the reference takes the place of a simulation. The deviation of one session of the reference from
        the mean of the reference is scaled and subtracted from each session of this recording. The factor is chosen
        such that the variance of the mean of this recording increases by the variance of the mean of the reference. The
        means do not change. If either recording has only one session, the result is this object itself.
        """
        reference_sessions, sessions = other.value.shape[1], self.value.shape[1]
        if reference_sessions < 2 or sessions < 2:
            return self
        deviation = (other.value - other.mean[:, None])[:, np.arange(sessions) % reference_sessions]
        deviation = np.nan_to_num(deviation - compute_known_mean(deviation, 1)[:, None])
        sampled = (deviation**2).sum(axis=1) / (sessions - 1)
        wanted = np.nan_to_num(other.variance) * sessions / reference_sessions
        factor = np.sqrt(np.divide(wanted, sampled, out=np.zeros_like(sampled), where=sampled > 0.0))
        return SessionMeans(self.value - factor[:, None] * deviation, self.count, self.repeat_variance)

    def select_taxels(self, selection: NDArray[np.bool_]) -> SessionMeans:
        """Return these means with NaN outside a selection. selection: bool[C, n] (C conditions, n taxels), selected
        taxels in each condition.
        """
        return SessionMeans(np.where(selection[:, None, None], self.value, np.nan), self.count, self.repeat_variance)

    def select_sessions(self, sessions: NDArray[np.bool_]) -> SessionMeans:
        """Return the means of the selected sessions, bool[S]."""
        return SessionMeans(self.value[:, sessions], self.count[:, sessions], self.repeat_variance)


def compute_mean_product(total: FloatArray, squares: FloatArray, count: NDArray[np.intp]) -> FloatArray:
    """Return the mean product of the values of two different sessions; 0 where fewer than two sessions have a value.

    The sum over all ordered pairs of different sessions is the squared total minus the sum of squares.

    total: sums over the sessions with a value. squares: sums of squares over the same sessions. count: number of these
    sessions. All have the same shape.
    """
    return np.where(count > 1, (total**2 - squares) / np.maximum(count * (count - 1), 1), 0.0)


def compute_features(
    pair: Pair, recording: Recording, layout: FeatureLayout, is_unloaded: NDArray[np.bool_]
) -> NDArray[np.float32]:
    """Return the features of each of the R grasps of a recording, f32[R, F, n] (F features, n taxels), counts.

    is_unloaded: bool[C, n] (C conditions), taxels without contact. The drift residual of a grasp is the signed mean
    signal after release of an unloaded taxel, and 0 for all other taxels.
    """
    time_grid, sensor = pair.time_grid, pair.groups.sensor
    values = np.zeros((len(recording), layout.count, pair.n), np.float32)
    values[:, : layout.bins] = compute_bin_means(time_grid, recording.node_signal_counts)
    hold = time_grid.find_bins(Phase.HOLD)[0]
    values[:, hold] = recording.hold_signal_counts
    values[:, layout.noise] = recording.noise
    values[:, layout.missing] = COUNTS_MISSING * recording.missing_share[:, sensor]
    values[:, layout.onset] = COUNTS_PER_SECOND * recording.onset_s[:, sensor]
    last = time_grid.bins[-1][0]
    after = (
        compute_known_mean(values[:, time_grid.find_bins(last)].astype(np.float64), 1)
        if last != Phase.HOLD
        else values[:, hold]
    )
    values[:, layout.drift_residual] = np.where(is_unloaded[recording.condition], after, 0.0)
    return values


def compute_known_mean(values: FloatArray, axis: int) -> FloatArray:
    """Return the mean of the finite values along an axis; NaN where no value is finite."""
    known = np.isfinite(values)
    count = known.sum(axis=axis)
    return np.asarray(np.where(known, values, 0.0).sum(axis=axis) / np.where(count, count, np.nan))


def compute_bin_means(time_grid: TimeGrid, nodes: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the mean of the known nodes of each bin, f32[R, B, n] (R grasps, B time bins, n taxels); NaN for a bin
    without known nodes.

    nodes: f32[R, K, n] (K time nodes), values at the time nodes, NaN where unknown.
    """
    result = np.empty((nodes.shape[0], len(time_grid.bins), nodes.shape[2]), np.float32)
    known = np.isfinite(nodes)
    for row, (_, bin_nodes) in enumerate(time_grid.bins):
        count = known[:, bin_nodes].sum(axis=1)
        total = np.where(known[:, bin_nodes], nodes[:, bin_nodes], 0.0).sum(axis=1)
        result[:, row] = total / np.where(count, count, np.nan)
    return result


def compute_session_means(
    features: NDArray[np.float32],
    recording: Recording,
    conditions: int,
    sessions: NDArray[np.int64],
    layout: FeatureLayout,
) -> SessionMeans:
    """Return the means over the repeats of each condition and session.

    features: f32[R, F, n] (R grasps, F features, n taxels), of `compute_features`. conditions: number C of conditions.
    sessions: i64[S], numbers of the sessions. The drift residual is the root mean square over the repeats, all other
    features are means. The variance between repeats of a condition (`SessionMeans.repeat_variance`) is pooled over its
    sessions.
    """
    shape = (conditions, len(sessions), layout.count, features.shape[2])
    value, count = np.full(shape, np.nan), np.zeros(shape[:2], np.int64)
    spread = np.full((conditions, *shape[2:]), np.nan)
    for condition in range(conditions):
        squares, degrees_of_freedom = np.zeros(shape[2:]), 0
        for column, session in enumerate(sessions):
            repeats = features[(recording.condition == condition) & (recording.session == session)].astype(np.float64)
            count[condition, column] = len(repeats)
            if not len(repeats):
                continue
            known = np.isfinite(repeats)
            number = known.sum(axis=0)
            mean = np.where(known, repeats, 0.0).sum(axis=0) / np.where(number, number, np.nan)
            squares += np.nan_to_num(np.where(known, (repeats - mean) ** 2, 0.0).sum(axis=0))
            degrees_of_freedom += len(repeats) - 1
            mean[layout.drift_residual] = np.sqrt(compute_known_mean(repeats[:, layout.drift_residual] ** 2, 0))
            value[condition, column] = mean
        if degrees_of_freedom > 0:
            spread[condition] = squares / degrees_of_freedom
    return SessionMeans(value, count, spread)


def find_unloaded_taxels(pair: Pair) -> NDArray[np.bool_]:
    """Return which taxels are unloaded in which condition, bool[C, n] (C conditions, n taxels).

    The simulated signal of an unloaded taxel stays below `UNLOADED_COUNTS` plus 4 standard deviations of the
    simulator's noise, in all nodes of all grasps of the condition.
    """
    largest = np.max(
        np.abs(pair.sim.node_signal_counts), axis=1, where=np.isfinite(pair.sim.node_signal_counts), initial=0.0
    )
    result = np.ones((len(pair.conditions), pair.n), bool)
    for condition in range(len(pair.conditions)):
        result[condition] = (
            largest[pair.sim.condition == condition] < UNLOADED_COUNTS + 4 * _estimate_noise(pair)
        ).all(axis=0)
    return result


def _estimate_noise(pair: Pair) -> float:
    """Return the standard deviation of the simulator's noise, counts: median over grasps, taxels, baseline and hold."""
    return float(np.nanmedian(pair.sim.noise))
