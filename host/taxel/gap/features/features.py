"""What is compared: features of every grasp and taxel, all in counts, with weights fixed by the method."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.clock import Clock
from taxel.gap.data.pair import Pair
from taxel.gap.data.reading import Recording
from taxel.recording.grasp_format import Phase
from taxel.types import FloatArray

COUNTS_PER_SECOND: Final = 300.0
"""An onset a tenth of a second late is as wrong as 30 counts on every taxel of the board."""

COUNTS_MISSING: Final = 1000.0
"""A board that is never heard is as wrong as one whose pressed taxels are 1000 counts off."""

UNTOUCHED_COUNTS: Final = 20.0
"""A taxel that the simulator never lets drop by more is untouched in that cell."""

WEIGHTS: Final = {"hold": 0.35, "closing": 0.2, "release": 0.1, "recovery": 0.1, "noise": 0.1, "missing": 0.05}
"""Share of each family in the squared gap. With onset 0.05 and wander 0.05 they add to 1."""

POOLED_SHARE: Final = 0.5
"""Share of the mean over cells in the variance of a feature."""

ONSET_WEIGHT: Final = 0.05
DRIFT_RESIDUAL_WEIGHT: Final = 0.05

_PHASE_NAMES: Final = {
    Phase.CLOSING: "closing",
    Phase.HOLD: "hold",
    Phase.RELEASE: "release",
    Phase.RECOVERY: "recovery",
}


@dataclass(frozen=True, eq=False)
class Layout:
    """The F features: B bins of drop, noise in baseline and in hold, missing frames, onset, wander.

    phase: u8[F], the phase whose disagreement a feature tells. weight: f64[F], they add to 1. bins: B.
    """

    phase: NDArray[np.uint8]
    weight: FloatArray
    bins: int

    @property
    def noise(self) -> slice:
        """The two noise features."""
        return slice(self.bins, self.bins + 2)

    @property
    def missing(self) -> int:
        """Share of missing frames, times `COUNTS_MISSING`."""
        return self.bins + 2

    @property
    def onset(self) -> int:
        """Onset of the taxel's board, times `COUNTS_PER_SECOND`."""
        return self.bins + 3

    @property
    def drift_residual(self) -> int:
        """RMS of an untouched taxel's drop after release."""
        return self.bins + 4

    @property
    def count(self) -> int:
        """F."""
        return self.bins + 5

    @property
    def families(self) -> tuple[slice, ...]:
        """Drops, noise, missing frames, onset, wander: what different effects disturb."""
        single = (self.missing, self.onset, self.drift_residual)
        return (slice(0, self.bins), self.noise, *(slice(one, one + 1) for one in single))

    def scale(self, conditions: int, taxels: int) -> FloatArray:
        """What a squared difference in a cell, feature and taxel adds to the squared gap, f64[F, 1]."""
        return self.weight[:, None] / (conditions * taxels)

    @classmethod
    def of(cls, clock: Clock) -> Layout:
        """For a pair's clock. What a missing phase would weigh goes to the others."""
        phases = [int(phase) for phase, _ in clock.bins]
        weights = [WEIGHTS[_PHASE_NAMES[phase]] / len(clock.bins_of(phase)) for phase, _ in clock.bins]
        phases += [Phase.BASELINE, Phase.HOLD, Phase.HOLD, Phase.CLOSING, phases[-1]]
        weights += [WEIGHTS["noise"] / 2, WEIGHTS["noise"] / 2, WEIGHTS["missing"], ONSET_WEIGHT, DRIFT_RESIDUAL_WEIGHT]
        weight = np.array(weights)
        return cls(np.array(phases, np.uint8), weight / weight.sum(), len(clock.bins))


