"""Refits that reuse the derivatives of their start, and projections on the subspace of an effect."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.gap.data.pair import read_pair
from taxel.gap.data.prepare import prepare_pair
from taxel.gap.effects.catalogue import OWN_EFFECTS
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.equations import DerivativeColumn, FitProblem, build_normal_matrix
from taxel.gap.fitting.fit import fit, linearise, start_effect
from taxel.gap.fitting.fit_data import FitData
from taxel.gap.identifiability.identify import Subspace


@pytest.fixture(scope="module")
def fit_data(write_world, tmp_path_factory) -> FitData:
    return prepare_pair(read_pair(*write_world(tmp_path_factory.mktemp("refit"))))


@pytest.mark.parametrize("name", ["stiffness", "saturation", "contact_propagation", "gain_mismatch"])
def test_a_refit_with_reused_derivatives_reaches_the_same_cost(fit_data, name):
    """A fit to all taxels is followed by a refit without one fold of taxels. If the refit reuses the derivatives at the
    first fit, its cost is at most 0.01 % higher than the cost of a refit with new derivatives.
    """
    state = fit_data.state
    effect = OWN_EFFECTS[name][0]
    true_effect = FittedEffect(effect, effect.make_typical_values(state))
    target = CompositeModel((true_effect,)).predict_features(state) + np.random.default_rng(1).normal(
        0.0, 1.0, state.mean.shape
    )
    problem = FitProblem(state, target, fit_data.weight)
    composite = fit(problem, CompositeModel((start_effect(state, effect),))).composite
    problem_without_fold = FitProblem(
        state, target, np.where((fit_data.taxel_folds != 0)[:, None], fit_data.weight, 0.0)
    )
    with_new_derivatives, with_reused_derivatives = (
        fit(problem_without_fold, composite),
        fit(problem_without_fold, composite, iterations=6, linearisation=linearise(state, composite)),
    )
    assert with_reused_derivatives.cost <= with_new_derivatives.cost * (1.0 + 1e-4)
    assert with_reused_derivatives.cost < problem_without_fold.cost(state.mean)


def test_the_block_structure_of_one_effect_does_not_change_the_normal_equations(fit_data):
    """The computation by blocks and the general computation agree."""
    state = fit_data.state
    effect = OWN_EFFECTS["hysteresis"][0]
    columns = linearise(state, CompositeModel((FittedEffect(effect, effect.make_typical_values(state)),))).columns
    problem = FitProblem(state, state.mean, fit_data.weight)
    # Columns that share one array of block numbers are computed by blocks; copies of the array select the general way.
    separate_columns = [DerivativeColumn(one.change, one.blocks.copy(), one.count, one.precision) for one in columns]
    np.testing.assert_allclose(build_normal_matrix(problem, columns), build_normal_matrix(problem, separate_columns))


def test_projection_on_a_subspace_removes_its_vectors_and_keeps_orthogonal_ones(fit_data):
    state = fit_data.state
    columns = linearise(state, CompositeModel((start_effect(state, OWN_EFFECTS["gain_mismatch"][1]),))).columns
    values = np.random.default_rng(2).normal(size=columns[0].count)
    in_subspace = columns[0].change * values[columns[0].blocks][:, None]
    space = Subspace(fit_data, [*columns, *columns])  # duplicated columns do not change the subspace
    total = float(np.sum(fit_data.weight * in_subspace**2))
    assert space.compute_residual2(in_subspace) == pytest.approx(0.0, abs=1e-6 * total)
    # A gain does not change the noise features: these features are orthogonal to the subspace.
    noise = np.zeros_like(in_subspace)
    noise[:, fit_data.layout.noise] = 1.0
    assert space.compute_residual2(noise) == pytest.approx(float(np.sum(fit_data.weight * noise**2)))
