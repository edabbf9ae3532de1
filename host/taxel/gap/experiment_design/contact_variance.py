"""Variance of the features of a future contact, estimated from the sessions of the recorded contacts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from taxel.gap.features.features import FeatureLayout
from taxel.gap.fitting.fit_data import FitData, compute_tolerance2
from taxel.gap.fitting.state import RESPONSE_COUNTS
from taxel.types import FloatArray


@dataclass(frozen=True, eq=False)
class ContactVariance:
    """Variance of the mean features of a further contact with as many repeats and sessions as the recorded contacts.

    A taxel is touched if its simulated signal exceeds `RESPONSE_COUNTS`.

    Attributes:
        layout: the features.
        feature_variance: f64[F, n] (F features, n taxels), mean variance over the recorded conditions, counts^2; used
            for all features other than signals.
        untouched_variance: f64[B] (B time bins), variance of the signal of untouched taxels in each bin, counts^2.
        relative_variance: f64[B], additional variance of touched taxels in each bin, divided by the squared signal.
    """

    layout: FeatureLayout
    feature_variance: FloatArray
    untouched_variance: FloatArray
    relative_variance: FloatArray

    @classmethod
    def estimate(cls, fit_data: FitData) -> ContactVariance:
        """Estimate the variances from the sessions of the recording.

        Taxels with a simulated signal above `RESPONSE_COUNTS` are touched. Their variance beyond that of the untouched
        taxels is assumed to be proportional to the squared signal.
        """
        layout, real = fit_data.layout, fit_data.sessions
        variance = np.nan_to_num(real.variance) / np.maximum(real.is_known.sum(axis=1), 1)
        signal_counts, bin_variance = fit_data.state.mean[:, : layout.bins], variance[:, : layout.bins]
        is_touched = np.abs(signal_counts) > RESPONSE_COUNTS
        untouched_variance = np.where(is_touched, 0.0, bin_variance).sum(axis=(0, 2)) / np.maximum(
            (~is_touched).sum(axis=(0, 2)), 1
        )
        additional_variance = np.where(
            is_touched, np.maximum(bin_variance - untouched_variance[:, None], 0.0), 0.0
        ).sum(axis=(0, 2))
        squared_signal = np.where(is_touched, signal_counts**2, 0.0).sum(axis=(0, 2))
        return cls(
            layout,
            variance.mean(axis=0),
            untouched_variance,
            additional_variance / np.maximum(squared_signal, RESPONSE_COUNTS**2),
        )

    def compute_weight(self, model: FloatArray, expected: FloatArray) -> FloatArray:
        """Return the weights of new contacts, f64[C, F, n] (C conditions, F features, n taxels), 1 / counts^2.

        model, expected: f64[C, F, n], features of the simulator without effects and of a composite model, counts.
        """
        variance = np.broadcast_to(self.feature_variance, model.shape).copy()
        signal_counts = np.maximum(np.abs(model), np.abs(expected))[:, : self.layout.bins]
        variance[:, : self.layout.bins] = (
            self.untouched_variance[:, None] + self.relative_variance[:, None] * signal_counts**2
        )
        return self.layout.weight[:, None] / (variance + compute_tolerance2(self.layout, model, expected))

    def compute_repeat_weight(self, fit_data: FitData, expected: FloatArray) -> FloatArray:
        """Return the weight that a second recording of the same contacts adds, f64[C, F, n] (C conditions, F features,
        n taxels), 1 / counts^2.

        The second recording halves the variance between sessions, but not the squared tolerance of the simulator.
        expected: f64[C, F, n], features of a composite model, counts.
        """
        tolerance2 = compute_tolerance2(self.layout, fit_data.state.mean, expected)
        with np.errstate(divide="ignore"):
            variance = np.maximum(self.layout.weight[:, None] / fit_data.weight - tolerance2, 0.0)
        weight_of_both = self.layout.weight[:, None] / (0.5 * variance + tolerance2)
        return np.where(fit_data.weight > 0.0, np.maximum(weight_of_both - fit_data.weight, 0.0), 0.0)
