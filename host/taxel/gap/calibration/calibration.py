"""From evidence to probability: logistic models, fitted to worlds with known causes and stored as data."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit, logit, ndtr

from taxel.gap.errors import GapInputError
from taxel.types import FloatArray

UNKNOWN = "unknown"
NO_GAP = "no_gap"

LIMITS = (1e-6, 1.0 - 1e-6)
"""Limits of probabilities in logarithms; no calibration on hundreds of worlds supports more certainty."""

PENALTY = 1.0
"""Precision of the normal prior on the standardised coefficients of a logistic model (ridge, as usual for few data)."""


LISTED = 0.5
"""Probability from which a cause is named (gap report, version 2)."""

SMALLEST_CAUSE = 0.5
"""Gap in floors from which an effect is a cause (definition of the gap report, version 2)."""

SIZE_ERROR = 0.4
"""Relative standard error of the size of a fitted effect (chosen: small effects are poorly determined)."""

LARGEST = 30.0
"""Bound of a coefficient, beyond every probability that data can support."""


@dataclass(frozen=True, eq=False)
class Logistic:
    """P = 1 / (1 + exp(-(intercept + coefficients . (x - mean) / std)))."""

    intercept: float
    coefficients: FloatArray
    mean: FloatArray
    std: FloatArray

    def predict(self, inputs: FloatArray) -> float:
        """Predict the probability for inputs f64[k]."""
        value = self.intercept + float(self.coefficients @ ((inputs - self.mean) / self.std))
        return float(expit(value))

    @classmethod
    def fit(cls, inputs: FloatArray, labels: Sequence[bool]) -> Logistic:
        """Fit the model by penalised maximum likelihood. inputs: f64[m, k]. labels: m statements, true or false."""
        mean, std = inputs.mean(axis=0), np.maximum(inputs.std(axis=0), 1e-9)
        design = np.column_stack([np.ones(len(inputs)), (inputs - mean) / std])
        target = np.asarray(labels, np.float64)

        def loss(parameters: FloatArray) -> tuple[float, FloatArray]:
            value = design @ parameters
            gradient = design.T @ (expit(value) - target)
            gradient[1:] += PENALTY * parameters[1:]
            cost = (
                np.logaddexp(0.0, value).sum() - target @ value + 0.5 * PENALTY * float(parameters[1:] @ parameters[1:])
            )
            return float(cost), gradient

        start, bounds = np.zeros(design.shape[1]), [(-LARGEST, LARGEST)] * design.shape[1]
        solution = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=bounds).x
        return cls(float(solution[0]), solution[1:], mean, std)

    def to_json(self) -> dict[str, object]:
        """The parameters as JSON values."""
        return {
            "intercept": round(self.intercept, 6),
            **{name: np.round(getattr(self, name), 6).tolist() for name in ("coefficients", "mean", "std")},
        }

    @classmethod
    def from_json(cls, values: dict[str, object]) -> Logistic:
        """The model of JSON values that `to_json` returned."""
        arrays = (np.asarray(values[name], np.float64) for name in ("coefficients", "mean", "std"))
        return cls(float(str(values["intercept"])), *arrays)


@dataclass(frozen=True, eq=False)
class Calibration:
    """Calibrated probabilities.

    effect: of an effect that was part of a candidate set, from `combine_inputs`. unknown: of a cause
    outside the catalogue, from the inputs of `RemainderEvidence`. any_cause: of at least one cause, from the size of
    the gap (first input of `RemainderEvidence`) and from the largest gain of an effect (second input of
    `EffectEvidence`). not_compared: of an effect that no coarse fit selected. source: how the calibration was produced.
    """

    effect: Logistic
    unknown: Logistic
    any_cause: Logistic
    not_compared: float
    source: str

    def compute_probabilities(
        self, effects: Mapping[str, FloatArray], remainder: FloatArray, tried: Sequence[str]
    ) -> dict[str, float]:
        """Compute the probability of every effect that was tried, of an unknown cause and of no gap.

        effects: inputs of each effect with evidence, f64[6]. remainder: f64[6]. The probability of at least
        one cause, A, is that of `any_cause`. If the causes were independent, it would be I = 1 - product of (1 - p);
        the probability of a cause, given that there is one, is p / I, and the result is A p / I.
        """
        odds = self.compute_odds(effects, remainder, tried)
        some = self.any_cause.predict(compute_any_inputs(effects, remainder))
        # An effect is no cause if it alone produces less than half the floor (definition of the gap report).
        sizes = [effects[name][2] if name in effects else np.log(SMALLEST_CAUSE) for name in tried]
        large = ndtr((np.array(sizes) - np.log(SMALLEST_CAUSE)) / SIZE_ERROR)
        own = expit(odds) * np.append(np.where([name in effects for name in tried], large, 1.0), 1.0)
        independent = -np.expm1(np.log1p(-own).sum())
        values = np.minimum(own * some / independent, LIMITS[1])
        return {**dict(zip([*tried, UNKNOWN], values.tolist(), strict=True)), NO_GAP: 1.0 - some}

    def compute_odds(
        self, effects: Mapping[str, FloatArray], remainder: FloatArray, tried: Sequence[str]
    ) -> FloatArray:
        """Log odds of every effect that was tried and of an unknown cause, each by itself, f64[len(tried) + 1]."""
        found = [
            self.effect.predict(combine_inputs(effects[name], remainder)) if name in effects else self.not_compared
            for name in tried
        ]
        return np.asarray(logit(np.clip([*found, self.unknown.predict(remainder)], *LIMITS)))

    def to_json(self) -> dict[str, object]:
        """The calibration as JSON values."""
        return {
            "source": self.source,
            "not_compared": round(self.not_compared, 6),
            "effect": self.effect.to_json(),
            "unknown": self.unknown.to_json(),
            "any_cause": self.any_cause.to_json(),
        }


def combine_inputs(effect: FloatArray, remainder: FloatArray) -> FloatArray:
    """Inputs of `Calibration.effect`, f64[9]: those of an effect, f64[6], and of the remainder's inputs, f64[6], the
    deviation, the size and the gain. A name is less certain if the best set leaves much.
    """
    return np.concatenate([effect, remainder[[2, 4, 5]]])


def compute_any_inputs(effects: Mapping[str, FloatArray], remainder: FloatArray) -> FloatArray:
    """Inputs of `Calibration.any_cause`, f64[3].

    Logarithm of the gap in floors, largest gain of an effect, and the same logarithm above one floor. effects: inputs
    f64[6] of each effect. remainder: f64[6].
    """
    gain = max((values[1] for values in effects.values()), default=0.0)
    return np.array([remainder[0], gain, max(float(remainder[0]), 0.0)])


@cache
def load_calibration() -> Calibration:
    """The packaged calibration. Raises GapInputError if it is damaged."""
    path = resources.files("taxel.gap.calibration").joinpath("calibration.json")
    try:
        values = json.loads(path.read_text())
        return Calibration(
            Logistic.from_json(values["effect"]),
            Logistic.from_json(values["unknown"]),
            Logistic.from_json(values["any_cause"]),
            float(values["not_compared"]),
            str(values["source"]),
        )
    except (ValueError, KeyError, TypeError) as error:
        raise GapInputError(str(path), "a calibration", repr(error), "install the package again") from None
