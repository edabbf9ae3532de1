"""What a fit and a comparison need of a pair: the simulator's state, the real sessions, weights, and held-out parts."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.pair import Pair
from taxel.gap.features.features import Layout, SessionMeans
from taxel.gap.features.metric import terms, total
from taxel.gap.fitting.composite import CompositeModel
from taxel.gap.fitting.equations import Problem
from taxel.gap.fitting.fit import ITERATIONS, NOTHING_KNOWN, Fit, KnownColumns, fit
from taxel.gap.fitting.state import State
from taxel.types import FloatArray

FOLDS: Final = 16
"""Parts of the cells, at most; each is predicted by what the others tell."""

MODEL_SHARE: Final = 0.04
"""Relative error of a good simulator's drop: two solvers of one contact differ by as much at least."""

NOISE_SHARE: Final = 0.05
"""The same of its noise."""

TOLERANCE_COUNTS: Final = {"signal": 3.0, "noise": 1.0, "missing": 5.0, "onset": 8.0, "drift_residual": 2.0}
"""And its absolute error."""

USUAL_REPEAT_SHARE: Final = 0.5
"""Share of the variance between simulated repeats that applies to their mean in a fit: between 1 for random repeats and
0 for repeats that were planned such that their variation cancels. A comparison estimates the share."""

REFITS: Final = 3
"""Iterations of a fit that begins near its end."""


class Judge:
    """A simulator's state and the real sessions with which sets of effects are compared.

    state, sessions, layout: of the pair. target: f64[C, F, n], mean real features. weight: f64[C, F, n], of the fit.
    fold: [C], part of each cell. parts: [C, n], part of each taxel in each cell. floor2: squared floor, counts^2.
    """

    def __init__(self, state: State, real: SessionMeans, layout: Layout) -> None:
        self.state, self.layout, self.sessions = state, layout, real
        self.target = np.nan_to_num(real.mean)
        self.weight = self._weights(real)
        self.fold = _folds(state.pair.conditions)
        self.parts = _parts(state.pair, self.fold)
        self.floor2 = total(terms(real, state.mean, layout).floor2)

    def shifted(self, seconds: float) -> Judge:
        """The same with a simulation that is so much later."""
        return Judge(self.state.shifted(seconds), self.sessions, self.layout)

    def _weights(self, real: SessionMeans) -> FloatArray:
        """One over the variance, f64[C, F, n]. The features of a taxel in a press scatter together: by the layout's
        weights, which add to 1, all of them tell as much as one that is known by itself. What is called information or
        standard deviations elsewhere is of these.
        """
        model, layout = self.state.mean, self.layout
        variance = real.mean_variance + tolerance2(layout, model, self.target)
        if self.state.mean_variance is not None:
            variance = variance + USUAL_REPEAT_SHARE * self.state.mean_variance
        weight = layout.weight[:, None] / variance
        return np.where(real.known.any(axis=1), weight, 0.0)

    def problem(self, part: NDArray[np.bool_] | None = None) -> Problem:
        """To be fitted on some taxels of some cells, bool[C, n]; None: all."""
        weight = self.weight if part is None else np.where(part[:, None], self.weight, 0.0)
        return Problem(self.state, self.target, weight)

    def excess(self, features: FloatArray) -> float:
        """Excess of features f64[C, F, n], counts^2 as in the report."""
        return total(terms(self.sessions, features, self.layout).excess)

    def in_sample(
        self,
        composite: CompositeModel,
        fixed: tuple[str, ...] = (),
        iterations: int = ITERATIONS,
        known: KnownColumns = NOTHING_KNOWN,
    ) -> Fit:
        """Fitted to all cells. known: as `fit` takes it."""
        return fit(self.problem(), composite, fixed, iterations, known=known)


def tolerance2(layout: Layout, model: FloatArray, expected: FloatArray) -> FloatArray:
    """Squared error of an imperfect solver, counts^2, f64[C, F, n]. model, expected: features, of the simulator and of
    what it should be.
    """
    error = np.full(model.shape, TOLERANCE_COUNTS["signal"])
    signal_counts = np.maximum(np.abs(model), np.abs(expected))[:, : layout.bins]
    error[:, : layout.bins] = np.hypot(TOLERANCE_COUNTS["signal"], MODEL_SHARE * signal_counts)
    error[:, layout.noise] = np.hypot(TOLERANCE_COUNTS["noise"], NOISE_SHARE * model[:, layout.noise])
    for name in ("missing", "onset", "drift_residual"):
        error[:, getattr(layout, name)] = TOLERANCE_COUNTS[name]
    return np.asarray(error**2)


def _folds(conditions: tuple[tuple[str, str], ...]) -> NDArray[np.intp]:
    """Fold of each cell: the approaches of an object go to different ones."""
    count = min(FOLDS, len(conditions))
    fold = np.zeros(len(conditions), np.intp)
    for place, condition in enumerate(sorted(range(len(conditions)), key=lambda index: conditions[index])):
        fold[condition] = place % count
    return fold


def _parts(pair: Pair, fold: NDArray[np.intp]) -> NDArray[np.intp]:
    """Part of each taxel in each cell, [C, n]: of every cell half of the taxels, as the squares of a chessboard, are
    left out with the other half of another cell. What a press does to a taxel can then be learned from its neighbours,
    what a taxel does from other presses, and neither from itself.
    """
    count = max(int(fold.max()) + 1, 2)
    dark = (pair.taxels.tx.astype(np.intp) + pair.taxels.rx) % 2
    return np.asarray((fold[:, None] + dark * (count // 2)) % count)