@dataclass(frozen=True, eq=False)
class SessionMeans:
    """Means over the repeats of a cell in a session: C cells, S sessions, F features, n taxels.

    value: f64[C, S, F, n], counts; NaN where unknown, and where a session lacks the cell. count: i64[C, S], repeats.
    spread: f64[C, F, n], variance of one grasp about its session's mean, pooled; NaN for cells without repeats.
    """

    value: FloatArray
    count: NDArray[np.int64]
    spread: FloatArray

    @cached_property
    def known(self) -> NDArray[np.bool_]:
        """bool[C, S, F, n]."""
        return np.isfinite(self.value)

    @cached_property
    def mean(self) -> FloatArray:
        """Over sessions, f64[C, F, n]; NaN where nothing is known."""
        return known_mean(self.value, 1)

    @cached_property
    def variance(self) -> FloatArray:
        """Of one session, f64[C, F, n]; of a cell made once that of its repeats, or else that of other cells."""
        count = self.known.sum(axis=1)
        squares = np.where(self.known, (self.value - self.mean[:, None]) ** 2, 0.0).sum(axis=1)
        between = squares / np.where(count > 1, count - 1, np.nan)
        within = self.spread / np.maximum(self.count.sum(axis=1), 1)[:, None, None]
        result = np.where(np.isfinite(between), between, within)
        return np.where(np.isfinite(result), result, known_mean(result, 0))

    @cached_property
    def mean_variance(self) -> FloatArray:
        """Variance of `mean`, counts^2, f64[C, F, n], half of it the mean over the cells; 0 where it is not known.

        Few repeats estimate a variance poorly, and shrinkage towards the mean is the usual remedy (Smyth 2004).
        """
        own = np.nan_to_num(self.variance) / np.maximum(self.known.sum(axis=1), 1)
        return np.asarray((1.0 - POOLED_SHARE) * own + POOLED_SHARE * own.mean(axis=0))

    def residual(self, features: FloatArray) -> FloatArray:
        """Less features f64[C, F, n], f64[C, S, F, n]; 0 where unknown."""
        return np.where(self.known, self.value - features[:, None], 0.0)

    @cached_property
    def pairing(self) -> FloatArray:
        """All pairs of sessions over those of which both know it, f64[C, F, n]: products of sessions, weighted so, add
        up as if every session knew everything. 0 where fewer than two do; 1 with one session.
        """
        sessions, count = self.known.shape[1], self.known.sum(axis=1)
        if sessions < 2:
            return np.ones(count.shape)
        return np.where(count > 1, sessions * (sessions - 1) / np.maximum(count * (count - 1), 1), 0.0)

    def square(self, session: int, features: FloatArray, scale: FloatArray) -> float:
        """Sum of a session's squared differences from features f64[C, F, n], times scale; of one that does not know
        everything, as if the rest were like what it knows.
        """
        known, residual = self.known[:, session], self.residual(features)[:, session]
        there, told = (float(np.sum(np.where(one, scale, 0.0))) for one in (self.known.any(axis=1), known))
        return float(np.sum(scale * residual**2)) * (there / told if told > 0 else 0.0)

    def known_beside(self, other: SessionMeans) -> SessionMeans:
        """What some session of another recording knows as well: a board that only one side touches has no onset there
        that could be compared.
        """
        there = np.any(other.known, axis=1, keepdims=True)
        return SessionMeans(np.where(there, self.value, np.nan), self.count, self.spread)

    def with_reference_variance(self, other: SessionMeans) -> SessionMeans:
        """Add the variance between the sessions of a reference, whose mean takes the place of a simulation.

        Each session gets the deviation of a session of the reference from the reference's mean, scaled so that the
        variance of the mean of this recording increases by that of the mean of the reference. The means do not change.
        The same with a reference of one session, whose variance is not known.
        """
        count, own = other.value.shape[1], self.value.shape[1]
        if count < 2 or own < 2:
            return self
        deviation = (other.value - other.mean[:, None])[:, np.arange(own) % count]
        deviation = np.nan_to_num(deviation - known_mean(deviation, 1)[:, None])
        sampled = (deviation**2).sum(axis=1) / (own - 1)
        wanted = np.nan_to_num(other.variance) * own / count
        factor = np.sqrt(np.divide(wanted, sampled, out=np.zeros_like(sampled), where=sampled > 0.0))
        return SessionMeans(self.value - factor[:, None] * deviation, self.count, self.spread)

    def where(self, part: NDArray[np.bool_]) -> SessionMeans:
        """Only some taxels of some cells, bool[C, n]; the others are unknown."""
        return SessionMeans(np.where(part[:, None, None], self.value, np.nan), self.count, self.spread)

    def only(self, sessions: NDArray[np.bool_]) -> SessionMeans:
        """Some of the sessions, bool[S]."""
        return SessionMeans(self.value[:, sessions], self.count[:, sessions], self.spread)


