"""Every effect at its neutral values returns what it was given, and moves what it should elsewhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from taxel.gap.data.boards import BoardLayout
from taxel.gap.data.pair import read_pair
from taxel.gap.effects.catalogue import OWN_EFFECTS, all_effects
from taxel.gap.effects.lag import low_pass
from taxel.gap.effects.pillar_propagation import LEVELS, drawn
from taxel.gap.effects.sheet_kernel import sheet_kernel, taxel_kernel
from taxel.gap.features.features import Layout, SessionMeans, known_mean
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.fit import started
from taxel.gap.fitting.judge import Judge
from taxel.gap.fitting.state import state_of
from taxel.gap.identifiability.identify import seen
from taxel.recording.grasp_format import Phase

FORMS = [(name, form) for name, forms in all_effects().items() for form in forms]
IDS = [f"{name} {form.variant or form.scope} {form.scope}" for name, form in FORMS]


@pytest.fixture(scope="module")
def state(world, tmp_path_factory):
    pair = read_pair(*world(tmp_path_factory.mktemp("effects")))
    layout = Layout.of(pair.clock)
    mean = np.zeros((len(pair.conditions), layout.count, pair.n))
    return state_of(pair, layout, mean)


@pytest.mark.parametrize(("name", "form"), FORMS, ids=IDS)
def test_every_effect_at_neutral_values_changes_no_feature(state, name, form):
    neutral = form.neutral(state)
    assert form.apply(state, state.base, neutral) is state.base
    features = np.random.default_rng(1).normal(50.0, 10.0, state.mean.shape)
    np.testing.assert_array_equal(form.features(state, features, neutral), features)
    np.testing.assert_array_equal(CompositeModel((FittedEffect(form, neutral),)).features(state), state.mean)


@pytest.mark.parametrize(("name", "form"), FORMS, ids=IDS)
def test_parameters_have_units_bounds_and_a_start_within_them(state, name, form):
    for parameter in form.parameters():
        assert parameter.low <= parameter.neutral <= parameter.high
        assert parameter.low <= parameter.start <= parameter.high
        assert parameter.unit
    assert form.name == name
    assert started(state, form).values.shape == form.neutral(state).shape


def test_contact_propagation_keeps_the_net_force_of_each_board(state):
    form = OWN_EFFECTS["contact_propagation"][0]
    moved = form.apply(state, state.base, np.array([[3.0], [0.7]]))
    for board in range(2):
        own = state.pair.groups.sensor == board
        np.testing.assert_allclose(moved.force[:, :, own].sum(axis=2), state.base.force[:, :, own].sum(axis=2))
    assert (moved.force > 0).sum() > (state.base.force > 0).sum()


def test_the_taxel_kernel_of_a_large_board_approximates_the_kernel_of_its_pieces(monkeypatch):
    """Nearly what its pieces give, where the kernel is wide."""
    place = np.stack(np.meshgrid(np.arange(6), np.arange(6), [0.0]), axis=-1).reshape(-1, 3) * 5e-3
    pieces = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1], [0.0]), axis=-1).reshape(-1, 3) * 5e-3 / 3
    apart = np.linalg.norm(place[:, None] - place, axis=2)
    board = BoardLayout(np.arange(36), apart, 5e-3, place[:, None] + pieces)
    fine = taxel_kernel(sheet_kernel(board, 8e-3), None)
    monkeypatch.setattr("taxel.gap.effects.sheet_kernel.MOST_PAIRS", 100)
    coarse = taxel_kernel(sheet_kernel(board, 8e-3), np.full((36, 9), 1 / 9))
    np.testing.assert_allclose(coarse, fine, atol=2e-3)
    np.testing.assert_allclose(coarse.sum(axis=1), 1.0)


def test_pillar_propagation_loads_only_taxels_near_the_contact():
    """Three taxels in a row, 5 mm apart, of one piece each nine times: depth falls by 1 over `spread_m`."""
    places = 5e-3 * np.arange(3)[:, None] * [1.0, 0.0, 0.0]
    apart = 5e-3 * np.abs(np.subtract.outer(np.arange(3), np.arange(3)))
    board = BoardLayout(np.arange(3), apart, 5e-3, np.repeat(places[:, None], 9, axis=1))
    pressure = np.repeat([[3.0], [0.0], [0.5]], 9, axis=1)
    gained = drawn(board, pressure, 20e-3, 1.0)  # depth 3/4; 1/4 is lost on the way to the next
    np.testing.assert_allclose(gained[LEVELS == 1.0], [[0.0, 1.0, 0.0]], atol=1e-6)
    np.testing.assert_array_equal(gained[LEVELS == 0.0], 0.0)
    np.testing.assert_allclose(drawn(board, pressure, 5e-3, 1.0), 0.0, atol=1e-6)
    np.testing.assert_array_equal(drawn(board, 0.0 * pressure, 20e-3, 1.0), 0.0)


def test_pillar_propagation_is_linear_in_its_strength(state):
    form = next(one for one in OWN_EFFECTS["contact_propagation"] if one.variant == "pillars")
    half, whole = (form.apply(state, state.base, np.array([[9.0], [one]])).force for one in (0.5, 1.0))
    assert (whole >= state.base.force).all()
    assert (whole > state.base.force).any()
    np.testing.assert_allclose(half - state.base.force, 0.5 * (whole - state.base.force), atol=1e-12)


def test_a_filter_follows_with_its_time_constant(state):
    """A step of 1 at the first node, nodes of 0.1 s, 0.2 s: 1 - (1 - e^-x) / x after the ramp, then the rest decays."""
    values, time_s = np.ones((1, 4, 1)), 0.1 * np.arange(4)
    out = low_pass(values, time_s, np.full((1, 1), 0.2))[0, :, 0]
    first = 1.0 - (1.0 - np.exp(-0.5)) / 0.5
    np.testing.assert_allclose(out, 1.0 - (1.0 - first) * np.exp(-0.5 * np.arange(4)))
    np.testing.assert_allclose(low_pass(values, time_s, np.zeros((1, 1))), values, atol=1e-4)
    lag = OWN_EFFECTS["latency"][1]
    moved = lag.apply(state, state.base, np.array([[0.0, 0.3]])).signal_counts
    first_board = state.pair.groups.sensor == 0
    np.testing.assert_allclose(moved[:, :, first_board], state.signal_counts[:, :, first_board], atol=1e-2)
    closing = state.clock.phase == Phase.CLOSING
    assert moved[:, closing][:, :, ~first_board].sum() < state.signal_counts[:, closing][:, :, ~first_board].sum()


def test_counts_decay_faster_with_creep_of_the_gap_than_with_creep_of_the_counts(state):
    """The same share is late; of a little that is left of a gap there are fewer counts than a share of the drop."""
    forms = {form.variant: form for form in OWN_EFFECTS["hysteresis"]}
    late = np.array([[0.3], [1.0]])
    signal_counts, gap = (forms[one].apply(state, state.base, late).signal_counts for one in ("drop", "gap"))
    recovery = state.clock.phase == Phase.RECOVERY
    assert 0.0 < gap[:, recovery].sum() < signal_counts[:, recovery].sum()
    slow = forms["gap"].apply(state, state.base, np.array([[0.3], [1e3]])).signal_counts
    closed = state.signal_counts / (state.signal_counts + 0.25 * state.full_scale)
    kept = 0.7 * closed
    np.testing.assert_allclose(slow, 0.25 * state.full_scale * kept / (1.0 - kept), rtol=0.02, atol=0.5)


def test_hysteresis_with_a_time_constant_beyond_the_record_is_idle(state):
    """Of a time constant nothing is seen there: what it does is another law of counts."""
    lasts = float(state.since[-1])
    for form in (one for one in OWN_EFFECTS["hysteresis"] if one.variant != "sticks"):
        slow, quick = (np.array([[0.3], [times * lasts]]) for times in (4.0, 0.5))
        assert form.is_idle(state, slow)
        assert not form.is_idle(state, quick)


def test_cached_features_of_a_composite_model_equal_recomputed_ones(state):
    """What was worked out for the links before it is used again, in whatever order they are asked for."""
    links = [
        started(state, OWN_EFFECTS[name][0]) for name in ("contact_propagation", "electrode_crosstalk", "saturation")
    ]
    whole = CompositeModel.of(links)
    first = whole.features(state)
    moved = [FittedEffect(link.effect, link.values * 1.1) for link in whole.links]
    mixed = [CompositeModel((*whole.links[:k], moved[k], *whole.links[k + 1 :])) for k in (2, 0, 1, 2)]
    found = [composite.features(state) for composite in mixed]
    np.testing.assert_array_equal(whole.features(state), first)
    for composite, again in zip(mixed, found, strict=True):
        fresh = replace(state)  # nothing was worked out for this one yet
        np.testing.assert_array_equal(composite.features(fresh), again)


def test_the_visibility_of_an_effect_without_influence_is_zero(state):
    """Without force nothing spreads; noise is seen even then."""
    layout, conditions = state.layout, len(state.pair.conditions)
    shape = (conditions, 3, layout.count, state.pair.n)
    real = SessionMeans(
        np.zeros(shape), np.full((conditions, 3), 2), np.zeros((conditions, layout.count, state.pair.n))
    )
    idle = replace(state, base=state.base.with_force(np.zeros_like(state.base.force)))
    judge = Judge(idle, real, layout)
    assert seen(judge, OWN_EFFECTS["contact_propagation"][0]) == 0.0
    assert seen(judge, OWN_EFFECTS["noise"][0]) > 1.0
    assert seen(Judge(state, real, layout), OWN_EFFECTS["contact_propagation"][0]) > 1.0


def test_the_mean_of_known_values_ignores_nan():
    values = np.array([[1.0, np.nan], [3.0, np.nan]])
    np.testing.assert_array_equal(known_mean(values, 0), [2.0, np.nan])
