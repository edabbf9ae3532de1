"""How much of the gap a chain of effects explains, on cells that it was not fitted to.

The score is the excess with every feature divided by what sessions and an imperfect solver scatter: a mean of products
of different sessions' residuals, so that scatter cancels.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.chain import Chain
from taxel.gap.cores import in_copies
from taxel.gap.equations import Problem
from taxel.gap.features import Layout, SessionMeans
from taxel.gap.fit import ITERATIONS, NOTHING_KNOWN, Fit, KnownColumns, Start, fit, start_of
from taxel.gap.metric import leave_one_out, off_diagonal, terms, total
from taxel.gap.pair import Pair
from taxel.gap.score import Score, scatter2
from taxel.gap.state import State
from taxel.types import FloatArray

FOLDS: Final = 16
"""Parts of the cells, at most; each is predicted by what the others tell."""

MODEL_SHARE: Final = 0.04
"""Relative error of a good simulator's drop: two solvers of one contact differ by as much at least."""

NOISE_SHARE: Final = 0.05
"""The same of its noise."""

TOLERANCE_COUNTS: Final = {"drop": 3.0, "noise": 1.0, "missing": 5.0, "onset": 8.0, "wander": 2.0}
"""And its absolute error."""

NOISE: Final = 1
"""Place of the noise among the families."""

NOTICEABLE: Final = 0.25
"""Mean square of standardised residuals that a simulator without any effect to be found stays below."""

IMPERFECT: Final = 0.03
"""And the least that a good simulator leaves: no effect takes it away. Chosen on opened worlds of this project's
emulator, whose worlds without effect have 0.03 to 0.15."""

REFITS: Final = 3
"""Iterations of a fit that begins near its end."""