def mean_product(total: FloatArray, squares: FloatArray, count: NDArray[np.intp]) -> FloatArray:
    """Of two different sessions, from sums over the sessions that know something and over their squares; 0 where fewer
    than two do.
    """
    return np.where(count > 1, (total**2 - squares) / np.maximum(count * (count - 1), 1), 0.0)


def features_of(pair: Pair, recording: Recording, layout: Layout, untouched: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Features of each grasp, f32[R, F, n]; the wander's column is the signed drop after release of untouched taxels.

    untouched: bool[C, n].
    """
    clock, sensor = pair.clock, pair.groups.sensor
    values = np.zeros((len(recording), layout.count, pair.n), np.float32)
    values[:, : layout.bins] = bin_means(clock, recording.nodes)
    hold = clock.bins_of(Phase.HOLD)[0]
    values[:, hold] = recording.hold
    values[:, layout.noise] = recording.noise
    values[:, layout.missing] = COUNTS_MISSING * recording.missing[:, sensor]
    values[:, layout.onset] = COUNTS_PER_SECOND * recording.onset[:, sensor]
    last = clock.bins[-1][0]
    after = known_mean(values[:, clock.bins_of(last)].astype(np.float64), 1) if last != Phase.HOLD else values[:, hold]
    values[:, layout.drift_residual] = np.where(untouched[recording.condition], after, 0.0)
    return values


def known_mean(values: FloatArray, axis: int) -> FloatArray:
    """Mean over what is known; NaN where nothing is."""
    known = np.isfinite(values)
    count = known.sum(axis=axis)
    return np.asarray(np.where(known, values, 0.0).sum(axis=axis) / np.where(count, count, np.nan))


def bin_means(clock: Clock, nodes: NDArray[np.float32]) -> NDArray[np.float32]:
    """Means over the nodes of each bin, f32[R, B, n], of the nodes that are known."""
    result = np.empty((nodes.shape[0], len(clock.bins), nodes.shape[2]), np.float32)
    known = np.isfinite(nodes)
    for row, (_, own) in enumerate(clock.bins):
        count = known[:, own].sum(axis=1)
        total = np.where(known[:, own], nodes[:, own], 0.0).sum(axis=1)
        result[:, row] = total / np.where(count, count, np.nan)
    return result


def session_means(
    features: NDArray[np.float32], recording: Recording, conditions: int, sessions: NDArray[np.int64], layout: Layout
) -> SessionMeans:
    """Means over repeats. The wander becomes the RMS of the drop after release over the repeats."""
    shape = (conditions, len(sessions), layout.count, features.shape[2])
    value, count = np.full(shape, np.nan), np.zeros(shape[:2], np.int64)
    spread = np.full((conditions, *shape[2:]), np.nan)
    for condition in range(conditions):
        squares, degrees_of_freedom = np.zeros(shape[2:]), 0
        for column, session in enumerate(sessions):
            own = features[(recording.condition == condition) & (recording.session == session)].astype(np.float64)
            count[condition, column] = len(own)
            if not len(own):
                continue
            known = np.isfinite(own)
            number = known.sum(axis=0)
            mean = np.where(known, own, 0.0).sum(axis=0) / np.where(number, number, np.nan)
            squares += np.nan_to_num(np.where(known, (own - mean) ** 2, 0.0).sum(axis=0))
            degrees_of_freedom += len(own) - 1
            mean[layout.drift_residual] = np.sqrt(known_mean(own[:, layout.drift_residual] ** 2, 0))
            value[condition, column] = mean
        if degrees_of_freedom > 0:
            spread[condition] = squares / degrees_of_freedom
    return SessionMeans(value, count, spread)


def untouched_conditions(pair: Pair) -> NDArray[np.bool_]:
    """bool[C, n]: the simulator never lets the taxel drop in that cell."""
    largest = np.max(np.abs(pair.sim.nodes), axis=1, where=np.isfinite(pair.sim.nodes), initial=0.0)
    result = np.ones((len(pair.conditions), pair.n), bool)
    for condition in range(len(pair.conditions)):
        result[condition] = (largest[pair.sim.condition == condition] < UNTOUCHED_COUNTS + 4 * _node_noise(pair)).all(
            axis=0
        )
    return result


def _node_noise(pair: Pair) -> float:
    """Standard deviation of a node's mean of the simulator's noise, counts, about."""
    return float(np.nanmedian(pair.sim.noise))
