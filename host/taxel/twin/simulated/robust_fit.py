"""Maximum a posteriori fit with normal priors and Student-t errors.

Iteratively reweighted least squares with Levenberg-Marquardt steps (Gelman et al., Bayesian Data Analysis, 2013,
section 17.2).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from taxel.types import FloatArray

DEGREES_OF_FREEDOM: Final = 4.0
"""Of the Student-t errors: a dead line or a changed board must not move the object (chosen)."""

LARGEST_DAMPING: Final = 1e6
"""Relative damping at which a search ends: a step is then far below the accuracy of the parameters."""

LEAST_GAIN: Final = 1e-3
"""Relative reduction of the misfit below which a search ends."""


class FitModel(Protocol):
    """A model with p parameters and m errors."""

    def compute_errors(self, parameters: FloatArray) -> FloatArray:
        """Return measured minus predicted values in units of their scale, f64[m]; 0 without a measurement."""
        ...

    def differentiate(self, parameters: FloatArray, errors: FloatArray) -> FloatArray:
        """Return minus the derivatives of the errors, f64[m, p]; the unit of a parameter is its prior deviation.

        errors: f64[m], errors at `parameters`.
        """
        ...


@dataclass(frozen=True, eq=False)
class Prior:
    """Normal priors of p parameters: means f64[p] and standard deviations f64[p]."""

    mean: FloatArray
    deviation: FloatArray


def fit(
    model: FitModel, prior: Prior, start: FloatArray, iterations: int, degrees: float = DEGREES_OF_FREEDOM
) -> tuple[FloatArray, float]:
    """Search the parameters f64[p] with the smallest misfit; return them and the misfit.

    The method is iteratively reweighted least squares with Levenberg-Marquardt steps; the weights represent the Student
    t distribution of the errors. The derivatives are per standard deviation of the prior, so that the prior adds the
    unit matrix to the information. The misfit is minus the logarithm of the posterior density up to a constant. start:
    f64[p]. iterations: largest number of steps. degrees: degrees of freedom of the errors.
    """
    parameters = start
    errors = model.compute_errors(parameters)
    misfit = _compute_misfit(errors, parameters, prior, degrees)
    damping = 1e-2
    for _ in range(iterations):
        slope = model.differentiate(parameters, errors)
        weight = (degrees + 1.0) / (degrees + errors**2)
        gradient = slope.T @ (weight * errors) - (parameters - prior.mean) / prior.deviation
        information = slope.T @ (weight[:, None] * slope) + np.eye(len(parameters))
        while True:
            damped = information + damping * np.diag(np.diag(information))
            moved = parameters + np.linalg.solve(damped, gradient) * prior.deviation
            moved_errors = model.compute_errors(moved)
            moved_misfit = _compute_misfit(moved_errors, moved, prior, degrees)
            if moved_misfit < misfit:
                break
            damping *= 10.0
            if damping > LARGEST_DAMPING:
                return parameters, misfit  # no step reduces the misfit
        gain = misfit - moved_misfit
        parameters, errors, misfit = moved, moved_errors, moved_misfit
        damping = max(damping / 10.0, 1e-6)
        if gain < LEAST_GAIN * max(misfit, 1.0):
            break
    return parameters, misfit


def _compute_misfit(errors: FloatArray, parameters: FloatArray, prior: Prior, degrees: float) -> float:
    """Return minus the logarithm of the posterior density up to a constant."""
    losses = 0.5 * (degrees + 1.0) * np.log1p(errors**2 / degrees)
    return float(losses.sum() + 0.5 * (((parameters - prior.mean) / prior.deviation) ** 2).sum())
