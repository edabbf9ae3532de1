"""What an effect acts on: the simulator's contact at nodes of time, a few repeats of each cell."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.clock import Clock
from taxel.gap.data.pair import Pair
from taxel.gap.features.features import COUNTS_PER_SECOND, Layout, untouched_conditions
from taxel.recording.grasp_format import Phase
from taxel.recording.grasp_sensor_model import SensorModel
from taxel.types import FloatArray

MOST_VALUES: Final = 800_000
"""Numbers in one array: a few repeats of each cell of a small hand, one or two of a large one."""

MOST_REPEATS: Final = 4

TOUCHED_COUNTS: Final = 50.0

ABOVE: Final = 1.25
"""Full scale over the largest drop, where no sensor model tells it."""


@dataclass(frozen=True, eq=False)
class Signal:
    """What is known of Q presses at K nodes on n taxels.

    force: f64[Q, K, n], newtons; None where the simulator tells none. separation: f64[Q, K, n], metres. drop:
    f64[Q, K, n], counts; None until force has become counts. law_scale: factor on the sensor model's half force.
    """

    force: FloatArray | None
    separation: FloatArray | None
    signal_counts: FloatArray | None
    law_scale: FloatArray | float = 1.0

    def mapped(self, change: Callable[[FloatArray], FloatArray]) -> Signal:
        """The same with every array changed."""
        force, separation, signal_counts = (
            None if part is None else change(part) for part in (self.force, self.separation, self.signal_counts)
        )
        return Signal(force, separation, signal_counts, self.law_scale)

    def with_force(self, force: FloatArray) -> Signal:
        """The same with other forces."""
        return replace(self, force=force)

    def with_signal_counts(self, signal_counts: FloatArray) -> Signal:
        """The same with other drops."""
        return replace(self, signal_counts=signal_counts)


def delayed(values: FloatArray, time_s: FloatArray, delay_s: FloatArray) -> FloatArray:
    """Values f64[Q, K, n] of `delay_s` f64[Q, n] ago, linear between nodes; before the first node it was as there."""
    result = values.copy()
    own = delay_s[0] if (delay_s == delay_s[0]).all() else None  # as a rule every press has the same delays
    for value in np.unique(delay_s[delay_s != 0.0]):
        at = time_s - value
        right = np.clip(np.searchsorted(time_s, at), 0, len(time_s) - 1)
        left = np.maximum(right - 1, 0)
        gap = time_s[right] - time_s[left]
        share = np.where(gap > 0, (at - time_s[left]) / np.where(gap > 0, gap, 1.0), 1.0).clip(0.0, 1.0)[:, None]
        taxels = np.flatnonzero(own == value) if own is not None else np.arange(values.shape[2])
        part = values[:, :, taxels]
        moved = part[:, left] + share * (part[:, right] - part[:, left])
        result[:, :, taxels] = moved if own is not None else np.where((delay_s == value)[:, None, :], moved, result)
    return result


@dataclass(frozen=True, eq=False)
class State:
    """The simulator's side of a pair, as effects see it.

    pair, layout: what is compared. clock: the nodes. cell: [Q], the cell of each press. base: the signal without
    effects. mean: f64[C, F, n], the simulator's features. shift_s: seconds by which all of it is later than the file.
    mean_variance: f64[C, F, n], counts^2, variance of `mean` by the variation of simulated repeats; None: not known.
    """

    pair: Pair
    layout: Layout
    clock: Clock
    condition: NDArray[np.intp]
    base: Signal
    mean: FloatArray
    shift_s: float = 0.0
    mean_variance: FloatArray | None = None

    @cached_property
    def untouched(self) -> NDArray[np.bool_]:
        """bool[C, n], see `untouched_cells`: there the wander tells what is left after release."""
        return untouched_conditions(self.pair)

    def shifted(self, seconds: float) -> State:
        """The same with everything that the simulator did so much later."""
        if seconds == 0.0:
            return self
        delay = np.full((len(self.condition), self.pair.n), seconds)
        moved = self.base.mapped(lambda values: delayed(values, self.since, delay))
        shift = self.shift_s + seconds
        return replace(self, base=moved, mean=self.predicted(moved), shift_s=shift)

    @property
    def model(self) -> SensorModel:
        """Of the simulator; raises ValueError without one."""
        if self.pair.sensor_model is None:
            raise ValueError("sensor model: expected one, found none")
        return self.pair.sensor_model

    @property
    def has_force(self) -> bool:
        """Whether effects on force can be tried."""
        return self.base.force is not None and self.pair.sensor_model is not None

    @cached_property
    def full_scale(self) -> FloatArray | float:
        """Counts that no drop exceeds: by the sensor model, or so much above the largest."""
        if self.pair.sensor_model is not None:
            return np.asarray(self.model.full_scale_drop_counts, np.float64)
        return ABOVE * max(float(np.abs(self.mean[:, : self.layout.bins]).max(initial=0.0)), 1.0)

    @cached_property
    def signal_counts(self) -> FloatArray:
        """Drops without effects, f64[Q, K, n]."""
        return self.to_signal_counts(self.base)

    def to_signal_counts(self, signal: Signal) -> FloatArray:
        """Counts of a signal, f64[Q, K, n]."""
        if signal.signal_counts is not None:
            return signal.signal_counts
        assert signal.force is not None
        half = self.model.half_force_n * signal.law_scale
        return np.asarray(self.model.full_scale_drop_counts * signal.force / (signal.force + half))

    @cached_property
    def touched_boards(self) -> NDArray[np.intp]:
        """Columns of the boards that tell a time: some taxel is expected to drop."""
        signal_counts = np.abs(self.mean[:, : self.layout.bins]).max(axis=(0, 1))
        return np.unique(self.pair.groups.sensor[signal_counts > TOUCHED_COUNTS])

    @cached_property
    def since(self) -> FloatArray:
        """Middle of each node, seconds after closing began, f64[K]."""
        return self.clock.since_start

    @cached_property
    def _average(self) -> FloatArray:
        """Mean over the presses of each cell, f64[C, Q]."""
        matrix = np.zeros((len(self.pair.conditions), len(self.condition)))
        matrix[self.condition, np.arange(len(self.condition))] = 1.0
        return np.asarray(matrix / matrix.sum(axis=1, keepdims=True))

    def binned(self, signal_counts: FloatArray) -> FloatArray:
        """Cell means of the bins' drops, f64[C, B, n]."""
        contacts, nodes, taxels = signal_counts.shape
        average, bins = self._average, self.clock.to_bins
        conditions = (average @ signal_counts.reshape(contacts, nodes * taxels)).reshape(-1, nodes, taxels)
        return np.asarray(np.matmul(bins, conditions))

    @cached_property
    def _base_bins(self) -> FloatArray:
        return self.binned(self.signal_counts)

    @cached_property
    def _base_onsets(self) -> FloatArray:
        return self._onsets(self.signal_counts)

    def predicted(self, signal: Signal) -> FloatArray:
        """The simulator's features with what a signal adds to the base, f64[C, F, n]; exactly `mean` for the base."""
        if signal is self.base:
            return self.mean
        signal_counts = self.to_signal_counts(signal)
        result = self.mean.copy()
        result[:, : self.layout.bins] += self.binned(signal_counts) - self._base_bins
        shift = self._onsets(signal_counts) - self._base_onsets
        result[:, self.layout.onset] += shift[:, self.pair.groups.sensor]
        return result

    def _onsets(self, signal_counts: FloatArray) -> FloatArray:
        """When each board's summed drop passes half its hold level, in the feature's counts, f64[C, s]."""
        clock = self.clock
        contacts, nodes, taxels = signal_counts.shape
        board = (np.maximum(signal_counts, 0.0).reshape(-1, taxels) @ self._boards).reshape(contacts, nodes, -1)
        hold = board[:, clock.phase == Phase.HOLD].mean(axis=1)
        rise = np.flatnonzero((clock.phase == Phase.CLOSING) | (clock.phase == Phase.HOLD))
        above = board[:, rise] >= 0.5 * hold[:, None]
        first = above.argmax(axis=1)
        before = np.maximum(first - 1, 0)
        q, s = np.indices(hold.shape)
        low, high = board[q, rise[before], s], board[q, rise[first], s]
        with np.errstate(invalid="ignore", divide="ignore"):
            share = np.clip((0.5 * hold - low) / (high - low), 0.0, 1.0)
        share = np.where(np.isnan(share), 0.0, share)
        time = self.since[rise[before]] + share * (self.since[rise[first]] - self.since[rise[before]])
        time = np.where((hold > 0) & (first > 0), time, 0.0)
        return COUNTS_PER_SECOND * np.asarray(self._average @ time)

    @cached_property
    def _boards(self) -> FloatArray:
        sensor = self.pair.groups.sensor
        return np.asarray(sensor[:, None] == np.arange(len(self.pair.sensors.address))).astype(np.float64)


