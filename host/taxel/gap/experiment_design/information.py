"""Fisher information of the recorded contacts on the parameters of a composite model, and of a further contact.

The model is linearised in the parameters about the fit. J is the derivative of the features with respect to the
parameters, W the diagonal matrix of the weights, 1 / counts^2. The information matrix is the precision of the prior
plus J'WJ over the recorded contacts. A further contact adds its own J'WJ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, lu_factor, lu_solve

from taxel.gap.data.pair import Pair
from taxel.gap.effects.catalogue import INSPECTED_EFFECTS
from taxel.gap.effects.effect import OBJECT, Effect
from taxel.gap.fitting.composite import CompositeModel
from taxel.gap.fitting.equations import DerivativeColumn, FitProblem, build_normal_matrix, compute_gradient
from taxel.gap.fitting.fit import linearise
from taxel.gap.fitting.fit_data import FitData
from taxel.gap.fitting.state import State
from taxel.types import FloatArray

MIN_VARIANCE_SHARE: Final = 1e-4
"""Information of a contact on a parameter value, times the variance of the value, below which the value is left out.

Chosen: a product of 1e-4 reduces the variance by 0.01 %, which is negligible, and the matrices become smaller.
"""


@dataclass(frozen=True, eq=False)
class AddedInformation:
    """Information of one further contact on the q parameter values that the contact excites.

    Attributes:
        information: information of the recorded contacts.
        value_indices: [q], indices of these values among the p parameter values of `information`.
        weight: f64[F, n] (F features, n taxels), weights of the features of the contact, 1 / counts^2.
        columns: derivatives of the features of the contact; the blocks are numbered within the q values.
    """

    information: CompositeInformation
    value_indices: NDArray[np.intp]
    weight: FloatArray
    columns: tuple[DerivativeColumn, ...]

    @cached_property
    def prior_covariance(self) -> FloatArray:
        """Covariance of the q values after the recorded contacts, f64[q, q]."""
        return self.information.covariance[np.ix_(self.value_indices, self.value_indices)]

    @cached_property
    def matrix(self) -> FloatArray:
        """Information matrix N = J'WJ of the further contact on the q parameter values that it excites, f64[q, q].

        J contains the derivatives of the features by the values, and W the weights of the features.
        """
        if not self.columns:
            return np.zeros((0, 0))
        return build_normal_matrix(self._build_problem(np.zeros_like(self.weight)), self.columns)

    def compute_gradient(self, difference: FloatArray) -> FloatArray:
        """Return J'Wd, f64[q], of a difference d of the features, f64[F, n] (F features, n taxels), in counts."""
        return compute_gradient(self._build_problem(difference), self.columns, np.zeros((1, *difference.shape)))

    def _build_problem(self, target: FloatArray) -> FitProblem:
        """Return the least-squares problem of the further contact alone. target: f64[F, n] (F features, n taxels),
        counts.
        """
        return FitProblem(self.information.fit_data.state, target[None], self.weight[None])

    @cached_property
    def _factors(self) -> tuple[FloatArray, NDArray[np.int32]]:
        """LU factors of 1 + N C, with the information N of the contact and the prior covariance C, for `solve`."""
        return lu_factor(np.eye(len(self.value_indices)) + self.matrix @ self.prior_covariance, check_finite=False)

    def solve(self, right: FloatArray) -> FloatArray:
        """Return (N^-1 + C)^-1 times `right`, f64[q, ...].

        N is the information `matrix` of the further contact, and C the covariance of the q values after the recorded
        contacts. The Woodbury identity avoids the inverse of N, which can be singular.
        """
        if not len(self.value_indices):
            return np.zeros_like(right)
        return np.asarray(lu_solve(self._factors, self.matrix @ right, check_finite=False))


