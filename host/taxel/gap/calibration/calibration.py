"""Conversion of evidence to probabilities by logistic models that were fitted to worlds with known causes."""

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

PROBABILITY_LIMITS = (1e-6, 1.0 - 1e-6)
"""Limits of probabilities before logarithms are taken (chosen): hundreds of worlds cannot support more certainty."""

COEFFICIENT_PRECISION = 1.0
"""Precision of the normal prior on the standardised coefficients of a logistic model (ridge penalty, usual for few
data). A larger value reduces the coefficients."""

NAMED_PROBABILITY = 0.5
"""Probability from which a cause is named (definition of the gap report, version 2)."""

SMALLEST_CAUSE = 0.5
"""Gap in floors from which an effect is a cause (definition of the gap report, version 2)."""

SIZE_ERROR = 0.4
"""Relative standard error of the size of a fitted effect (chosen: small effects are poorly determined)."""

MAX_COEFFICIENT = 30.0
"""Largest absolute value of a coefficient (chosen): far beyond every probability that data can support."""


@dataclass(frozen=True, eq=False)
class Logistic:
    """Logistic model with k inputs: P = 1 / (1 + exp(-(intercept + coefficients . (x - mean) / std))).

    coefficients, mean, std: f64[k]; mean and std standardise the inputs.
    """

    intercept: float
    coefficients: FloatArray
    mean: FloatArray
    std: FloatArray

    def predict(self, inputs: FloatArray) -> float:
        """Predict the probability for inputs f64[k]."""
        value = self.intercept + float(self.coefficients @ ((inputs - self.mean) / self.std))
        return float(expit(value))

    @classmethod
    def fit(cls, inputs: FloatArray, labels: Sequence[bool], weights: Sequence[float] | None = None) -> Logistic:
        """Fit the model by penalised maximum likelihood.

        inputs: f64[m, k], k inputs for each of m statements that a cause is present. labels: whether each statement is
        true. weights: weight of each statement, at least 0; None: 1. A statement of weight 2 counts as two statements.
        """
        weight = np.ones(len(inputs)) if weights is None else np.asarray(weights, np.float64)
        mean = np.average(inputs, axis=0, weights=weight)
        std = np.maximum(np.sqrt(np.average((inputs - mean) ** 2, axis=0, weights=weight)), 1e-9)
        design = np.column_stack([np.ones(len(inputs)), (inputs - mean) / std])
        target = np.asarray(labels, np.float64)

        def compute_loss(parameters: FloatArray) -> tuple[float, FloatArray]:
            """Return the negative log likelihood with the ridge penalty, and its gradient, for the intercept and the
            coefficients.
            """
            value = design @ parameters
            gradient = design.T @ (weight * (expit(value) - target))
            gradient[1:] += COEFFICIENT_PRECISION * parameters[1:]
            cost = weight @ (np.logaddexp(0.0, value) - target * value) + 0.5 * COEFFICIENT_PRECISION * float(
                parameters[1:] @ parameters[1:]
            )
            return float(cost), gradient

        start, bounds = np.zeros(design.shape[1]), [(-MAX_COEFFICIENT, MAX_COEFFICIENT)] * design.shape[1]
        solution = minimize(compute_loss, start, jac=True, method="L-BFGS-B", bounds=bounds).x
        return cls(float(solution[0]), solution[1:], mean, std)

    def to_json(self) -> dict[str, object]:
        """Return the parameters as JSON values."""
        return {
            "intercept": round(self.intercept, 6),
            **{name: np.round(getattr(self, name), 6).tolist() for name in ("coefficients", "mean", "std")},
        }

    @classmethod
    def from_json(cls, values: dict[str, object]) -> Logistic:
        """Build a model from JSON values of `to_json`. Raises KeyError for a missing parameter."""
        arrays = (np.asarray(values[name], np.float64) for name in ("coefficients", "mean", "std"))
        return cls(float(str(values["intercept"])), *arrays)


