"""Input data of fits and comparisons: simulated state, real sessions, weights, and folds for held-out prediction."""

from __future__ import annotations

from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.pair import Pair
from taxel.gap.features.features import FeatureLayout, SessionMeans
from taxel.gap.features.metric import compute_terms, sum_terms
from taxel.gap.fitting.composite import CompositeModel
from taxel.gap.fitting.equations import FitProblem
from taxel.gap.fitting.fit import MAX_ITERATIONS, NO_COLUMNS, ColumnsByEffect, Fit, fit
from taxel.gap.fitting.state import State
from taxel.types import FloatArray

MAX_FOLDS: Final = 16
"""Largest number of folds (chosen); each fold is predicted by a fit to all other folds. More folds take more
time."""

SIGNAL_TOLERANCE_SHARE: Final = 0.04
"""Relative error of the signal of a good simulator: the smallest difference of two solvers of the same contact."""

NOISE_TOLERANCE_SHARE: Final = 0.05
"""Relative error of the noise of a good simulator (chosen)."""

TOLERANCE_COUNTS: Final = {"signal": 3.0, "noise": 1.0, "missing": 5.0, "onset": 8.0, "drift_residual": 2.0}
"""Absolute error of a good simulator in counts, by family of features (chosen)."""

USUAL_REPEAT_SHARE: Final = 0.5
"""Share of the variance between simulated repeats that applies to their mean in a fit. Chosen between 1 for random
repeats and 0 for repeats that were planned such that their variation cancels. A comparison estimates the share."""

REFIT_ITERATIONS: Final = 3
"""Iterations of a fit that starts near its solution (chosen)."""


class FitData:
    """Prepared pair of datasets on which sets of effects are fitted and compared.

    Attributes:
        state: simulated contacts and features. sessions: real features by session. layout: rows of the features.
        target: f64[C, F, n] (C conditions, F features, n taxels), mean real features, counts; 0 where unknown.
        weight: f64[C, F, n], weights of a fit, 1 / counts^2; 0 where unknown.
        condition_folds: [C], fold of each condition. taxel_folds: [C, n], fold of each taxel in each condition.
        floor2: squared floor, counts^2.
    """

    def __init__(self, state: State, real: SessionMeans, layout: FeatureLayout) -> None:
        """Compute target, weights, folds and floor. state: simulated contacts. real: features of the real sessions."""
        self.state, self.layout, self.sessions = state, layout, real
        self.target = np.nan_to_num(real.mean)
        self.weight = self._compute_weights(real)
        self.condition_folds = _assign_condition_folds(state.pair.conditions)
        self.taxel_folds = _assign_taxel_folds(state.pair, self.condition_folds)
        self.floor2 = sum_terms(compute_terms(real, state.mean, layout).floor2)

    @cached_property
    def targets_without_session(self) -> list[FloatArray]:
        """For each session the mean real features of all other sessions, f64[C, F, n] (C conditions, F features, n
        taxels), counts.

        A feature that no other session has keeps its mean. With one session the list is empty.
        """
        value, is_known = self.sessions.value, self.sessions.is_known
        if value.shape[1] < 2:
            return []
        total, number = np.nan_to_num(value).sum(axis=1), is_known.sum(axis=1)
        targets = []
        for session in range(value.shape[1]):
            others = number - is_known[:, session]
            mean = (total - np.nan_to_num(value[:, session])) / np.maximum(others, 1)
            targets.append(np.where(others > 0, mean, self.target))
        return targets

    def shift_time(self, seconds: float) -> FitData:
        """Return the same data with a simulation that is later by `seconds`."""
        return FitData(self.state.shift_time(seconds), self.sessions, self.layout)

    def keep_first_repeats(self) -> FitData:
        """Return the same data with the first simulated contact of each condition alone."""
        state = self.state.keep_first_repeats()
        return self if state is self.state else FitData(state, self.sessions, self.layout)

    def _compute_weights(self, real: SessionMeans) -> FloatArray:
        """Compute the weights of a fit, f64[C, F, n] (C conditions, F features, n taxels): weight of the feature
        divided by the variance, 1 / counts^2.

        The features of a taxel in a contact vary together. Because the weights of the layout add up to 1, all features
        of a taxel in a condition count as one independent value. Information and standard deviations of parameters
        refer to these weights.
        """
        model, layout = self.state.mean, self.layout
        variance = real.mean_variance + compute_tolerance2(layout, model, self.target)
        if self.state.mean_variance is not None:
            variance = variance + USUAL_REPEAT_SHARE * self.state.mean_variance
        weight = layout.weight[:, None] / variance
        return np.where(real.is_known.any(axis=1), weight, 0.0)

    def build_problem(self, selected: NDArray[np.bool_] | None = None) -> FitProblem:
        """Return the least-squares problem on selected taxels of each condition, bool[C, n] (C conditions, n taxels);
        None: all taxels.
        """
        weight = self.weight if selected is None else np.where(selected[:, None], self.weight, 0.0)
        return FitProblem(self.state, self.target, weight)

    def compute_excess(self, features: FloatArray) -> float:
        """Compute the excess of the real sessions over predicted features f64[C, F, n] (C conditions, F features, n
        taxels), counts^2, as in the report.
        """
        return sum_terms(compute_terms(self.sessions, features, self.layout).excess)

    def fit_in_sample(
        self,
        composite: CompositeModel,
        fixed: tuple[str, ...] = (),
        iterations: int = MAX_ITERATIONS,
        fixed_columns: ColumnsByEffect = NO_COLUMNS,
    ) -> Fit:
        """Fit a composite model to the data of all conditions. fixed, iterations, fixed_columns: see
        `taxel.gap.fitting.fit.fit`.
        """
        return fit(self.build_problem(), composite, fixed, iterations, fixed_columns=fixed_columns)