class Judge:
    """Judges chains on a state against real sessions."""

    def __init__(self, state: State, real: SessionMeans, layout: Layout, out: NDArray[np.bool_] | None = None) -> None:
        """out: bool[C, F, n], features that do not count; None: all count."""
        self.state, self.layout, self.sessions = state, layout, real
        self.target = np.nan_to_num(real.mean)
        self.out = out
        self.weight = self._counting(self._weights(real))
        self.fold = _folds(state.pair.cells)
        self.parts = _parts(state.pair, self.fold)
        self.floor2 = total(terms(real, state.mean, layout).floor2)

    @property
    def is_partial(self) -> bool:
        """Whether some features do not count."""
        return self.out is not None

    @property
    def noticeable(self) -> FloatArray:
        """Score of each family of features, f64[5], below which a good simulator may just be imperfect."""
        return NOTICEABLE * self._counted

    @property
    def imperfect(self) -> float:
        """Score that a good simulator leaves at least."""
        return IMPERFECT * float(self._counted.sum())

    @property
    def _counted(self) -> FloatArray:
        """Of each family of features, f64[5], how many count, with their weights."""
        counting = (self.layout.weight[:, None] * (self.weight > 0)).sum(axis=(0, 2))
        return np.array([counting[own].sum() for own in self.layout.families])

    def without(self, out: NDArray[np.bool_]) -> Judge:
        """A judge to whom these features, bool[C, F, n], do not count either."""
        return Judge(self.state, self.sessions, self.layout, out if self.out is None else self.out | out)

    def shifted(self, seconds: float) -> Judge:
        """A judge of a simulation that is so much later."""
        return Judge(self.state.shifted(seconds), self.sessions, self.layout, self.out)

    def _counting(self, weight: FloatArray) -> FloatArray:
        return weight if self.out is None else np.where(self.out, 0.0, weight)

    def _weights(self, real: SessionMeans) -> FloatArray:
        """One over the variance, f64[C, F, n]. The features of a taxel in a press scatter together: by the layout's
        weights, which add to 1, all of them tell as much as one that is known by itself. What is called information or
        standard deviations elsewhere is of these.
        """
        model, layout = self.state.mean, self.layout
        between = np.nan_to_num(real.variance) / np.maximum(real.known.sum(axis=1), 1)
        pooled = 0.5 * between + 0.5 * between.mean(axis=0)
        weight = layout.weight[:, None] / (pooled + tolerance2(layout, model, self.target))
        return np.where(real.known.any(axis=1), weight, 0.0)

    def problem(self, part: NDArray[np.bool_] | None = None) -> Problem:
        """To be fitted on some taxels of some cells, bool[C, n]; None: all."""
        weight = self.weight if part is None else np.where(part[:, None], self.weight, 0.0)
        return Problem(self.state, self.target, weight)

    def score(self, features: FloatArray, weight: FloatArray | None = None) -> Score:
        """Of features f64[C, F, n]."""
        weight = self.weight if weight is None else weight
        if not self.sessions.is_complete:  # as a rule they are, and one product of matrices serves
            return self._score_of_some(features, weight)
        residual = self.sessions.residual(features)
        # Per pair of sessions and cell: sum over s != t of w D_s D_t, over their number.
        weighted = residual * weight[:, None]
        grams = np.stack([_products(weighted[:, :, own], residual[:, :, own]) for own in self.layout.families])
        cells, families = grams.sum(axis=0), off_diagonal(grams.sum(axis=1))
        left = [off_diagonal(cells[:, stay][:, :, stay]) for stay in leave_one_out(cells.shape[1])]
        return Score(float(families.sum()), np.array(left), families, self.together)

    def _score_of_some(self, features: FloatArray, weight: FloatArray) -> Score:
        """As `score`, where sessions lack cells: what is known stands for its like."""
        every = weight.sum(axis=(0, 2))

        def families(told: FloatArray, known: NDArray[np.bool_]) -> FloatArray:
            """Of each family and cell, f64[5, C]."""
            sums, parts = np.einsum("cfn,cfn->fc", weight, told), np.einsum("cfn,cfn->f", weight, known)
            own = [(sums[one].sum(axis=0), parts[one].sum(), every[one].sum()) for one in self.layout.families]
            return np.array([found * (whole / part if part > 0 else 0.0) for found, part, whole in own])

        found, *left = (families(*one) for one in self.sessions.excesses(features))
        return Score(float(found.sum()), np.array([one.sum(axis=0) for one in left]), found.sum(axis=1), self.together)

    @cached_property
    def together(self) -> float:
        """How much more what a session adds to all presses scatters, than if presses scattered by themselves: of the
        amplitude of the hand and of each board, and of what is added to it. At least 1.
        """
        bins, pair = slice(0, self.layout.bins), self.state.pair
        scatter = np.nan_to_num(self.sessions.value - self.sessions.mean[:, None])[:, :, bins]
        own = np.arange(int(pair.groups.sensor.max()) + 1)[:, None] == pair.groups.sensor
        own = np.vstack([own, np.ones(pair.n, np.bool_)]).astype(np.float64)
        found = []
        for change in (self.state.mean[:, bins], np.ones_like(self.state.mean[:, bins])):
            each = np.einsum("csfn,cfn->csn", scatter, self.weight[:, bins] * change) @ own.T
            found += [scatter2(one.T) for one in np.moveaxis(each, 2, 0)]
        ratio = np.array([whole / apart if apart > 0 else 1.0 for whole, apart, _ in found])
        several = np.array([1.0 - 1.0 / cells for *_, cells in found])  # one cell says nothing of two
        return float(max(several @ ratio / several.sum(), 1.0)) if several.sum() > 0 else 1.0

    def excess(self, features: FloatArray) -> float:
        """Of features f64[C, F, n], counts^2 as in the report: not weighted by what scatters."""
        return self._in_counts(features).value

    def noise_excess(self, features: FloatArray) -> float:
        """That of the noise alone."""
        return float(self._in_counts(features).families[NOISE])

    def _in_counts(self, features: FloatArray) -> Score:
        scale = self.layout.scale(features.shape[0], features.shape[2])
        return self.score(features, self._counting(np.broadcast_to(scale, features.shape)))

    def in_sample(
        self,
        chain: Chain,
        fixed: tuple[str, ...] = (),
        iterations: int = ITERATIONS,
        known: KnownColumns = NOTHING_KNOWN,
    ) -> Fit:
        """Fitted to all cells. known: as `fit` takes it."""
        return fit(self.problem(), chain, fixed, iterations, known=known)

    def cross_validated(
        self, chains: Sequence[Chain], fixed: tuple[str, ...] = ()
    ) -> list[tuple[FloatArray, tuple[Chain, ...]]]:
        """For each chain, fitted to all parts: each part as predicted by a fit to the others, f64[C, F, n], and these
        fits. They are shared out at once, for those of some chains take far longer.
        """
        starts = in_copies(self.state, lambda chain: start_of(self.state, chain, fixed), chains)
        numbers = range(int(self.parts.max()) + 1)

        def without(job: tuple[Start, int]) -> tuple[FloatArray, Chain]:
            start, number = job
            held = self.parts == number
            fitted = fit(self.problem(~held), start.chain, fixed, REFITS, start)
            return np.moveaxis(fitted.features, 1, 2)[held], fitted.chain

        fits = iter(in_copies(self.state, without, [(start, number) for start in starts for number in numbers]))
        found = []
        for _ in starts:
            result, parts = self.state.mean.copy(), []
            for number, (features, chain) in zip(numbers, fits, strict=False):
                np.moveaxis(result, 1, 2)[self.parts == number] = features
                parts.append(chain)
            found.append((result, tuple(parts)))
        return found


