"""Identifiability of effects from the recorded contacts, by the sensitivities of the simulation alone.

The change of the features by an effect is a vector v. The norm of v weights each feature by 1 / variance, so that
lengths are numbers of standard deviations. The derivatives of the features with respect to the parameters of another
effect span a subspace; the nuisance parameters (delay between the frames of the two recordings) belong to this
subspace. Two effects are distinguishable on these contacts if the angle between v and the subspace, and the squared
length of the residual of v after projection onto the subspace, are large enough.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dpstrf

from taxel.gap.effects.catalogue import UNSEARCHED_FORMS
from taxel.gap.effects.effect import Effect
from taxel.gap.effects.latency import Latency
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.equations import DerivativeColumn, FitProblem, build_normal_matrix, compute_gradient
from taxel.gap.fitting.fit import fit, linearise, start_effect
from taxel.gap.fitting.fit_data import REFIT_ITERATIONS, FitData
from taxel.gap.fitting.parallel import map_in_processes, map_in_threads
from taxel.types import FloatArray

EXCITED_LENGTH2: Final = 1.0
"""Squared length of the change by an effect below which the contacts do not excite the effect: one standard deviation
(chosen)."""

DISTINCT_LENGTH2: Final = 25.0
"""Squared length from which an effect is identifiable, and squared length of a residual from which two effects are
distinguishable: five standard deviations (chosen)."""

REFIT_ANGLE_DEG: Final = 40.0
"""Angle below which the linear result is checked by a nonlinear fit of the other effect (chosen)."""

MIN_PIVOT: Final = 1e-7
"""Pivot of the Cholesky factorisation of the scaled matrix below which a column depends on the others (chosen)."""

CONFOUNDED_ANGLE_DEG: Final = 8.0
"""Angle (cosine 0.99) below which two effects are confounded, however large they are (chosen): two models of the same
contact differ by more."""


@dataclass(frozen=True)
class Similarity:
    """Similarity of two effects: how well effect `other` reproduces the change of the features by effect `name`.

    angle_deg: angle between this change and the subspace of the other effect, degrees. residual2: squared length of the
    residual of the change, in standard deviations squared.
    """

    name: str
    other: str
    angle_deg: float
    residual2: float

    @property
    def is_confounded(self) -> bool:
        """True if the two effects are not distinguishable on these contacts."""
        return _is_indistinguishable(self.residual2, self.angle_deg)

    def to_json(self) -> dict[str, Any]:
        """Return the entry of the report."""
        return {"effect": self.name, "other": self.other, "degrees": self.angle_deg, "left": self.residual2}


def classify_identifiability(
    name: str,
    fit_data: FitData,
    forms: Mapping[str, Sequence[Effect]],
    similarities: Sequence[Similarity],
    confounded: Mapping[str, Sequence[str]],
) -> str:
    """Classify how well these contacts determine an effect, whether or not the effect is present.

    forms: for each effect of the catalogue, the variants of its model (forms). similarities: from
    `compute_similarities`. confounded: for each named effect, the effects that are confounded with it. Returns
    "identifiable", "weak", "confounded", "not_excited" or "unavailable", as in the report.
    """
    # A dropout has no forms, because it is not fitted: an inspection finds it on every taxel with an expected signal.
    if not forms[name]:
        return "identifiable"
    possible = [form for form in forms[name] if not form.find_unavailable_reason(fit_data.state)]
    if not possible:
        return "unavailable"
    largest_length2 = max(compute_typical_length2(fit_data, form) for form in possible)
    if largest_length2 < EXCITED_LENGTH2:
        return "not_excited"
    if name in confounded or any(name in others for others in confounded.values()):
        return "confounded"
    if any(one.name == name and one.is_confounded for one in similarities):
        return "confounded"
    return "weak" if largest_length2 < DISTINCT_LENGTH2 else "identifiable"


def compute_typical_length2(fit_data: FitData, effect: Effect) -> float:
    """Compute how much an effect with typical parameter values changes the features.

    The result is the squared norm of the change, in which each feature has the weight 1 / variance. Its unit is
    standard deviations squared.
    """
    return _compute_length2(fit_data, _compute_typical_change(fit_data, effect))


def compute_similarities(
    fit_data: FitData, forms: Mapping[str, Sequence[Effect]], named_effects: Sequence[FittedEffect] = ()
) -> list[Similarity]:
    """Compute the similarity of every effect to every other available effect; effects that are not excited are omitted.

    An effect is excited if its change of the features has a squared length of at least `EXCITED_LENGTH2`. Its
    similarity to another effect is the angle between this change and the subspace of the changes by the other effect.
    If this angle is small for a named effect, nonlinear fits of all forms of the other effect check the result.

    forms: for each effect of the catalogue, the variants of its model (forms). named_effects: effects of the verdict,
    with their fitted values; all other effects have typical values, in the form with the largest change.
    """
    state = fit_data.state
    available_forms = {
        name: [
            form for form in (*effect_forms, *UNSEARCHED_FORMS.get(name, ())) if not form.find_unavailable_reason(state)
        ]
        for name, effect_forms in forms.items()
    }
    # A common time shift belongs to every subspace: a difference that it reproduces does not distinguish two effects.
    nuisance_columns = linearise(state, CompositeModel((start_effect(state, Latency("hand")),))).columns
    subspaces_of_forms = map_in_threads(
        state,
        lambda effect_forms: [
            Subspace(
                fit_data,
                [*nuisance_columns, *linearise(state, CompositeModel((_make_typical_effect(fit_data, form),))).columns],
            )
            for form in effect_forms
        ],
        available_forms.values(),
    )
    subspaces = dict(zip(available_forms, subspaces_of_forms, strict=True))
    named_effect_by_name = {fitted_effect.effect.name: fitted_effect for fitted_effect in named_effects}

    def compute_similarities_of(name: str) -> list[Similarity]:
        """Return the similarities of the effect `name` to all other effects; an empty list if the contacts do not
        excite it.
        """
        typical_changes = [_compute_typical_change(fit_data, form) for form in available_forms[name]]
        change = (
            _compute_change(fit_data, named_effect_by_name[name])
            if name in named_effect_by_name
            else max(typical_changes, key=lambda v: _compute_length2(fit_data, v))
        )
        length2 = _compute_length2(fit_data, change)
        if length2 < EXCITED_LENGTH2:
            return []
        similarities = []
        for other, form_subspaces in subspaces.items():
            if other == name or not form_subspaces:
                continue
            residual2 = min(space.compute_residual2(change) for space in form_subspaces)
            if name in named_effect_by_name and _compute_angle_deg(residual2, length2) < REFIT_ANGLE_DEG:
                residual2 = min(residual2, *(_fit_residual2(fit_data, change, form) for form in available_forms[other]))
            similarities.append(Similarity(name, other, _compute_angle_deg(residual2, length2), residual2))
        return similarities

    available_names = [name for name, effect_forms in available_forms.items() if effect_forms]
    by_effect = map_in_processes(state, compute_similarities_of, available_names)
    return [similarity for similarities in by_effect for similarity in similarities]


def _is_indistinguishable(residual2: float, angle_deg: float) -> bool:
    """Return whether an effect is not distinguishable from another effect that reproduces its change of the features.

    residual2: squared length of the part that the other effect does not reproduce, in standard deviations squared.
    angle_deg: angle between the change and the subspace of the other effect.
    """
    return residual2 < DISTINCT_LENGTH2 or angle_deg < CONFOUNDED_ANGLE_DEG


def _compute_angle_deg(residual2: float, length2: float) -> float:
    return float(np.degrees(np.arcsin(np.sqrt(np.clip(residual2 / length2, 0.0, 1.0)))))


def _make_typical_effect(fit_data: FitData, form: Effect) -> FittedEffect:
    return FittedEffect(form, form.make_typical_values(fit_data.state))


def _compute_typical_change(fit_data: FitData, form: Effect) -> FloatArray:
    return _compute_change(fit_data, _make_typical_effect(fit_data, form))


def _compute_change(fit_data: FitData, fitted_effect: FittedEffect) -> FloatArray:
    return np.nan_to_num(CompositeModel((fitted_effect,)).predict_features(fit_data.state) - fit_data.state.mean)


def _compute_length2(fit_data: FitData, change: FloatArray) -> float:
    return float(np.sum(fit_data.weight * change**2))


class Subspace:
    """Subspace of changes of the features that is spanned by derivative columns, in the weighted norm of the fit data.

    Priors are ignored: the subspace contains every possible change, regardless of its probability.
    """

    def __init__(self, fit_data: FitData, columns: Sequence[DerivativeColumn]) -> None:
        """Prepare projections onto the subspace by a pivoted Cholesky factorisation of the columns' Gram matrix.

        Linearly dependent columns are omitted.
        """
        self._fit_data = fit_data
        # A prior precision of 0 removes the priors, so that the system below is the Gram matrix alone.
        self._columns = [replace(one, precision=0.0 * one.precision) for one in columns]
        system = build_normal_matrix(FitProblem(fit_data.state, fit_data.state.mean, fit_data.weight), self._columns)
        self._scale = np.sqrt(np.maximum(np.diag(system), 1e-300))
        factor, order, rank, _ = dpstrf(system / np.outer(self._scale, self._scale), tol=MIN_PIVOT, lower=1)
        self._factor, self._independent = factor[:rank, :rank], order[:rank] - 1  # LAPACK numbers from 1

    def compute_residual2(self, change: FloatArray) -> float:
        """Compute the squared length of the residual of a change f64[C, F, n] (C conditions, F features, n taxels)
        after projection onto the subspace, in standard deviations squared.
        """
        problem = FitProblem(self._fit_data.state, change, self._fit_data.weight)
        gradient = compute_gradient(problem, self._columns, np.zeros_like(change)) / self._scale
        # With the Gram matrix L L^T and the products g of columns and change, the projection has the length |L^-1 g|.
        projection = solve_triangular(self._factor, gradient[self._independent], lower=True, check_finite=False)
        return max(_compute_length2(self._fit_data, change) - float(projection @ projection), 0.0)


def _fit_residual2(fit_data: FitData, change: FloatArray, form: Effect) -> float:
    """Return the squared length of the part of a change f64[C, F, n] (C conditions, F features, n taxels) that an
    effect does not reproduce after a nonlinear fit, in standard deviations squared.
    """
    problem = FitProblem(fit_data.state, fit_data.state.mean + change, fit_data.weight)
    return fit(problem, CompositeModel((start_effect(fit_data.state, form),)), iterations=2 * REFIT_ITERATIONS).cost