@dataclass(frozen=True, eq=False)
class CompositeInformation:
    """Information of the recorded contacts on the p free parameter values of a composite model.

    Attributes:
        composite: the model with fitted values. The values of effects that are found by inspection are not free.
        features: f64[C, F, n] (C conditions, F features, n taxels), predicted features, counts.
        columns: derivatives of the features, one column for each parameter. The precision of a column is the sum of the
            precisions of the prior and of a uniform distribution between the bounds.
        covariance: f64[p, p], covariance of the values, over all blocks of all parameters in the order of `columns`.
    """

    fit_data: FitData
    composite: CompositeModel
    features: FloatArray
    columns: tuple[DerivativeColumn, ...]
    covariance: FloatArray

    @classmethod
    def compute(cls, fit_data: FitData, composite: CompositeModel) -> CompositeInformation:
        """Compute the information of the recorded contacts on the free parameter values of a composite model.

        The model is linearised at its fitted values. Free are the parameters of all effects except `INSPECTED_EFFECTS`.
        The covariance is the inverse of the information matrix: J'WJ of the recorded contacts, plus the precisions of
        the priors, plus for each value the precision of a uniform distribution between the bounds of its parameter. For
        a model without free parameters, `columns` is empty and `covariance` has the shape f64[0, 0].
        """
        start = linearise(fit_data.state, composite, INSPECTED_EFFECTS)
        columns = tuple(_add_bound_precision(start.columns, composite))
        if not columns:
            return cls(fit_data, composite, start.features, (), np.zeros((0, 0)))
        problem = FitProblem(fit_data.state, start.features, fit_data.weight)
        return cls(fit_data, composite, start.features, columns, _invert(build_normal_matrix(problem, columns)))

    def compute_remaining(self, difference: FloatArray) -> RemainingDifference:
        """Return the part of a difference of features, f64[C, F, n] (C conditions, F features, n taxels), that remains
        after the free parameter values of this model have changed such that the weighted difference is smallest.

        The difference refers to the recorded contacts.
        """
        weight = self.fit_data.weight
        squared_length = float(np.sum(weight * difference**2))
        if not self.columns:
            return RemainingDifference(self, np.zeros(0), squared_length)
        problem = FitProblem(self.fit_data.state, difference, weight)
        return RemainingDifference(
            self, compute_gradient(problem, self.columns, np.zeros_like(difference)), squared_length
        )

    def compute_variance_after(self, added: AddedInformation) -> FloatArray:
        """Return the variances of all values after a further contact, f64[p] (p parameter values)."""
        excited = self.covariance[added.value_indices]
        return np.asarray(np.diag(self.covariance) - np.sum(excited * added.solve(excited), axis=0))


@dataclass(frozen=True, eq=False)
class RemainingDifference:
    """Difference d of the features of two models, reduced by the adaptation of the values of one of these models.

    Attributes:
        information: information of the recorded contacts on the values that adapt.
        gradient: f64[p] (p parameter values), J'Wd on the recorded contacts.
        unadapted_squared_length: d'Wd on the recorded contacts, before the adaptation.
    """

    information: CompositeInformation
    gradient: FloatArray
    unadapted_squared_length: float

    @cached_property
    def _adaptation(self) -> FloatArray:
        """Change of the p values that reduces the difference most, f64[p]."""
        return np.asarray(self.information.covariance @ self.gradient)

    @property
    def squared_length(self) -> float:
        """Squared length of the remaining difference on the recorded contacts, in units of the variance."""
        return max(self.unadapted_squared_length - float(self.gradient @ self._adaptation), 0.0)

    def compute_squared_length_after(self, added: AddedInformation, difference: FloatArray) -> float:
        """Return the squared length of the remaining difference with one further contact, in units of the variance.

        difference: f64[F, n] (F features, n taxels), difference of the features of the two models in the further
        contact, counts. This is the criterion T of Atkinson and Fedorov (1975), linearised about the fit.
        """
        # The values adapt to the differences on all contacts. `explained` is the reduction of the squared length if
        # only the recorded contacts limit the adaptation; the term of `solve` adds the limit by the further contact.
        index, added_gradient = added.value_indices, added.compute_gradient(difference)
        adaptation = self._adaptation[index] + added.prior_covariance @ added_gradient
        explained = float(self.gradient @ self._adaptation + added_gradient @ (self._adaptation[index] + adaptation))
        squared_length = self.unadapted_squared_length + float(np.sum(added.weight * difference**2))
        return max(squared_length - explained + float(adaptation @ added.solve(adaptation)), 0.0)


