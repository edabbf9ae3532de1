"""Log predictive density of features, by condition, board and family of features."""

from __future__ import annotations

from typing import Final

import numpy as np

from taxel.gap.comparison.settings import ComparisonSettings
from taxel.gap.fitting.judge import Judge
from taxel.types import FloatArray

POOLED_SHARE: Final = 0.5
"""Share of the mean variance over conditions in the variance of a feature: few sessions estimate a variance poorly, and
shrinkage towards the mean is the usual remedy (Smyth 2004)."""


class BlockDensity:
    """Density of real features given predicted ones; a block consists of the features of one family on one board in one
    condition.

    The deviation of a block is the mean squared difference of its features, each divided by the variance of the real
    mean. The density of a block is that of a multivariate Student t distribution with S - 1 degrees of freedom for S
    sessions and `settings.dimensions` effective dimensions: a block that no set predicts, such as a faulty contact of
    the simulator, changes the comparison by a bounded amount.
    """

    def __init__(self, judge: Judge, settings: ComparisonSettings, model_error: float = 0.0) -> None:
        """Prepare the density for the real sessions of a pair; features that do not count have no weight.

        model_error: relative error of the simulated signal, of a taxel in a condition (`estimate_model_error`).
        """
        self._judge, self._settings = judge, settings
        real, layout = judge.sessions, judge.layout
        self._freedom = max(real.value.shape[1] - 1, 1)
        variance = np.nan_to_num(real.variance) / np.maximum(real.known.sum(axis=1), 1)
        variance = (1.0 - POOLED_SHARE) * variance + POOLED_SHARE * variance.mean(axis=0)
        for family, resolution in zip(layout.families, settings.resolution_counts, strict=True):
            variance[:, family] += resolution**2
        self._variance = variance
        self._signal = np.maximum(np.abs(judge.state.mean), np.abs(judge.target))[:, : layout.bins]
        variance = variance.copy()
        variance[:, : layout.bins] += (model_error * self._signal) ** 2
        counts = (judge.weight > 0) & real.known.any(axis=1)
        self._share = np.where(counts, layout.weight[:, None], 0.0)
        self._weight = self._share / variance
        sensor = judge.state.pair.groups.sensor
        self._boards = (sensor[:, None] == np.arange(int(sensor.max()) + 1)).astype(np.float64)
        self._total = self._sum_blocks(self._share)

    def estimate_model_error(self, features: FloatArray) -> float:
        """Estimate the relative error of the simulated signal from features f64[C, F, n] with the best set of effects.

        The error of a block is the root of its mean square deviation beyond the variance of the real mean, relative to
        its mean square signal. The result is the median over the loaded blocks, at least
        `settings.smallest_model_error`, so that a few blocks with an error of another kind do not determine it.
        """
        bins = self._judge.layout.bins
        share = self._share[:, :bins]
        beyond = (self._judge.target - features)[:, :bins] ** 2 - self._variance[:, :bins]
        excess, power = ((share * part).sum(axis=1) @ self._boards for part in (beyond, self._signal**2))
        loaded = power > self._settings.loaded_share * max(float(power.max()), np.finfo(float).tiny)
        error2 = float(np.median(excess[loaded] / power[loaded])) if loaded.any() else 0.0
        return max(float(np.sqrt(max(error2, 0.0))), self._settings.smallest_model_error)

    def compute_deviations(self, features: FloatArray) -> FloatArray:
        """Mean squared standardised difference of each block from predicted features f64[C, F, n], f64[C, s, 5].

        About 1 where only sessions and repeats vary; 0 for a block without features.
        """
        squares = self._sum_blocks(self._weight * (self._judge.target - features) ** 2)
        return np.divide(squares, self._total, out=np.zeros_like(squares), where=self._total > 0.0)

    def compute_log_density(self, features: FloatArray) -> FloatArray:
        """Log density of each block given predicted features f64[C, F, n], up to a constant, f64[C, s, 5]."""
        dimensions, freedom = np.array(self._settings.dimensions), self._freedom
        deviations = self.compute_deviations(features)
        return np.asarray(-0.5 * (freedom + dimensions) * np.log1p(dimensions * deviations / freedom))

    def _sum_blocks(self, values: FloatArray) -> FloatArray:
        """Sums of values f64[C, F, n] over the features and taxels of each block, f64[C, s, 5]."""
        families = self._judge.layout.families
        return np.asarray(np.stack([values[:, family].sum(axis=1) @ self._boards for family in families], axis=-1))