def _products(first: FloatArray, other: FloatArray) -> FloatArray:
    """Of all pairs of sessions, added in each cell, f64[C, S, S]. first, other: f64[C, S, F, n]."""
    shape = (*first.shape[:2], first.shape[2] * first.shape[3])
    return np.asarray(first.reshape(shape) @ other.reshape(shape).transpose(0, 2, 1))


def tolerance2(layout: Layout, model: FloatArray, expected: FloatArray) -> FloatArray:
    """Squared error of an imperfect solver, counts^2, f64[C, F, n]. model, expected: features, of the simulator and of
    what it should be.
    """
    error = np.full(model.shape, TOLERANCE_COUNTS["drop"])
    drop = np.maximum(np.abs(model), np.abs(expected))[:, : layout.bins]
    error[:, : layout.bins] = np.hypot(TOLERANCE_COUNTS["drop"], MODEL_SHARE * drop)
    error[:, layout.noise] = np.hypot(TOLERANCE_COUNTS["noise"], NOISE_SHARE * model[:, layout.noise])
    for name in ("missing", "onset", "wander"):
        error[:, getattr(layout, name)] = TOLERANCE_COUNTS[name]
    return np.asarray(error**2)


def _folds(cells: tuple[tuple[str, str], ...]) -> NDArray[np.intp]:
    """Fold of each cell: the approaches of an object go to different ones."""
    count = min(FOLDS, len(cells))
    fold = np.zeros(len(cells), np.intp)
    for place, cell in enumerate(sorted(range(len(cells)), key=lambda index: cells[index])):
        fold[cell] = place % count
    return fold


def _parts(pair: Pair, fold: NDArray[np.intp]) -> NDArray[np.intp]:
    """Part of each taxel in each cell, [C, n]: of every cell half of the taxels, as the squares of a chessboard, are
    left out with the other half of another cell. What a press does to a taxel can then be learned from its neighbours,
    what a taxel does from other presses, and neither from itself.
    """
    count = max(int(fold.max()) + 1, 2)
    dark = (pair.taxels.tx.astype(np.intp) + pair.taxels.rx) % 2
    return np.asarray((fold[:, None] + dark * (count // 2)) % count)