@dataclass(frozen=True, eq=False)
class CandidatePrediction:
    """Prediction of a composite model for candidate contacts.

    Attributes:
        information: information of the recorded contacts on the p values of the model.
        features: f64[C, F, n] (C conditions, F features, n taxels), predicted features of the candidate contacts,
            counts.
        columns: derivatives of these features, one column for each parameter.
        value_indices: for each column, [blocks], index of each block among the p values; -1 for a block without a
            recorded contact.
    """

    information: CompositeInformation
    features: FloatArray
    columns: tuple[DerivativeColumn, ...]
    value_indices: tuple[NDArray[np.intp], ...]

    @classmethod
    def compute(cls, information: CompositeInformation, state: State) -> CandidatePrediction:
        """Predict the contacts of a state of the same hand. Objects without a recorded contact get neutral values."""
        old_pair = information.fit_data.state.pair
        composite = transfer_values(information.composite, old_pair, state)
        start = linearise(state, composite, INSPECTED_EFFECTS)
        value_indices, first = [], 0
        effects = [fitted.effect for fitted in composite.fitted_effects if fitted.effect.name not in INSPECTED_EFFECTS]
        owners = [effect for effect in effects for _ in effect.parameters()]
        for effect, column in zip(owners, information.columns, strict=True):
            block = map_blocks(effect, old_pair, state.pair)
            value_indices.append(np.where(block >= 0, first + block, -1))
            first += column.count
        return cls(information, start.features, start.columns, tuple(value_indices))

    def compute_added(self, contact: int, weight: FloatArray) -> AddedInformation:
        """Return the information that the candidate with the index `contact` adds.

        weight: f64[C, F, n] (C conditions, F features, n taxels), weights of the features of all candidates, 1 /
        counts^2. Values on which the contact has hardly any information (`MIN_VARIANCE_SHARE`) are omitted from the
        result.
        """
        contact_weight, variance = weight[contact], np.diag(self.information.covariance)
        indices: list[NDArray[np.intp]] = []
        columns = []
        for column, number in zip(self.columns, self.value_indices, strict=True):
            blocks = column.blocks[contact]
            # Information of the contact on each value of the parameter.
            excited = np.bincount(blocks, np.sum(contact_weight * column.change[contact] ** 2, axis=0), column.count)
            active = np.flatnonzero((number >= 0) & (excited * variance[np.maximum(number, 0)] > MIN_VARIANCE_SHARE))
            if not len(active):
                continue
            new_number = np.full(column.count, -1)
            new_number[active] = np.arange(len(active))
            new_blocks = new_number[blocks]
            change = np.where(new_blocks >= 0, column.change[contact], 0.0)[None]
            columns.append(
                DerivativeColumn(change, np.maximum(new_blocks, 0)[None], len(active), np.zeros(len(active)))
            )
            indices.append(number[active])
        value_indices = np.concatenate(indices) if indices else np.zeros(0, np.intp)
        return AddedInformation(self.information, value_indices, contact_weight, tuple(columns))


def transfer_values(composite: CompositeModel, old_pair: Pair, state: State) -> CompositeModel:
    """Return the composite model with its values assigned to the blocks of another state.

    old_pair: pair to whose blocks the values of the model belong. Blocks that this pair lacks get neutral values.
    """
    values = []
    for fitted in composite.fitted_effects:
        new_values = fitted.values
        if fitted.effect.scope == OBJECT:
            index = map_blocks(fitted.effect, old_pair, state.pair)
            new_values = fitted.effect.make_neutral_values(state)
            new_values[:, index >= 0] = fitted.values[:, index[index >= 0]]
        values.append(new_values)
    return composite.with_values(values)


def map_blocks(effect: Effect, old_pair: Pair, new_pair: Pair) -> NDArray[np.intp]:
    """Return for each block of an effect in `new_pair` the index of the same block in `old_pair`, [blocks].

    The index is -1 for an object that `old_pair` lacks. Blocks other than objects have equal indices in both pairs.
    """
    if effect.scope != OBJECT:
        return np.arange(int(effect.find_blocks_of_pair(new_pair).max()) + 1)
    object_names = [pair.object_names for pair in (old_pair, new_pair)]
    return np.array(
        [object_names[0].index(name) if name in object_names[0] else -1 for name in object_names[1]], dtype=np.intp
    )


def _add_bound_precision(columns: Sequence[DerivativeColumn], composite: CompositeModel) -> list[DerivativeColumn]:
    """Return the columns with the precision of a uniform distribution between the bounds added to the prior precision.

    The variance of a uniform distribution is the squared width divided by 12.
    """
    free = [fitted for fitted in composite.fitted_effects if fitted.effect.name not in INSPECTED_EFFECTS]
    parameters = [parameter for fitted in free for parameter in fitted.effect.parameters()]
    return [
        replace(column, precision=column.precision + 12.0 / (parameter.high - parameter.low) ** 2)
        for column, parameter in zip(columns, parameters, strict=True)
    ]


def _invert(system: FloatArray) -> FloatArray:
    """Return the inverse of a positive definite matrix, f64[p, p] (p parameter values).

    The matrix is scaled to a unit diagonal, because the parameters have different units; a ridge of 1e-9 keeps the
    factorisation defined if two parameters have the same derivatives.
    """
    scale = 1.0 / np.sqrt(np.diag(system))
    scaled = system * np.outer(scale, scale)
    scaled[np.diag_indices_from(scaled)] += 1e-9
    inverse = cho_solve(cho_factor(scaled, check_finite=False), np.eye(len(scaled)))
    return np.asarray(inverse * np.outer(scale, scale))