def state_of(pair: Pair, layout: Layout, mean: FloatArray, mean_variance: FloatArray | None = None) -> State:
    """Choose the presses of each cell that effects are worked out on. mean, mean_variance: f64[C, F, n]."""
    size = len(pair.conditions) * pair.clock.nodes * pair.n
    repeats = max(1, min(MOST_REPEATS, int(MOST_VALUES // size)))
    chosen: list[int] = []
    for condition in range(len(pair.conditions)):
        own = np.flatnonzero(pair.sim.condition == condition)
        order = own[np.argsort(pair.sim.iteration[own], kind="stable")]
        chosen += order[:repeats].tolist()
    rows = np.array(chosen, dtype=np.intp)
    sim = pair.sim
    if sim.force is not None and sim.separation is not None and pair.sensor_model is not None:
        base = Signal(_filled(sim.force[rows]), _filled(sim.separation[rows]), None)
    else:
        base = Signal(None, None, _filled(sim.nodes[rows]))
    return State(pair, layout, pair.clock, sim.condition[rows], base, mean, mean_variance=mean_variance)


def _filled(values: NDArray[np.float32]) -> FloatArray:
    """Nodes without a frame take the node before, f64."""
    result = values.astype(np.float64)
    for node in range(1, result.shape[1]):
        gone = np.isnan(result[:, node])
        result[:, node] = np.where(gone, result[:, node - 1], result[:, node])
    return np.nan_to_num(result)
