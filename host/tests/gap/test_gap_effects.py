"""Every effect at its neutral values returns what it was given, and moves what it should elsewhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from taxel.gap.catalogue import CATALOGUE
from taxel.gap.chain import Chain, Link
from taxel.gap.features import Layout, SessionMeans, known_mean
from taxel.gap.fit import started
from taxel.gap.identify import seen
from taxel.gap.judge import Judge
from taxel.gap.pair import read_pair
from taxel.gap.state import state_of

FORMS = [(name, form) for name, forms in CATALOGUE.items() for form in forms]
IDS = [f"{name} {form.variant or form.scope} {form.scope}" for name, form in FORMS]


@pytest.fixture(scope="module")
def state(world, tmp_path_factory):
    pair = read_pair(*world(tmp_path_factory.mktemp("effects")))
    layout = Layout.of(pair.clock)
    mean = np.zeros((len(pair.cells), layout.count, pair.n))
    return state_of(pair, layout, mean)


@pytest.mark.parametrize(("name", "form"), FORMS, ids=IDS)
def test_neutral_values_change_nothing_bit_for_bit(state, name, form):
    neutral = form.neutral(state)
    assert form.apply(state, state.base, neutral) is state.base
    features = np.random.default_rng(1).normal(50.0, 10.0, state.mean.shape)
    np.testing.assert_array_equal(form.features(state, features, neutral), features)
    np.testing.assert_array_equal(Chain((Link(form, neutral),)).features(state), state.mean)


@pytest.mark.parametrize(("name", "form"), FORMS, ids=IDS)
def test_parameters_have_units_bounds_and_a_start_within_them(state, name, form):
    for parameter in form.parameters():
        assert parameter.low <= parameter.neutral <= parameter.high
        assert parameter.low <= parameter.start <= parameter.high
        assert parameter.unit
    assert form.name == name
    assert started(state, form).values.shape == form.neutral(state).shape


def test_spreading_pressure_keeps_each_boards_net_force(state):
    form = CATALOGUE["contact_propagation"][0]
    moved = form.apply(state, state.base, np.array([[3.0], [0.7]]))
    for board in range(2):
        own = state.pair.groups.sensor == board
        np.testing.assert_allclose(moved.force[:, :, own].sum(axis=2), state.base.force[:, :, own].sum(axis=2))
    assert (moved.force > 0).sum() > (state.base.force > 0).sum()


def test_presses_that_do_not_show_an_effect_say_so(state):
    """Without force nothing spreads; noise is seen even then."""
    layout, cells = state.layout, len(state.pair.cells)
    shape = (cells, 3, layout.count, state.pair.n)
    real = SessionMeans(np.zeros(shape), np.full((cells, 3), 2), np.zeros((cells, layout.count, state.pair.n)))
    idle = replace(state, base=state.base.with_force(np.zeros_like(state.base.force)))
    judge = Judge(idle, real, layout)
    assert seen(judge, CATALOGUE["contact_propagation"][0]) == 0.0
    assert seen(judge, CATALOGUE["noise"][0]) > 1.0
    assert seen(Judge(state, real, layout), CATALOGUE["contact_propagation"][0]) > 1.0


def test_a_mean_of_what_is_known_ignores_the_rest():
    values = np.array([[1.0, np.nan], [3.0, np.nan]])
    np.testing.assert_array_equal(known_mean(values, 0), [2.0, np.nan])
