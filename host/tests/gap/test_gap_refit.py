"""Fits that begin near their end keep the derivative of their beginning; what a subspace leaves is worked out once."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.gap.data.pair import read_pair
from taxel.gap.data.prepare import prepared
from taxel.gap.effects.catalogue import OWN_EFFECTS
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.equations import Column, Problem, system_of
from taxel.gap.fitting.fit import fit, start_of, started
from taxel.gap.fitting.judge import Judge
from taxel.gap.identifiability.identify import Subspace


@pytest.fixture(scope="module")
def judge(world, tmp_path_factory) -> Judge:
    return prepared(read_pair(*world(tmp_path_factory.mktemp("refit"))))


@pytest.mark.parametrize("name", ["stiffness", "saturation", "contact_propagation", "gain_mismatch"])
def test_a_refit_with_reused_derivatives_reaches_the_same_cost(judge, name):
    state = judge.state
    effect = OWN_EFFECTS[name][0]
    there = FittedEffect(effect, effect.typical(state))
    target = CompositeModel((there,)).features(state) + np.random.default_rng(1).normal(0.0, 1.0, state.mean.shape)
    whole = Problem(state, target, judge.weight)
    composite = fit(whole, CompositeModel((started(state, effect),))).composite
    part = Problem(state, target, np.where((judge.parts != 0)[:, None], judge.weight, 0.0))
    slow, quick = fit(part, composite), fit(part, composite, iterations=6, start=start_of(state, composite))
    assert quick.cost <= slow.cost * (1.0 + 1e-4)
    assert quick.cost < part.cost(state.mean)


def test_the_block_structure_of_one_effect_does_not_change_the_normal_equations(judge):
    """The short way gives what the long one gives."""
    state = judge.state
    effect = OWN_EFFECTS["hysteresis"][0]
    columns = start_of(state, CompositeModel((FittedEffect(effect, effect.typical(state)),))).columns
    problem = Problem(state, state.mean, judge.weight)
    apart = [Column(one.change, one.blocks.copy(), one.count, one.precision) for one in columns]
    np.testing.assert_allclose(system_of(problem, columns), system_of(problem, apart))


def test_projection_on_a_subspace_removes_its_vectors_and_keeps_orthogonal_ones(judge):
    state = judge.state
    columns = start_of(state, CompositeModel((started(state, OWN_EFFECTS["gain_mismatch"][1]),))).columns
    values = np.random.default_rng(2).normal(size=columns[0].count)
    own = columns[0].change * values[columns[0].blocks][:, None]
    space = Subspace(judge, [*columns, *columns])  # the same twice: no more than once
    whole = float(np.sum(judge.weight * own**2))
    assert space.left(own) == pytest.approx(0.0, abs=1e-6 * whole)
    noise = np.zeros_like(own)
    noise[:, judge.layout.noise] = 1.0
    assert space.left(noise) == pytest.approx(float(np.sum(judge.weight * noise**2)))
