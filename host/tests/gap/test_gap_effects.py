"""Every effect changes nothing at its neutral values; single effects have their specified behaviour."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from taxel.gap.data.boards import BoardLayout
from taxel.gap.effects.catalogue import OWN_EFFECTS, all_effects
from taxel.gap.effects.lag import apply_low_pass
from taxel.gap.effects.pillar_propagation import FORCE_LEVELS, compute_gained_force
from taxel.gap.effects.sheet_kernel import compute_sheet_kernel, compute_taxel_kernel
from taxel.gap.features.features import SessionMeans, compute_known_mean
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.fit import start_effect
from taxel.gap.fitting.fit_data import FitData
from taxel.gap.identifiability.identify import compute_typical_length2
from taxel.recording.grasp_format import Phase

FORMS = [(name, form) for name, forms in all_effects().items() for form in forms]
IDS = [f"{name} {form.variant or form.scope} {form.scope}" for name, form in FORMS]


@pytest.mark.parametrize(("name", "form"), FORMS, ids=IDS)
def test_every_effect_at_neutral_values_changes_no_feature(state, name, form):
    neutral = form.make_neutral_values(state)
    assert form.apply(state, state.base, neutral) is state.base
    features = np.random.default_rng(1).normal(50.0, 10.0, state.mean.shape)
    np.testing.assert_array_equal(form.apply_to_features(state, features, neutral), features)
    np.testing.assert_array_equal(CompositeModel((FittedEffect(form, neutral),)).predict_features(state), state.mean)


@pytest.mark.parametrize("has_force", [True, False])
def test_a_limit_of_the_signal_limits_the_predicted_mean_of_all_simulated_contacts(state, has_force):
    """The mean of all contacts is 1.3 times the signal of the contacts on which effects act, as for a large hand."""
    bins = state.layout.bins
    mean = state.mean.copy()
    mean[:, :bins] = 1.3 * state.average_bins(state.signal_counts)
    signal_only = replace(state.base, force=None, separation=None, signal_counts=state.signal_counts)
    few = replace(state, mean=mean, base=state.base if has_force else signal_only)
    (clip,) = (form for name, form in FORMS if name == "saturation" and form.variant == "clip")
    limit = 0.5 * float(mean[:, :bins].max())
    limited = CompositeModel((FittedEffect(clip, np.array([[limit]])),)).predict_features(few)
    assert limited[:, :bins].max() == pytest.approx(limit, rel=1e-6)
    assert few.predict_features(few.base) is few.mean


@pytest.mark.parametrize(("name", "form"), FORMS, ids=IDS)
def test_parameters_have_units_bounds_and_a_start_within_them(state, name, form):
    for parameter in form.parameters():
        assert parameter.low <= parameter.neutral <= parameter.high
        assert parameter.low <= parameter.start <= parameter.high
        assert parameter.unit
    assert form.name == name
    assert start_effect(state, form).values.shape == form.make_neutral_values(state).shape


def test_contact_propagation_keeps_the_net_force_of_each_board_and_loads_more_taxels(state):
    form = OWN_EFFECTS["contact_propagation"][0]
    moved = form.apply(state, state.base, np.array([[3.0], [0.7]]))
    for board in range(2):
        taxels = state.pair.groups.sensor == board
        np.testing.assert_allclose(moved.force[:, :, taxels].sum(axis=2), state.base.force[:, :, taxels].sum(axis=2))
    assert (moved.force > 0).sum() > (state.base.force > 0).sum()


def test_the_taxel_kernel_of_a_large_board_approximates_the_kernel_of_its_pieces(monkeypatch):
    """The approximation is for kernels wider than a taxel."""
    place = np.stack(np.meshgrid(np.arange(6), np.arange(6), [0.0]), axis=-1).reshape(-1, 3) * 5e-3
    pieces = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1], [0.0]), axis=-1).reshape(-1, 3) * 5e-3 / 3
    distance = np.linalg.norm(place[:, None] - place, axis=2)
    board = BoardLayout(np.arange(36), distance, 5e-3, place[:, None] + pieces)
    fine = compute_taxel_kernel(compute_sheet_kernel(board, 8e-3), None)
    monkeypatch.setattr("taxel.gap.effects.sheet_kernel.MAX_PIECE_PAIRS", 100)
    coarse = compute_taxel_kernel(compute_sheet_kernel(board, 8e-3), np.full((36, 9), 1 / 9))
    np.testing.assert_allclose(coarse, fine, atol=2e-3)
    np.testing.assert_allclose(coarse.sum(axis=1), 1.0)


def test_pillar_propagation_loads_only_taxels_within_its_reach():
    """Three taxels in a row, 5 mm apart, each with nine equal pieces."""
    places = 5e-3 * np.arange(3)[:, None] * [1.0, 0.0, 0.0]
    distance = 5e-3 * np.abs(np.subtract.outer(np.arange(3), np.arange(3)))
    board = BoardLayout(np.arange(3), distance, 5e-3, np.repeat(places[:, None], 9, axis=1))
    pressure = np.repeat([[3.0], [0.0], [0.5]], 9, axis=1)
    # Force F is depth F / (F + 1): 3 N give 3/4. One pitch is a quarter of the reach and reduces the depth by 1/4, so
    # the second taxel has depth 1/2, which is 1 N.
    gained = compute_gained_force(board, pressure, reach_m=20e-3, half_depth_n=1.0)
    np.testing.assert_allclose(gained[FORCE_LEVELS == 1.0], [[0.0, 1.0, 0.0]], atol=1e-6)
    np.testing.assert_array_equal(gained[FORCE_LEVELS == 0.0], 0.0)
    np.testing.assert_allclose(compute_gained_force(board, pressure, reach_m=5e-3, half_depth_n=1.0), 0.0, atol=1e-6)
    unloaded = compute_gained_force(board, 0.0 * pressure, reach_m=20e-3, half_depth_n=1.0)
    np.testing.assert_array_equal(unloaded, 0.0)


def test_pillar_propagation_is_linear_in_its_strength(state):
    form = next(one for one in OWN_EFFECTS["contact_propagation"] if one.variant == "pillars")
    half, whole = (form.apply(state, state.base, np.array([[9.0], [one]])).force for one in (0.5, 1.0))
    assert (whole >= state.base.force).all()
    assert (whole > state.base.force).any()
    np.testing.assert_allclose(half - state.base.force, 0.5 * (whole - state.base.force), atol=1e-12)


def test_a_low_pass_filter_responds_to_a_step_with_its_time_constant():
    """The input rises linearly from 0 to 1 in the interval before the first node, and then stays at 1.

    With x = interval / time constant = 0.1 s / 0.2 s, the output at the first node is 1 - (1 - e^-x) / x. Its
    difference from 1 then decreases by the factor e^-x per node. A time constant of 0 leaves the values unchanged.
    """
    values, time_s = np.ones((1, 4, 1)), 0.1 * np.arange(4)
    out = apply_low_pass(values, time_s, np.full((1, 1), 0.2))[0, :, 0]
    first = 1.0 - (1.0 - np.exp(-0.5)) / 0.5
    np.testing.assert_allclose(out, 1.0 - (1.0 - first) * np.exp(-0.5 * np.arange(4)))
    np.testing.assert_allclose(apply_low_pass(values, time_s, np.zeros((1, 1))), values, atol=1e-4)


def test_a_lag_of_one_board_reduces_only_the_closing_signal_of_this_board(state):
    lag = OWN_EFFECTS["latency"][1]
    moved = lag.apply(state, state.base, np.array([[0.0, 0.3]])).signal_counts
    first_board = state.pair.groups.sensor == 0
    np.testing.assert_allclose(moved[:, :, first_board], state.signal_counts[:, :, first_board], atol=1e-2)
    closing = state.time_grid.phase == Phase.CLOSING
    assert moved[:, closing][:, :, ~first_board].sum() < state.signal_counts[:, closing][:, :, ~first_board].sum()


def test_counts_decay_faster_with_creep_of_the_gap_than_with_creep_of_the_counts(state):
    """Both forms delay the same share: `drop` of the signal, `gap` of the closed gap of a plate capacitor.

    In recovery, a small remaining share of the closed gap gives fewer counts than the same share of the signal.
    """
    forms = {form.variant: form for form in OWN_EFFECTS["hysteresis"]}
    delayed_share = np.array([[0.3], [1.0]])  # fraction, seconds
    signal_counts, gap = (forms[one].apply(state, state.base, delayed_share).signal_counts for one in ("drop", "gap"))
    recovery = state.time_grid.phase == Phase.RECOVERY
    assert 0.0 < gap[:, recovery].sum() < signal_counts[:, recovery].sum()


def test_with_a_very_slow_creep_of_the_gap_the_late_share_of_the_closed_gap_is_missing(state):
    form = next(form for form in OWN_EFFECTS["hysteresis"] if form.variant == "gap")
    late_share, time_constant_s = 0.3, 1e3  # much longer than the contacts, so the late share never arrives
    slow = form.apply(state, state.base, np.array([[late_share], [time_constant_s]])).signal_counts
    plate_counts = 0.25 * state.full_scale  # signal of a plate capacitor: plate_counts x / (1 - x), closed share x
    closed = state.signal_counts / (state.signal_counts + plate_counts)
    kept = (1.0 - late_share) * closed
    np.testing.assert_allclose(slow, plate_counts * kept / (1.0 - kept), rtol=0.02, atol=0.5)


def test_hysteresis_with_a_time_constant_beyond_the_record_is_idle(state):
    """Such a time constant is not identifiable: its effect equals that of another force law."""
    record_s = float(state.node_times_s[-1])
    for form in (one for one in OWN_EFFECTS["hysteresis"] if one.variant != "sticks"):
        slow, quick = (np.array([[0.3], [times * record_s]]) for times in (4.0, 0.5))
        assert form.is_idle(state, slow)
        assert not form.is_idle(state, quick)


def test_cached_features_of_a_composite_model_equal_recomputed_features(state):
    """The cached results of the first effects are reused in any order of requests."""
    effects = [
        start_effect(state, OWN_EFFECTS[name][0])
        for name in ("contact_propagation", "electrode_crosstalk", "saturation")
    ]
    whole = CompositeModel.from_effects(effects)
    first = whole.predict_features(state)
    moved = [FittedEffect(fitted.effect, fitted.values * 1.1) for fitted in whole.fitted_effects]
    mixed = [
        CompositeModel((*whole.fitted_effects[:k], moved[k], *whole.fitted_effects[k + 1 :])) for k in (2, 0, 1, 2)
    ]
    found = [composite.predict_features(state) for composite in mixed]
    np.testing.assert_array_equal(whole.predict_features(state), first)
    for composite, again in zip(mixed, found, strict=True):
        fresh = replace(state)  # a state with an empty cache
        np.testing.assert_array_equal(composite.predict_features(fresh), again)


def test_an_effect_without_influence_changes_the_features_by_a_length_of_zero(state):
    """Without force, contact propagation has no influence, but noise has."""
    layout, conditions = state.layout, len(state.pair.conditions)
    shape = (conditions, 3, layout.count, state.pair.n)
    real = SessionMeans(
        np.zeros(shape), np.full((conditions, 3), 2), np.zeros((conditions, layout.count, state.pair.n))
    )
    idle = replace(state, base=state.base.with_force(np.zeros_like(state.base.force)))
    fit_data = FitData(idle, real, layout)
    assert compute_typical_length2(fit_data, OWN_EFFECTS["contact_propagation"][0]) == 0.0
    assert compute_typical_length2(fit_data, OWN_EFFECTS["noise"][0]) > 1.0
    assert compute_typical_length2(FitData(state, real, layout), OWN_EFFECTS["contact_propagation"][0]) > 1.0


def test_the_mean_of_known_values_ignores_nan():
    values = np.array([[1.0, np.nan], [3.0, np.nan]])
    np.testing.assert_array_equal(compute_known_mean(values, 0), [2.0, np.nan])
