"""Simulated contacts on which effects act: force, separation and signal at time nodes, and the predicted features."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.pair import Pair
from taxel.gap.data.time_grid import TimeGrid
from taxel.gap.features.features import COUNTS_PER_SECOND, FeatureLayout, find_unloaded_taxels
from taxel.recording.grasp_format import Phase
from taxel.recording.grasp_sensor_model import SensorModel
from taxel.types import FloatArray

MAX_VALUES: Final = 800_000
"""Largest number of values in one array [Q, K, n]. Chosen: up to `MAX_REPEATS` contacts of each condition for a small
hand, one or two for a large hand. A larger value increases run time and memory."""

MAX_REPEATS: Final = 4
"""Largest number of simulated contacts of each condition on which effects act (chosen). More contacts increase the run
time in proportion."""

RESPONSE_COUNTS: Final = 50.0
"""Simulated signal in counts above which a taxel is treated as loaded (chosen). A board without such a taxel has no
onset from which a delay could be fitted."""

RATIO_LIMITS: Final = (0.5, 2.0)
"""Limits of the ratio between the mean signal of all simulated contacts of a condition and the mean signal of the
contacts on which effects act (chosen). Beyond them a taxel is touched in some of the contacts only, and a factor does
not describe the difference."""

FULL_SCALE_FACTOR: Final = 1.25
"""Assumed full scale divided by the largest simulated signal, for datasets without a sensor model (chosen)."""


@dataclass(frozen=True, eq=False)
class Signal:
    """Contact and signal of Q simulated contacts at K time nodes on n taxels.

    force: f64[Q, K, n], newtons; None for a dataset without contact forces. separation: f64[Q, K, n], metres, distance
    between object and taxel; None without contact forces. signal_counts: f64[Q, K, n], baseline minus raw count, in
    counts; None until an effect or `State.to_signal_counts` converts the forces. law_scale: factor on the force at half
    the full scale of the sensor model.
    """

    force: FloatArray | None
    separation: FloatArray | None
    signal_counts: FloatArray | None
    law_scale: FloatArray | float = 1.0

    def map_arrays(self, change: Callable[[FloatArray], FloatArray]) -> Signal:
        """Return a copy in which a function has replaced force, separation and signal; None remains None."""
        force, separation, signal_counts = (
            None if part is None else change(part) for part in (self.force, self.separation, self.signal_counts)
        )
        return Signal(force, separation, signal_counts, self.law_scale)

    def with_force(self, force: FloatArray) -> Signal:
        """Return a copy with other forces f64[Q, K, n] (Q simulated contacts, K time nodes, n taxels), newtons."""
        return replace(self, force=force)

    def with_signal_counts(self, signal_counts: FloatArray) -> Signal:
        """Return a copy with another signal f64[Q, K, n] (Q simulated contacts, K time nodes, n taxels), counts below
        baseline.
        """
        return replace(self, signal_counts=signal_counts)


def delay_values(values: FloatArray, time_s: FloatArray, delay_s: FloatArray) -> FloatArray:
    """Delay time series f64[Q, K, n] (Q simulated contacts, K time nodes, n taxels) by `delay_s` f64[Q, n], with linear
    interpolation between the nodes.

    time_s: f64[K], times of the nodes, seconds. Beyond the first and the last node the value of this node applies.
    """
    result = values.copy()
    # Contacts usually have equal delays; it is faster to interpolate only the taxels with each delay.
    common_delay_s = delay_s[0] if (delay_s == delay_s[0]).all() else None
    for value in np.unique(delay_s[delay_s != 0.0]):
        delayed_time_s = time_s - value
        after = np.clip(np.searchsorted(time_s, delayed_time_s), 0, len(time_s) - 1)
        before = np.maximum(after - 1, 0)
        interval_s = time_s[after] - time_s[before]
        fraction = (delayed_time_s - time_s[before]) / np.where(interval_s > 0, interval_s, 1.0)
        share = np.where(interval_s > 0, fraction, 1.0).clip(0.0, 1.0)[:, None]
        taxels = np.flatnonzero(common_delay_s == value) if common_delay_s is not None else np.arange(values.shape[2])
        part = values[:, :, taxels]
        moved = part[:, before] + share * (part[:, after] - part[:, before])
        if common_delay_s is None:
            moved = np.where((delay_s == value)[:, None, :], moved, result)
        result[:, :, taxels] = moved
    return result


@dataclass(frozen=True, eq=False)
class State:
    """Simulated half of a pair of datasets: the contacts on which effects act, and their mean features.

    Attributes:
        pair: both datasets. layout: rows of the features. time_grid: the K time nodes.
        condition: [Q], index of the condition of each of the Q contacts.
        base: contacts and signal without effects.
        mean: f64[C, F, n] (C conditions, F features, n taxels), mean features of the simulator over all its grasps,
            counts.
        shift_s: delay that was added to the recorded simulation, seconds.
        mean_variance: f64[C, F, n], counts^2, variance of `mean` that follows from the differences between simulated
            repeats; None: unknown.
    """

    pair: Pair
    layout: FeatureLayout
    time_grid: TimeGrid
    condition: NDArray[np.intp]
    base: Signal
    mean: FloatArray
    shift_s: float = 0.0
    mean_variance: FloatArray | None = None

    @cached_property
    def is_unloaded(self) -> NDArray[np.bool_]:
        """Taxels without contact in a condition, bool[C, n] (C conditions, n taxels); the drift residual is evaluated
        only on these taxels.
        """
        return find_unloaded_taxels(self.pair)

    def shift_time(self, seconds: float) -> State:
        """Return a state in which contacts, signal and mean features are later by `seconds`."""
        if seconds == 0.0:
            return self
        delay = np.full((len(self.condition), self.pair.n), seconds)
        moved = self.base.map_arrays(lambda values: delay_values(values, self.node_times_s, delay))
        shift = self.shift_s + seconds
        return replace(self, base=moved, mean=self.predict_features(moved), shift_s=shift)

    def keep_first_repeats(self) -> State:
        """Return a state with the first simulated contact of each condition alone; the state itself if it has no other
        contacts. `mean` and `mean_variance` do not change.
        """
        rows = np.unique(self.condition, return_index=True)[1]
        if len(rows) == len(self.condition):
            return self
        return replace(self, condition=self.condition[rows], base=self.base.map_arrays(lambda values: values[rows]))

    @property
    def sensor_model(self) -> SensorModel:
        """Sensor model of the simulator. Raises ValueError if the dataset has none."""
        if self.pair.sensor_model is None:
            raise ValueError("sensor model: expected one, found none")
        return self.pair.sensor_model

    @property
    def has_force(self) -> bool:
        """True if effects on force are applicable: the simulation has contact forces and a sensor model."""
        return self.base.force is not None and self.pair.sensor_model is not None

    @cached_property
    def full_scale(self) -> FloatArray | float:
        """Largest possible signal of every taxel, counts: one number, f64[] or float.

        With a sensor model, the full scale of this model. Without a sensor model, `FULL_SCALE_FACTOR` times the largest
        absolute mean signal of the simulator over conditions, time bins and taxels. This signal is replaced by 1 count
        if it is smaller, so that the full scale is above 0 and can be a divisor.
        """
        if self.pair.sensor_model is not None:
            return np.asarray(self.sensor_model.full_scale_drop_counts, np.float64)
        return FULL_SCALE_FACTOR * max(float(np.abs(self.mean[:, : self.layout.bins]).max(initial=0.0)), 1.0)

    @cached_property
    def signal_counts(self) -> FloatArray:
        """Signal without effects, counts, f64[Q, K, n] (Q simulated contacts, K time nodes, n taxels)."""
        return self.to_signal_counts(self.base)

    def to_signal_counts(self, signal: Signal) -> FloatArray:
        """Return the signal in counts below baseline, f64[Q, K, n] (Q simulated contacts, K time nodes, n taxels).

        Forces are converted by the force law of the sensor model, S F / (F + h), with the full scale S in counts and
        the force h at half the full scale times `Signal.law_scale`.
        """
        if signal.signal_counts is not None:
            return signal.signal_counts
        assert signal.force is not None
        half = self.sensor_model.half_force_n * signal.law_scale
        return np.asarray(self.sensor_model.full_scale_drop_counts * signal.force / (signal.force + half))

    @cached_property
    def mean_difference(self) -> FloatArray:
        """Difference between the mean signal of all simulated contacts of a condition and the mean signal of the
        contacts on which effects act, at each time node, counts, f64[Q, K, n] (Q simulated contacts, K time nodes, n
        taxels).

        Effects act on few of the simulated contacts of a large hand, whose mean signal differs by tens of percent from
        `mean`. A nonlinear effect must act on the sum of signal and difference. The difference is a share of the
        signal: the ratio of both means, by least squares over the time bins, minus 1. The ratio is limited to
        `RATIO_LIMITS`, and it is 1 for a taxel whose largest signal is below `RESPONSE_COUNTS` in one of the means.
        """
        used, mean = self._base_bins, self.mean[:, : self.layout.bins]
        smaller = np.minimum(np.abs(used).max(axis=1), np.abs(mean).max(axis=1))
        ratio = (used * mean).sum(axis=1) / np.maximum((used**2).sum(axis=1), np.finfo(np.float64).tiny)
        ratio = np.where(smaller < RESPONSE_COUNTS, 1.0, np.clip(ratio, *RATIO_LIMITS))
        return np.asarray((ratio[self.condition, None] - 1.0) * self.signal_counts)

    @cached_property
    def loaded_boards(self) -> NDArray[np.intp]:
        """Indices of the boards on which a taxel has a simulated signal above `RESPONSE_COUNTS`."""
        signal_counts = np.abs(self.mean[:, : self.layout.bins]).max(axis=(0, 1))
        return np.unique(self.pair.groups.sensor[signal_counts > RESPONSE_COUNTS])

    @cached_property
    def node_times_s(self) -> FloatArray:
        """Middle of each time node, seconds since the beginning of closing, f64[K] (K time nodes)."""
        return self.time_grid.time_since_start_s

    @cached_property
    def _condition_means(self) -> FloatArray:
        """Matrix that averages over the contacts of each condition, f64[C, Q] (C conditions, Q simulated contacts)."""
        matrix = np.zeros((len(self.pair.conditions), len(self.condition)))
        matrix[self.condition, np.arange(len(self.condition))] = 1.0
        return np.asarray(matrix / matrix.sum(axis=1, keepdims=True))

    def average_bins(self, signal_counts: FloatArray) -> FloatArray:
        """Average a signal f64[Q, K, n] (Q simulated contacts, K time nodes, n taxels) over the nodes of each bin and
        the contacts of each condition, f64[C, B, n] (C conditions, B time bins).
        """
        contacts, nodes, taxels = signal_counts.shape
        average, bins = self._condition_means, self.time_grid.bin_averages
        conditions = (average @ signal_counts.reshape(contacts, nodes * taxels)).reshape(-1, nodes, taxels)
        return np.asarray(np.matmul(bins, conditions))

    @cached_property
    def _base_bins(self) -> FloatArray:
        """Mean signal without effects in the B time bins, counts, f64[C, B, n] (C conditions, n taxels)."""
        return self.average_bins(self.signal_counts)

    @cached_property
    def _base_onsets(self) -> FloatArray:
        """Mean onset without effects of each of s boards in each condition, counts, f64[C, s] (C conditions)."""
        return self._compute_onsets(self.signal_counts)

    def predict_features(self, signal: Signal) -> FloatArray:
        """Predict the mean features for a changed signal, f64[C, F, n] (C conditions, F features, n taxels).

        The result is `mean` plus the difference between the features of `signal` and those of `base`; only the signal
        bins and the onsets change. For `base` itself the result is the object `mean`.
        """
        if signal is self.base:
            return self.mean
        signal_counts = self.to_signal_counts(signal)
        result = self.mean.copy()
        result[:, : self.layout.bins] += self.average_bins(signal_counts) - self._base_bins
        shift = self._compute_onsets(signal_counts) - self._base_onsets
        result[:, self.layout.onset] += shift[:, self.pair.groups.sensor]
        return result

    def _compute_onsets(self, signal_counts: FloatArray) -> FloatArray:
        """Compute the mean onset of each of s boards in each condition, f64[C, s] (C conditions), in counts
        (`COUNTS_PER_SECOND`).

        The onset is the time at which the sum of the positive signals of a board reaches half its mean in hold, with
        linear interpolation between nodes. It is 0 for a board without signal in hold, and for a board that exceeds
        this level from the first node.
        """
        phase = self.time_grid.phase
        rise = np.flatnonzero((phase == Phase.CLOSING) | (phase == Phase.HOLD))
        positive = np.maximum(signal_counts[:, rise], 0.0)
        board = positive @ self._board_matrix
        hold = board[:, phase[rise] == Phase.HOLD].mean(axis=1)
        above = board >= 0.5 * hold[:, None]
        first = above.argmax(axis=1)
        before = np.maximum(first - 1, 0)
        q, s = np.indices(hold.shape)
        low, high = board[q, before, s], board[q, first, s]
        with np.errstate(invalid="ignore", divide="ignore"):
            share = np.clip((0.5 * hold - low) / (high - low), 0.0, 1.0)
        share = np.where(np.isnan(share), 0.0, share)
        start, end = self.node_times_s[rise[before]], self.node_times_s[rise[first]]
        time = start + share * (end - start)
        time = np.where((hold > 0) & (first > 0), time, 0.0)
        return COUNTS_PER_SECOND * np.asarray(self._condition_means @ time)

    @cached_property
    def _board_matrix(self) -> FloatArray:
        """Matrix that sums the n taxels of each of s boards, f64[n, s]: 1 for a taxel of the board, otherwise 0."""
        sensor = self.pair.groups.sensor
        return np.asarray(sensor[:, None] == np.arange(len(self.pair.sensors.address))).astype(np.float64)


def build_state(pair: Pair, layout: FeatureLayout, mean: FloatArray, mean_variance: FloatArray | None = None) -> State:
    """Build the state of a pair from its simulated contacts, at most `MAX_REPEATS` of each condition.

    mean, mean_variance: f64[C, F, n] (C conditions, F features, n taxels), see `State`. The contacts have forces if the
    dataset has forces, separations and a sensor model, otherwise only a signal.
    """
    size = len(pair.conditions) * pair.time_grid.node_count * pair.n
    repeats = max(1, min(MAX_REPEATS, int(MAX_VALUES // size)))
    chosen: list[int] = []
    for condition in range(len(pair.conditions)):
        contacts = np.flatnonzero(pair.sim.condition == condition)
        order = contacts[np.argsort(pair.sim.iteration[contacts], kind="stable")]
        chosen += order[:repeats].tolist()
    rows = np.array(chosen, dtype=np.intp)
    sim = pair.sim
    if sim.force is not None and sim.separation is not None and pair.sensor_model is not None:
        base = Signal(_fill_missing_nodes(sim.force[rows]), _fill_missing_nodes(sim.separation[rows]), None)
    else:
        base = Signal(None, None, _fill_missing_nodes(sim.node_signal_counts[rows]))
    return State(pair, layout, pair.time_grid, sim.condition[rows], base, mean, mean_variance=mean_variance)


def _fill_missing_nodes(values: NDArray[np.float32]) -> FloatArray:
    """Replace NaN (a node without a frame) by the value of the previous node, and by 0 in the first node.

    values: f32[contacts, nodes, n] (n taxels). Returns f64 of the same shape.
    """
    result = values.astype(np.float64)
    for node in range(1, result.shape[1]):
        is_missing = np.isnan(result[:, node])
        result[:, node] = np.where(is_missing, result[:, node - 1], result[:, node])
    return np.nan_to_num(result)
