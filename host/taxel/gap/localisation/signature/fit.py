"""Part of a residual that a distortion explains, on conditions that were not used to fit its coefficients.

The residual of each session is fitted separately, without the conditions of the fold that is predicted. The explained
part is the mean over pairs of different sessions of the product of their residuals minus the product of what their fits
leave. Neither the variance between sessions nor the number of coefficients increases it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from taxel.gap.data.pair import Pair
from taxel.gap.features.distributions import compute_student_survival
from taxel.gap.features.features import FeatureLayout, SessionMeans
from taxel.gap.features.metric import compute_jackknife_interval, compute_off_diagonal_mean, make_leave_one_out_masks
from taxel.gap.localisation.signature.distortions import HAND, Distortion, get_groups
from taxel.types import FloatArray

RIDGE: Final = 0.03
"""Ridge penalty of the held-out fits, relative to the mean over the groups of taxels of a column's sum of squares.
Chosen: a column with hardly any signal in a group gets a coefficient near 0 in this group."""

MIN_SHARED_ENERGY: Final = 0.05
"""Smallest `Remainder.shared_energy` of two sessions whose product is used. Chosen: below it the few common data are
replaced by the mean product of the other pairs of sessions."""

REPORTED_RIDGE: Final = 0.001
"""Ridge penalty of the reported coefficients, relative like `RIDGE`. Chosen smaller than `RIDGE`, because shrinkage
would bias the reported values towards 0."""


@dataclass(frozen=True, eq=False)
class DistortionFit:
    """A distortion that was fitted with one set of K coefficients for each of G groups of taxels.

    name: name of the distortion. scope: kind of the groups, see `get_groups`. explained_by_taxel: f64[n] (n taxels),
    explained excess of each taxel, counts^2. explained: f64[S, S], explained part of the product of the residuals of
    each pair of sessions, counts^2. coefficients: f64[G, K], fitted to all conditions and sessions.
    """

    name: str
    scope: str
    explained_by_taxel: FloatArray
    explained: FloatArray
    coefficients: FloatArray

    @property
    def coefficient_count(self) -> int:
        """Number of fitted coefficients, G times K."""
        return self.coefficients.size


@dataclass(frozen=True, eq=False)
class Remainder:
    """Residuals of the real sessions: measured features minus the features that the best set of effects predicts.

    pair: both datasets. residual: f64[C, S, F, n] (C conditions, F features, n taxels), counts; 0 where unknown. known:
    bool[C, S, F, n], which residuals are known. root_weight: f64[F, 1], square roots of the weights of squared
    residuals in the squared gap. fold: [C], fold of the cross-validation to which each condition belongs.
    shared_energy: f64[S, S], share of the sum of squared predicted signals that lies in taxels and conditions for which
    both of two sessions have data.
    """

    pair: Pair
    residual: FloatArray
    known: NDArray[np.bool_]
    root_weight: FloatArray
    fold: NDArray[np.intp]
    shared_energy: FloatArray

    @classmethod
    def compute(
        cls, pair: Pair, real: SessionMeans, model: FloatArray, layout: FeatureLayout, fold: NDArray[np.intp]
    ) -> Remainder:
        """Compute the residuals of real sessions from predicted features.

        model: f64[C, F, n] (C conditions, F features, n taxels), predicted features, counts; NaN where unknown. layout:
        order and weights of the features. fold: [C], fold of each condition. The shared energy of two sessions is the
        share of the squared predicted signals on taxels and conditions for which both sessions have data.
        """
        residual = real.compute_residual(model)
        known = real.is_known & np.isfinite(residual)
        root_weight = np.sqrt(layout.compute_scale(model.shape[0], model.shape[2]))
        has_signal = known[:, :, : layout.bins].any(axis=2)
        energy = np.nan_to_num(model[:, : layout.bins] ** 2).sum(axis=1) + 1e-9
        shared_energy = np.einsum("csn,ctn,cn->st", has_signal, has_signal, energy, optimize=True) / energy.sum()
        return cls(pair, np.where(known, residual, 0.0), known, root_weight, fold, shared_energy)

    def complete_products(self, gram: FloatArray) -> FloatArray:
        """Scale products of pairs of sessions, f64[S, S], to the values that sessions without missing data would have.

        Two sessions with a shared energy of at most `MIN_SHARED_ENERGY` get the mean of the other products. If no two
        sessions share more, all products are 0.
        """
        is_shared = self.shared_energy > MIN_SHARED_ENERGY
        if not is_shared.any():
            return np.zeros_like(gram)
        full = gram / np.where(is_shared, self.shared_energy, 1.0)
        return np.asarray(np.where(is_shared, full, full[is_shared].mean()))

    @property
    def gram(self) -> FloatArray:
        """Weighted products of the residuals of each pair of sessions, counts^2, f64[S, S]."""
        scaled = self.residual * self.root_weight
        return self.complete_products(np.einsum("csfn,ctfn->st", scaled, scaled, optimize=True))


@dataclass(frozen=True, eq=False)
class _NormalEquations:
    """Normal equations of a distortion for each condition and taxel.

    normal: f64[C, n, K, K] (C conditions, n taxels), products of the K columns. right: f64[C, S, n, K], products of the
    columns and the residual of each session. has_data: bool[C, S, n], whether a session has a feature of the
    distortion. column_norm: f64[K], norms by which the columns were divided.
    """

    normal: FloatArray
    right: FloatArray
    has_data: NDArray[np.bool_]
    column_norm: FloatArray


def fit_distortion(remainder: Remainder, distortion: Distortion) -> list[DistortionFit]:
    """Fit a distortion once for each of its scopes (kinds of groups of taxels that share coefficients).

    If all conditions are in one fold, only one set of coefficients for the whole hand is fitted, because coefficients
    of smaller groups need a further condition for their held-out prediction. The list can then be empty.
    """
    equations = _build_normal_equations(remainder, distortion)
    has_one_fold = len(np.unique(remainder.fold)) < 2
    return [
        _fit_in_scope(remainder, equations, distortion, scope)
        for scope in distortion.scopes
        if not has_one_fold or scope == HAND
    ]


def compute_p_value(gram: FloatArray) -> float | None:
    """Test whether the mean product of the residuals of two different sessions is above 0: return the p-value.

    gram: f64[S, S], products of the residuals of each pair of S sessions. The test is a one-sided t test with the
    standard error of the jackknife over sessions. Below 3 sessions the result is None.
    """
    whole = float(compute_off_diagonal_mean(gram))
    replicates = [
        float(compute_off_diagonal_mean(gram[np.ix_(stay, stay)])) for stay in make_leave_one_out_masks(len(gram))
    ]
    return compute_t_p_value(whole, compute_jackknife_interval(np.array(replicates), whole).error, len(gram))


def compute_t_p_value(value: float, error: float | None, sessions: int) -> float | None:
    """Return the one-sided p-value of a value against 0 by Student's t with sessions - 1 degrees of freedom.

    error: standard error of the value. None: the result is None. 0: the result is 0 for a positive value, otherwise 1.
    """
    if error is None:
        return None
    if error <= 0:
        return 1.0 if value <= 0 else 0.0
    return compute_student_survival(value / error, sessions - 1)


def _build_normal_equations(remainder: Remainder, distortion: Distortion) -> _NormalEquations:
    """Return the normal equations of a weighted least-squares fit of a distortion, for each condition and taxel.

    Dimensions in the comments: C conditions, S sessions, n taxels, P features that the distortion changes, K columns.
    Each column is scaled to the norm 1 over all conditions and taxels.
    """
    root_weight = remainder.root_weight[distortion.features, 0]
    known = remainder.known[:, :, distortion.features]
    is_known_once: NDArray[np.bool_] = np.asarray(known.any(axis=1))
    columns = np.where(
        np.moveaxis(is_known_once, 1, 2)[..., None], distortion.columns * root_weight[:, None], 0.0
    )  # [C, n, P, K]
    column_norm = np.sqrt(np.einsum("cnpk,cnpk->k", columns, columns))
    column_norm[column_norm <= 0] = 1.0
    columns /= column_norm
    transposed = np.swapaxes(columns, 2, 3)
    scaled = remainder.residual[:, :, distortion.features] * root_weight[:, None]
    residual = np.transpose(scaled, (0, 3, 2, 1))  # [C, n, P, S]
    right = np.moveaxis(np.matmul(transposed, residual), 3, 1)
    return _NormalEquations(np.matmul(transposed, columns), right, np.asarray(known.any(axis=2)), column_norm)


def _fit_in_scope(
    remainder: Remainder, equations: _NormalEquations, distortion: Distortion, scope: str
) -> DistortionFit:
    """Fit the coefficients of each group of taxels, and return them with the part of the residuals that they explain.

    scope: kind of the groups, see `get_groups`. The explained part uses coefficients that are fitted for each session
    and fold without the conditions of the fold; with a single fold they are fitted to all conditions.
    """
    group = get_groups(remainder.pair, scope)
    count = int(group.max()) + 1
    belongs = csr_array((np.ones(len(group)), (group, np.arange(len(group)))))
    right = _sum_groups(belongs, equations.right, 2)
    # The normal equations of a session contain only the taxels of which the session has data. As a rule all sessions
    # have data of all taxels; one inverse then serves all sessions.
    if equations.has_data.all():
        normal = _sum_groups(belongs, equations.normal, 1)[:, None]
    else:
        has_data = equations.has_data
        weighted = (equations.normal * has_data[:, s, :, None, None] for s in range(has_data.shape[1]))
        normal = np.stack([_sum_groups(belongs, one, 1) for one in weighted], axis=1)
    normal_sum, right_sum = normal.sum(axis=0), right.sum(axis=0)
    # The columns have the norm 1 over all groups; a column's mean sum of squares in a group is therefore 1 / count.
    ridge = np.eye(normal.shape[-1]) * RIDGE / count
    fitted = np.empty(right.shape)
    for fold in np.unique(remainder.fold):
        in_fold = remainder.fold == fold
        left_out = in_fold & (not in_fold.all())  # a single fold is fitted in-sample
        inverse = np.linalg.inv(normal_sum - normal[left_out].sum(axis=0) + ridge)
        fitted[in_fold] = np.matmul(inverse, (right_sum - right[left_out].sum(axis=0))[..., None])[..., 0]
    # The reported coefficients are fitted to all conditions and to the mean of the sessions, with a smaller ridge.
    coefficients = np.matmul(
        np.linalg.inv(normal_sum.mean(axis=0) + ridge * (REPORTED_RIDGE / RIDGE)), right_sum.mean(axis=0)[..., None]
    )[..., 0]
    fitted_by_taxel = fitted[:, :, group] * equations.has_data[..., None]
    gram = _compute_explained_products(equations, fitted_by_taxel)
    return DistortionFit(
        distortion.name,
        scope,
        compute_off_diagonal_mean(gram),
        remainder.complete_products(gram.sum(axis=0)),
        coefficients / equations.column_norm,
    )


def _compute_explained_products(equations: _NormalEquations, fitted: FloatArray) -> FloatArray:
    """Return for each taxel the explained part of the products of the residuals of two sessions, counts^2, f64[n, S, S]
    (n taxels).

    It is the product of the residuals before the fit minus the product of the residuals after the fit. fitted: f64[C,
    S, n, K] (C conditions, K columns), held-out coefficients of each taxel.
    """

    def order_by_taxel(values: FloatArray) -> FloatArray:
        """Reorder values f64[C, S, n, K] (C conditions, S sessions, n taxels, K columns) to f64[n, S, C K]."""
        conditions, sessions, taxels, columns = values.shape
        return np.transpose(values, (2, 1, 0, 3)).reshape(taxels, sessions, conditions * columns)

    predicted = np.moveaxis(np.matmul(equations.normal, np.moveaxis(fitted, 1, 3)), 3, 1)
    transposed = np.swapaxes(order_by_taxel(fitted), 1, 2)
    cross = np.matmul(order_by_taxel(equations.right), transposed)
    return np.asarray(cross + np.swapaxes(cross, 1, 2) - np.matmul(order_by_taxel(predicted), transposed))


def _sum_groups(belongs: csr_array, values: FloatArray, axis: int) -> FloatArray:
    """Return the sums of values over the taxels of each of G groups.

    belongs: [G, n] (n taxels), 1 for the taxels of a group. axis: axis of `values` that has length n, and length G in
    the result. If each taxel is a group of its own, `values` itself is returned.
    """
    count, taxels = belongs.shape
    if count == taxels and bool((belongs.indices == np.arange(taxels)).all()):
        return values
    if count == 1:
        return np.asarray(values.sum(axis=axis, keepdims=True))
    first = np.moveaxis(values, axis, 0)
    sums = (belongs @ first.reshape(len(first), -1)).reshape(-1, *first.shape[1:])
    return np.asarray(np.moveaxis(sums, 0, axis))