@dataclass(frozen=True, eq=False)
class Calibration:
    """Models that convert evidence into calibrated probabilities.

    effect: model for an effect that is part of a candidate set; inputs of `combine_inputs`. unknown: model for a cause
    outside the catalogue; inputs of `RemainderEvidence`. any_cause: model for at least one cause; inputs of
    `compute_any_inputs`. not_compared: probability of an effect that no candidate set contains. source: how the
    calibration was produced.
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

        effects: inputs of each effect with evidence, f64[8] (`EffectEvidence.to_inputs`; element 2 is the logarithm of
        the effect's gap divided by the floor). remainder: f64[7] (`RemainderEvidence.to_inputs`). tried: names of the
        effects.

        The model of each cause predicts its probability p independently of the other causes. Independent causes would
        have the probability I = 1 - product of (1 - p) of at least one cause, and a cause would have the probability
        p / I if there is at least one. The model `any_cause` predicts the probability A of at least one cause. The
        result is A p / I.
        """
        odds = self.compute_odds(effects, remainder, tried)
        any_cause = self.any_cause.predict(compute_any_inputs(effects, remainder))
        # An effect is no cause if it alone produces less than half the floor (definition of the gap report).
        sizes = [effects[name][2] if name in effects else np.log(SMALLEST_CAUSE) for name in tried]
        size_probabilities = ndtr((np.array(sizes) - np.log(SMALLEST_CAUSE)) / SIZE_ERROR)
        # An effect without evidence and the unknown cause (last element) have no size, and keep their probability.
        independent_probabilities = expit(odds) * np.append(
            np.where([name in effects for name in tried], size_probabilities, 1.0), 1.0
        )
        independent_any = -np.expm1(np.log1p(-independent_probabilities).sum())
        values = np.minimum(independent_probabilities * any_cause / independent_any, PROBABILITY_LIMITS[1])
        return {**dict(zip([*tried, UNKNOWN], values.tolist(), strict=True)), NO_GAP: 1.0 - any_cause}

    def compute_odds(
        self, effects: Mapping[str, FloatArray], remainder: FloatArray, tried: Sequence[str]
    ) -> FloatArray:
        """Compute the log odds of every effect that was tried and of an unknown cause, f64[len(tried) + 1], in this
        order.

        effects: inputs of each effect with evidence, f64[8]. remainder: inputs f64[7]. tried: names of the effects.
        Each cause is evaluated independently of the others.
        """
        probabilities = [
            self.effect.predict(combine_inputs(effects[name], remainder)) if name in effects else self.not_compared
            for name in tried
        ]
        return np.asarray(logit(np.clip([*probabilities, self.unknown.predict(remainder)], *PROBABILITY_LIMITS)))

    def to_json(self) -> dict[str, object]:
        """Return the calibration as JSON values."""
        return {
            "source": self.source,
            "not_compared": round(self.not_compared, 6),
            "effect": self.effect.to_json(),
            "unknown": self.unknown.to_json(),
            "any_cause": self.any_cause.to_json(),
        }


def combine_inputs(effect: FloatArray, remainder: FloatArray) -> FloatArray:
    """Return the inputs of `Calibration.effect`, f64[10].

    They are the inputs of the effect, f64[8], and two inputs of the remainder, f64[7]: size and gain. An effect is less
    certain if the remainder of the best set is large.
    """
    return np.concatenate([effect, remainder[[4, 5]]])


def compute_any_inputs(effects: Mapping[str, FloatArray], remainder: FloatArray) -> FloatArray:
    """Return the inputs of `Calibration.any_cause`, f64[4].

    They are the logarithm of the ratio of gap to floor, the largest gain of an effect (0 without effects), the positive
    part of this logarithm, and the evidence for a difference from the sessions. effects: inputs f64[8] of each effect;
    element 1 is the gain. remainder: inputs f64[7]; element 0 is the logarithm, element 6 the evidence.
    """
    gain = max((values[1] for values in effects.values()), default=0.0)
    return np.array([remainder[0], gain, max(float(remainder[0]), 0.0), remainder[6]])


@cache
def load_calibration() -> Calibration:
    """Return the packaged calibration. Raises GapInputError if the file is damaged."""
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