def compute_tolerance2(layout: FeatureLayout, model: FloatArray, expected: FloatArray) -> FloatArray:
    """Compute the squared tolerance of a good simulator, counts^2, f64[C, F, n] (C conditions, F features, n taxels).

    model: features of the simulator, f64[C, F, n]. expected: features that the simulator should have, f64[C, F, n].
    Source: section "Fit" of docs/gap-diagnosis.md.
    """
    error = np.full(model.shape, TOLERANCE_COUNTS["signal"])
    signal_counts = np.maximum(np.abs(model), np.abs(expected))[:, : layout.bins]
    error[:, : layout.bins] = np.hypot(TOLERANCE_COUNTS["signal"], SIGNAL_TOLERANCE_SHARE * signal_counts)
    error[:, layout.noise] = np.hypot(TOLERANCE_COUNTS["noise"], NOISE_TOLERANCE_SHARE * model[:, layout.noise])
    for name in ("missing", "onset", "drift_residual"):
        error[:, getattr(layout, name)] = TOLERANCE_COUNTS[name]
    return np.asarray(error**2)


def _assign_condition_folds(conditions: tuple[tuple[str, str], ...]) -> NDArray[np.intp]:
    """Return the fold of each condition, [C] (C conditions); the approaches of an object belong to different folds if
    possible.

    conditions: object and approach of each condition.
    """
    count = min(MAX_FOLDS, len(conditions))
    fold = np.zeros(len(conditions), np.intp)
    for position, condition in enumerate(sorted(range(len(conditions)), key=lambda index: conditions[index])):
        fold[condition] = position % count
    return fold


def _assign_taxel_folds(pair: Pair, condition_folds: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the fold of each taxel in each condition, [C, n] (C conditions, n taxels).

    The taxels of a condition are divided into two halves, like the black and the white squares of a chessboard. The
    halves belong to different folds. A fit without one fold therefore estimates the contact in a condition from the
    neighbours of a taxel, and the properties of the taxel from other conditions. condition_folds: [C], fold of each
    condition.
    """
    count = max(int(condition_folds.max()) + 1, 2)
    parity = (pair.taxels.tx.astype(np.intp) + pair.taxels.rx) % 2
    return np.asarray((condition_folds[:, None] + parity * (count // 2)) % count)
