"""Least-squares fit of a composite model.

A parameter has one value for the hand, or one for each board, object or taxel. The method is a Levenberg-Marquardt
iteration with numeric derivatives. One evaluation gives the derivatives of all blocks of a parameter, because every
taxel in a condition belongs to exactly one block of an effect.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np

from taxel.gap.effects.effect import Effect, Parameter
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.equations import (
    DampedSolver,
    DerivativeColumn,
    FitProblem,
    build_normal_matrix,
    compute_gradient,
)
from taxel.gap.fitting.parallel import map_in_processes
from taxel.gap.fitting.state import State
from taxel.types import FloatArray

DERIVATIVE_STEP: Final = 2e-3
"""Step of a numeric derivative, relative to the scale of the parameter (chosen)."""

INITIAL_DAMPING: Final = 0.1
"""Initial damping, relative to the unit diagonal of the scaled normal equations (chosen): an undamped first step would
be far too large in poorly determined directions, such as a displacement of an object along its own face."""

LINEARISED_DAMPING: Final = 1e-3
"""Initial damping of a fit that starts near its solution, with a given linearisation (chosen)."""

FINAL_DAMPING: Final = 1e-6
"""Damping of the final step towards the prior, practically undamped (chosen)."""

DAMPING_FACTOR: Final = 8.0
"""Factor on the damping after a step that increases the objective (chosen)."""

LINEARISED_DAMPING_FACTOR: Final = 30.0
"""Factor on the damping after a failed step of a fit with a given linearisation (chosen): larger than `DAMPING_FACTOR`,
so that the fit hardly moves in poorly determined directions."""

MAX_DAMPINGS: Final = 4
"""Largest number of dampings that are tried for one step (chosen)."""

MAX_ITERATIONS: Final = 12
"""Largest number of iterations of a fit (chosen); callers reduce it for coarse fits and near the solution."""

RELATIVE_TOLERANCE: Final = 1e-3
"""Relative reduction of the objective below which the iteration ends (chosen)."""

DERIVATIVE_UPDATE_GAIN: Final = 0.05
"""Relative reduction of the objective by a step above which the derivatives are computed again (chosen)."""

ColumnsByEffect = Mapping[str, tuple[DerivativeColumn, ...]]
"""Derivatives with respect to the parameters of each effect, by the name of the effect."""

NO_COLUMNS: Final[ColumnsByEffect] = MappingProxyType({})


@dataclass(frozen=True, eq=False)
class Fit:
    """Result of a fit.

    composite: model with the fitted values. features: f64[C, F, n] (C conditions, F features, n taxels), features that
    the model predicts, counts. cost: weighted sum of squared differences from the data, without the priors.
    """

    composite: CompositeModel
    features: FloatArray
    cost: float


@dataclass(frozen=True, eq=False)
class Linearisation:
    """Linear approximation of a composite model at its present values: predicted features f64[C, F, n] (C conditions, F
    features, n taxels) and derivatives.

    Fits to different subsets of the same data share one linearisation: their solutions are so close to the common start
    that the derivatives need not be updated.
    """

    composite: CompositeModel
    features: FloatArray
    columns: tuple[DerivativeColumn, ...]


def linearise(state: State, composite: CompositeModel, fixed: Sequence[str] = ()) -> Linearisation:
    """Linearise a composite model at its values, with respect to the parameters of all effects not named in `fixed`."""
    features = composite.predict_features(state)
    return Linearisation(
        composite, features, _compute_columns(state, composite, find_free_indices(composite, fixed), features)
    )


def compute_columns_by_effect(
    state: State, composite: CompositeModel, features: FloatArray, fixed: Sequence[str] = ()
) -> ColumnsByEffect:
    """Compute the derivatives of each effect of a composite model not named in `fixed`, by the name of the effect.

    A fit in which these effects hardly change can use these derivatives in all iterations. features: f64[C, F, n] (C
    conditions, F features, n taxels), prediction of the model.
    """
    free = find_free_indices(composite, fixed)
    found = map_in_processes(state, lambda index: _compute_columns(state, composite, [index], features), free)
    return {composite.fitted_effects[index].effect.name: columns for index, columns in zip(free, found, strict=True)}


def find_free_indices(composite: CompositeModel, fixed: Sequence[str]) -> list[int]:
    """Return the indices of the effects that are not named in `fixed`, in the order of the model."""
    return [
        index for index, fitted_effect in enumerate(composite.fitted_effects) if fitted_effect.effect.name not in fixed
    ]


def fit(
    problem: FitProblem,
    composite: CompositeModel,
    fixed: Sequence[str] = (),
    iterations: int = MAX_ITERATIONS,
    linearisation: Linearisation | None = None,
    fixed_columns: ColumnsByEffect = NO_COLUMNS,
) -> Fit:
    """Fit the parameters of all effects of a composite model except those named in `fixed`.

    Damped Gauss-Newton steps minimise the objective: the weighted squared difference between the model's features and
    the target, plus the cost of the parameters' priors. composite: model with the initial values. iterations: largest
    number of iterations. linearisation: linear approximation of this model, whose derivatives are used in all
    iterations. fixed_columns: derivatives of single effects, used in all iterations. Without effects to fit, the model
    is only evaluated.
    """
    problem = FitProblem(problem.state, np.where(problem.weight > 0, problem.target, 0.0), problem.weight)
    free = find_free_indices(composite, fixed)
    point = _Evaluation.evaluate(problem, composite, free, linearisation.features if linearisation else None)
    damping = LINEARISED_DAMPING if linearisation else INITIAL_DAMPING
    # last_step_helped: whether the last tried step lowered the objective. A failed step with outdated derivatives is
    # ignored.
    last_step_helped, gain = False, np.inf
    for iteration in range(iterations if free else 0):
        # A step with a small gain ends the iteration only if the derivatives cannot be improved.
        update_derivatives = iteration == 0 or (gain > DERIVATIVE_UPDATE_GAIN and not linearisation)
        has_best_derivatives = update_derivatives or linearisation is not None
        if update_derivatives:
            columns = (
                linearisation.columns
                if linearisation
                else _compute_columns(problem.state, point.composite, free, point.features, fixed_columns)
            )
            solver = DampedSolver(build_normal_matrix(problem, columns))
        gradient = _compute_full_gradient(problem, columns, point, free)
        previous, gain = point, 0.0
        # The first step is always tried, however small its expected gain: intervals of parameters follow from the
        # differences between fits to subsets of the data.
        if iteration == 0 or gradient @ solver.solve(gradient, damping) >= RELATIVE_TOLERANCE * point.objective:
            for _ in range(MAX_DAMPINGS if has_best_derivatives else 1):
                candidate = _Evaluation.evaluate(
                    problem, apply_step(point.composite, free, solver.solve(gradient, damping)), free
                )
                if candidate.objective < point.objective:
                    gain, point = 1.0 - candidate.objective / point.objective, candidate
                    break
                damping *= LINEARISED_DAMPING_FACTOR if linearisation else DAMPING_FACTOR
            last_step_helped = point is not previous or (not has_best_derivatives and last_step_helped)
            damping = damping if linearisation or point is previous else max(damping / 10.0, 1e-6)
        if gain < RELATIVE_TOLERANCE:
            if has_best_derivatives:
                break
            gain = np.inf
    if last_step_helped and point.prior > 0.0:
        # The return of a parameter that the data do not determine to its prior mean reduces the objective by less than
        # `RELATIVE_TOLERANCE`, so that the iteration above may end before it.
        gradient = _compute_full_gradient(problem, columns, point, free)
        final = _Evaluation.evaluate(
            problem, apply_step(point.composite, free, solver.solve(gradient, FINAL_DAMPING)), free
        )
        point = final if final.objective < point.objective else point
    return Fit(point.composite, point.features, point.cost)


@dataclass(frozen=True, eq=False)
class _Evaluation:
    """Point of the iteration: model, features f64[C, F, n] (C conditions, F features, n taxels), cost of the data, and
    cost of the priors.
    """

    composite: CompositeModel
    features: FloatArray
    cost: float
    prior: float

    @classmethod
    def evaluate(
        cls, problem: FitProblem, composite: CompositeModel, free: list[int], features: FloatArray | None = None
    ) -> _Evaluation:
        """Evaluate a composite model. free: indices of the fitted effects. features: prediction of the model if it is
        already known.
        """
        features = composite.predict_features(problem.state) if features is None else features
        return cls(composite, features, problem.cost(features), _compute_prior_cost(composite, free))

    @property
    def objective(self) -> float:
        """Objective of the minimisation: cost of the data plus cost of the priors."""
        return self.cost + self.prior


def _compute_full_gradient(
    problem: FitProblem, columns: Sequence[DerivativeColumn], point: _Evaluation, free: list[int]
) -> FloatArray:
    """Return the right side of the normal equations with the priors at a point, f64[p] (p free parameter values)."""
    return compute_gradient(problem, columns, point.features) + _compute_prior_gradient(point.composite, free)


def start_effect(state: State, effect: Effect) -> FittedEffect:
    """Return an effect with the start values of its parameters."""
    return FittedEffect(effect, effect.make_start_values(state))


def _compute_scale(parameter: Parameter, values: FloatArray) -> FloatArray:
    """Return a typical size of each value of a parameter, f64[G] (G blocks: the hand, boards, objects or taxels); the
    numeric step is proportional to it.

    The size is the absolute value, and at least 5 % of a span. The span is 10 times the largest of three values: the
    absolute start value, 0.02, and a tenth of the prior's standard deviation. The span is limited to the distance
    between the bounds.
    """
    expected = 0.1 * parameter.prior if np.isfinite(parameter.prior) else 0.0
    span = min(parameter.high - parameter.low, 10.0 * max(abs(parameter.start), 0.02, expected))
    return np.maximum(np.abs(values), 0.05 * span)


def _compute_columns(
    state: State,
    composite: CompositeModel,
    free: list[int],
    features: FloatArray,
    fixed_columns: ColumnsByEffect = NO_COLUMNS,
) -> tuple[DerivativeColumn, ...]:
    """Compute the derivatives of the features with respect to the parameters of the free effects, one column per
    parameter.

    free: indices of these effects. features: f64[C, F, n] (C conditions, F features, n taxels), prediction of the
    model. fixed_columns: derivatives by effect that are used instead of new ones.
    """
    columns: list[DerivativeColumn] = []
    for index in free:
        fitted_effect = composite.fitted_effects[index]
        if fitted_effect.effect.name in fixed_columns:
            columns += fixed_columns[fitted_effect.effect.name]
            continue
        blocks = fitted_effect.effect.find_blocks(state)
        for row, parameter in enumerate(fitted_effect.effect.parameters()):
            step = DERIVATIVE_STEP * _compute_scale(parameter, fitted_effect.values[row])
            step = np.where(fitted_effect.values[row] + step > parameter.high, -step, step)
            shifted_values = fitted_effect.values.copy()
            shifted_values[row] = shifted_values[row] + step
            values = [
                shifted_values if other == index else composite.fitted_effects[other].values
                for other in range(len(composite.fitted_effects))
            ]
            change = (
                np.nan_to_num(composite.with_values(values).predict_features(state) - features) / step[blocks][:, None]
            )
            precision = parameter.prior**-2 if np.isfinite(parameter.prior) else 0.0
            count = fitted_effect.values.shape[1]
            columns.append(DerivativeColumn(change, blocks, count, np.full(count, precision)))
    return tuple(columns)


def apply_step(composite: CompositeModel, free: list[int], step: FloatArray) -> CompositeModel:
    """Return a composite model whose free effects have changed by a step f64[p] (p parameter values), clipped to the
    bounds.

    free: indices of the effects that change.
    """
    fitted_effects = list(composite.fitted_effects)
    offset = 0
    for index in free:
        fitted_effect = fitted_effects[index]
        values = fitted_effect.values.copy()
        for row, parameter in enumerate(fitted_effect.effect.parameters()):
            count = values.shape[1]
            values[row] = np.clip(values[row] + step[offset : offset + count], parameter.low, parameter.high)
            offset += count
        fitted_effects[index] = FittedEffect(fitted_effect.effect, values)
    return CompositeModel(tuple(fitted_effects))


def _compute_prior_cost(composite: CompositeModel, free: list[int]) -> float:
    """Return the sum of the squared deviations of the free parameters from their prior means, in prior standard
    deviations.
    """
    total = 0.0
    for index in free:
        fitted_effect = composite.fitted_effects[index]
        for row, parameter in enumerate(fitted_effect.effect.parameters()):
            if np.isfinite(parameter.prior):
                total += float(np.sum((fitted_effect.values[row] - parameter.prior_mean) ** 2)) / parameter.prior**2
    return total


def _compute_prior_gradient(composite: CompositeModel, free: list[int]) -> FloatArray:
    """Return the contribution of the priors to the right side of the normal equations, f64[p] (p parameter values); 0
    for a value without prior.
    """
    contributions = []
    for fitted_effect in (composite.fitted_effects[index] for index in free):
        for row, parameter in enumerate(fitted_effect.effect.parameters()):
            precision = parameter.prior**-2 if np.isfinite(parameter.prior) else 0.0
            contributions.append(precision * (parameter.prior_mean - fitted_effect.values[row]))
    return np.concatenate(contributions)
