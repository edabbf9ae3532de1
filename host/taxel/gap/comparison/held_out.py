"""Prediction of each fold of the features, and of each session, by a fit that did not use this fold or session."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from taxel.gap.fitting.composite import CompositeModel
from taxel.gap.fitting.equations import FitProblem, build_normal_matrix, compute_gradient
from taxel.gap.fitting.fit import apply_step, find_free_indices, linearise
from taxel.gap.fitting.fit_data import FitData
from taxel.types import FloatArray

RIDGE: Final = 1e-6
"""Share of each diagonal element that is added to the normal equations (chosen), so that they remain solvable without a
fold. A larger value draws poorly determined parameters towards the full fit."""


@dataclass(frozen=True, eq=False)
class HeldOutPrediction:
    """Prediction of each fold of the features by a fit to the other folds.

    features: f64[C, F, n] (C conditions, F features, n taxels), counts. composites, session_composites: fits without
    each fold, and without each session; empty if no parameter is fitted. The latter are also empty with one session.
    """

    features: FloatArray
    composites: tuple[CompositeModel, ...] = ()
    session_composites: tuple[CompositeModel, ...] = ()


def predict_held_out(fit_data: FitData, composite: CompositeModel, fixed: tuple[str, ...]) -> HeldOutPrediction:
    """Predict every fold of the features by the fit to all other folds.

    The fit to all features is linearised. Without fold k the parameters change by (H - H_k + P)^-1 (g - g_k), one
    Gauss-Newton step: H and g are matrix and right side of the normal equations of all features, H_k and g_k those of
    the fold, and P is the precision of the priors. The features follow from the derivatives. A parameter that only the
    fold determines keeps its value, because the other folds do not contradict this value: a set with many such
    parameters gains held-out density, for which the calibration compensates by the number of parameters. The folds are
    `FitData.taxel_folds`. Without session s the parameters change by (H + P)^-1 J^T W (m_s - m): m is the mean of all
    sessions, m_s that of the other sessions. fixed: names of effects whose values are not fitted.
    """
    linearisation = linearise(fit_data.state, composite, fixed)
    if not linearisation.columns:
        return HeldOutPrediction(linearisation.features)
    precision = np.diag(np.concatenate([column.precision for column in linearisation.columns]))
    full_problem = fit_data.build_problem()
    system = build_normal_matrix(full_problem, linearisation.columns)
    gradient = compute_gradient(full_problem, linearisation.columns, linearisation.features)
    ridge = RIDGE * np.diag(system) + np.finfo(float).tiny
    features, free = linearisation.features.copy(), find_free_indices(composite, fixed)
    composites = []
    for fold in range(int(fit_data.taxel_folds.max()) + 1):
        is_held_out = fit_data.taxel_folds == fold
        fold_problem = fit_data.build_problem(is_held_out)
        remaining_system = system - build_normal_matrix(fold_problem, linearisation.columns) + precision
        remaining_system[np.diag_indices_from(remaining_system)] += ridge
        remaining_gradient = gradient - compute_gradient(fold_problem, linearisation.columns, linearisation.features)
        full_step = np.asarray(np.linalg.solve(remaining_system, remaining_gradient), np.float64)
        step = _limit_step(composite, fixed, full_step)
        change, offset = np.zeros_like(features), 0
        for column in linearisation.columns:
            change += column.change * step[offset : offset + column.count][column.blocks][:, None]
            offset += column.count
        np.moveaxis(features, 1, 2)[is_held_out] += np.moveaxis(change, 1, 2)[is_held_out]
        composites.append(apply_step(composite, free, step))
    session_system = system + np.diag(ridge)
    session_composites = []
    for target in fit_data.targets_without_session:
        problem = FitProblem(full_problem.state, target, full_problem.weight)
        change_of_gradient = compute_gradient(problem, linearisation.columns, full_problem.target)
        full_step = np.asarray(np.linalg.solve(session_system, change_of_gradient), np.float64)
        session_composites.append(apply_step(composite, free, _limit_step(composite, fixed, full_step)))
    return HeldOutPrediction(features, tuple(composites), tuple(session_composites))


def _limit_step(composite: CompositeModel, fixed: tuple[str, ...], step: FloatArray) -> FloatArray:
    """Return a step of the free parameters f64[p] (p parameter values) that is shortened so that every parameter stays
    within its bounds.

    fixed: names of effects whose values are not fitted and which have no entries in the step.
    """
    limited_step, offset = step.copy(), 0
    for fitted_effect in composite.fitted_effects:
        if fitted_effect.effect.name in fixed:
            continue
        for row, parameter in enumerate(fitted_effect.effect.parameters()):
            values = fitted_effect.values[row]
            rows = slice(offset, offset + len(values))
            limited_step[rows] = np.clip(values + step[rows], parameter.low, parameter.high) - values
            offset += len(values)
    return limited_step
