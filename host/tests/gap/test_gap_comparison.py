"""Comparison of sets of effects: densities, weights, calibration, and complete comparisons of synthetic pairs."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import linregress

from host.tests.gap.stiffer_layer import stiffen
from taxel.gap.calibration.calibration import NO_GAP, UNKNOWN, Calibration, Logistic, combine_inputs, load_calibration
from taxel.gap.comparison.candidates import CandidateSearch, find_uncertain_change
from taxel.gap.comparison.compare import compare
from taxel.gap.comparison.density import CERTAIN, BlockDensity, UncertainChange, fit_density
from taxel.gap.comparison.evidence import EffectEvidence, RemainderEvidence
from taxel.gap.comparison.held_out import predict_held_out
from taxel.gap.comparison.load_trend import compute_load_trend, compute_slope_t
from taxel.gap.comparison.settings import DEFAULT_SETTINGS
from taxel.gap.comparison.weights import compute_set_weights
from taxel.gap.data.prepare import prepare_pair
from taxel.gap.effects.contact_propagation import ContactPropagation
from taxel.gap.effects.effect import BOARD, HAND, TAXEL
from taxel.gap.effects.gain_mismatch import GainMismatch
from taxel.gap.effects.latency import Latency
from taxel.gap.effects.stiffness import Stiffness
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.fit import fit
from taxel.gap.fitting.fit_data import FitData

SIGNAL = 0
"""Index of the family of the signal features on the last axis of densities and deviations."""


def delay_second_board(force, signal):
    """Delay the signal of the second board by 4 frames."""
    late = signal.copy()
    late[4:, 30:] = signal[:-4, 30:]
    return late


def test_the_correct_effect_increases_the_density_of_every_condition(fit_data, fitted):
    density = BlockDensity(fit_data, DEFAULT_SETTINGS)
    without, with_effect = (
        density.compute_log_density(features)[..., SIGNAL] for features in (fit_data.state.mean, fitted.features)
    )
    assert (with_effect.sum(axis=1) > without.sum(axis=1)).all()


def test_one_faulty_condition_changes_the_density_by_a_bounded_amount(fit_data):
    density = BlockDensity(fit_data, DEFAULT_SETTINGS)
    faulty, more_faulty = fit_data.state.mean.copy(), fit_data.state.mean.copy()
    faulty[0, : fit_data.layout.bins] += 1000.0
    more_faulty[0, : fit_data.layout.bins] += 10_000.0
    small, large = (density.compute_log_density(one) for one in (faulty, more_faulty))
    assert np.array_equal(small[1:], large[1:])
    blocks, dimensions = 2, DEFAULT_SETTINGS.dimensions[0]
    # A tenfold error multiplies the squared deviation of a block by about 100. This changes the log density of the
    # block by at most 0.5 * (sessions - 1 + dimensions) * log(100).
    bound = 0.5 * blocks * (fit_data.sessions.value.shape[1] - 1 + dimensions) * np.log(100.0)
    assert 0.0 < (small - large)[0].sum() < 1.01 * bound


@pytest.mark.parametrize(("factor", "gains"), [(2.5, True), (1.0, False), (0.0, False)])
def test_a_relative_error_of_the_change_increases_the_density_of_a_wrong_size_only(fit_data, fitted, factor, gains):
    """factor: predicted change relative to the fitted change. An error of 0 is possible, so the density never falls."""
    mean = fit_data.state.mean
    density, change = BlockDensity(fit_data, DEFAULT_SETTINGS), factor * (fitted.features - mean)
    certain, uncertain = (
        float(density.compute_log_density(mean + change, one).sum())
        for one in (CERTAIN, UncertainChange(change, (0.0, 0.5)))
    )
    assert uncertain > certain + 5.0 if gains else uncertain == certain


def test_an_error_of_the_change_costs_density_where_the_prediction_is_correct(fit_data):
    """A set must not gain density by a larger variance alone."""
    density, change = BlockDensity(fit_data, DEFAULT_SETTINGS), 0.2 * fit_data.state.mean
    certain, uncertain = (
        float(density.compute_log_density(fit_data.target, UncertainChange(change, (error,))).sum())
        for error in (0.0, 0.5)
    )
    assert uncertain < certain - 5.0


def test_only_the_change_by_contact_propagation_is_uncertain(fit_data):
    state = fit_data.state
    propagation = FittedEffect(ContactPropagation("added"), np.array([[2.0], [0.4]]))
    stiffness = FittedEffect(Stiffness(HAND), np.array([[0.3]]))
    both = CompositeModel((stiffness, propagation))
    features = both.predict_features(state)
    found = find_uncertain_change(state, both, features)
    assert found.errors == ContactPropagation.change_errors
    assert np.allclose(found.change, features - CompositeModel((stiffness,)).predict_features(state))
    assert find_uncertain_change(state, CompositeModel((stiffness,)), features) is CERTAIN


def test_a_fold_contains_every_second_taxel_of_a_condition_as_on_a_chessboard(fit_data):
    taxels = fit_data.state.pair.taxels
    is_dark = (taxels.tx.astype(int) + taxels.rx) % 2 == 1
    for folds in fit_data.taxel_folds:
        dark, light = set(folds[is_dark].tolist()), set(folds[~is_dark].tolist())
        assert len(dark) == len(light) == 1
        assert dark != light
    number, count = np.unique(fit_data.taxel_folds, return_counts=True)
    assert len(number) == len(fit_data.taxel_folds)
    assert set(count.tolist()) == {len(is_dark)}


def test_linear_predictions_agree_with_refits_without_the_fold(fit_data, fitted):
    prediction = predict_held_out(fit_data, fitted.composite, ())
    for number, composite in enumerate(prediction.composites):
        is_in_fold = fit_data.taxel_folds == number
        refitted = fitted
        for _ in range(3):  # a single fit ends shortly before the minimum
            refitted = fit(fit_data.build_problem(~is_in_fold), refitted.composite)
        linear = np.moveaxis(prediction.features - refitted.features, 1, 2)[is_in_fold]
        change = np.abs(refitted.features - fitted.features).max()
        assert np.abs(linear).max() < 0.02 * change
        assert composite.fitted_effects[0].values == pytest.approx(
            refitted.composite.fitted_effects[0].values, rel=0.01
        )


def test_weights_sum_to_1_and_prefer_the_better_and_the_smaller_set():
    density = np.array([[0.0] * 8, [2.0] * 8, [2.0] * 8])  # log density of three sets in eight conditions
    weights = compute_set_weights(density, sizes=[0, 1, 2], settings=DEFAULT_SETTINGS)
    assert weights.sum() == pytest.approx(1.0)
    assert weights[1] == pytest.approx(10.0 * weights[2])  # prior odds of 0.1 for the second effect
    assert weights[1] > 0.9


def test_one_condition_alone_does_not_make_a_set_certain():
    density = np.zeros((2, 8))
    density[1, 0] = 12.0
    assert compute_set_weights(density, [0, 1], DEFAULT_SETTINGS)[1] < 0.9


def test_a_logistic_model_predicts_the_frequencies_and_is_unchanged_by_json():
    rng = np.random.default_rng(3)
    inputs = rng.normal(size=(2000, 2))
    labels = rng.random(2000) < 1.0 / (1.0 + np.exp(-(inputs[:, 0] - 1.0)))
    model = Logistic.fit(inputs, labels.tolist())
    assert model.predict(np.array([1.0, 0.0])) == pytest.approx(0.5, abs=0.05)
    restored = Logistic.from_json(json.loads(json.dumps(model.to_json())))
    assert restored.predict(inputs[0]) == pytest.approx(model.predict(inputs[0]), abs=1e-4)


def test_a_statement_of_weight_2_counts_as_two_statements():
    rng = np.random.default_rng(5)
    inputs, labels = rng.normal(size=(40, 3)), rng.random(40) < 0.5
    weights = np.where(np.arange(40) < 10, 2.0, 1.0)
    weighted = Logistic.fit(inputs, labels.tolist(), weights.tolist())
    repeated = Logistic.fit(np.vstack([inputs, inputs[:10]]), [*labels.tolist(), *labels[:10].tolist()])
    assert weighted.mean == pytest.approx(repeated.mean)
    assert weighted.std == pytest.approx(repeated.std)
    assert weighted.coefficients == pytest.approx(repeated.coefficients, abs=1e-4)


def test_the_packaged_calibration_gives_strong_evidence_a_larger_probability_than_weak_evidence():
    """The probability is that of an effect to be a cause, without other evidence of an unknown cause."""
    remainder = RemainderEvidence(
        before=1.0, after=1.0, deviation=1.0, common=0.4, gain=1.7, size=0.4, whole=5.0, blocks=20
    )
    weak = EffectEvidence(
        weight=0.02, gain=0.0, size=0.13, share=0.13, parameters=3, sessions=0.0, amplitude=0.0, blocks=20
    )
    strong = EffectEvidence(
        weight=0.999, gain=50.0, size=4.5, share=1.0, parameters=3, sessions=10.0, amplitude=1.0, blocks=20
    )
    weak_probability, strong_probability = (
        load_calibration().effect.predict(combine_inputs(one.to_inputs(), remainder.to_inputs()))
        for one in (weak, strong)
    )
    assert weak_probability < 0.1
    assert strong_probability > 0.6


@pytest.mark.parametrize(("effect", "name"), [(stiffen, "stiffness"), (delay_second_board, "latency")])
def test_a_single_cause_is_the_most_probable(write_world, tmp_path, effect, name):
    probabilities = compare(*write_world(tmp_path, effect=effect)).compute_probabilities()
    assert max(probabilities, key=lambda key: probabilities[key]) == name
    assert all(0.0 <= value <= 1.0 for value in probabilities.values())


def test_a_world_without_an_effect_has_no_probable_cause(write_world, tmp_path):
    comparison = compare(*write_world(tmp_path))
    probabilities = comparison.compute_probabilities()
    assert max(value for name, value in probabilities.items() if name != NO_GAP) < 0.5


def make_constant(probability: float, inputs: int) -> Logistic:
    """Return a model that predicts one probability for all inputs."""
    return Logistic(float(np.log(probability / (1 - probability))), np.zeros(inputs), np.zeros(inputs), np.ones(inputs))


@pytest.mark.parametrize("any_cause", [0.05, 0.6, 0.99])
def test_probabilities_of_causes_agree_with_the_probability_of_any_cause(any_cause):
    calibration = Calibration(
        effect=make_constant(0.3, 10),
        unknown=make_constant(0.2, 7),
        any_cause=make_constant(any_cause, 4),
        not_compared=0.01,
        source="a test",
    )
    # There is evidence for noise only, so latency has the probability `not_compared`.
    found = calibration.compute_probabilities({"noise": np.full(8, 5.0)}, np.zeros(7), ["noise", "latency"])
    causes = [found[name] for name in ("noise", "latency", UNKNOWN)]
    independent = 1.0 - (1.0 - 0.3) * (1.0 - 0.01) * (1.0 - 0.2)  # at least one cause, if they were independent
    assert causes == pytest.approx([any_cause * one / independent for one in (0.3, 0.01, 0.2)])
    assert found[NO_GAP] == pytest.approx(1.0 - any_cause)
    assert causes[0] > causes[2] > causes[1]


def test_an_excluded_effect_has_no_probability(write_world, tmp_path):
    assert "noise" not in compare(*write_world(tmp_path, effect=stiffen), without=["noise"]).compute_probabilities()


def test_the_model_error_is_estimated_and_limits_the_evidence(fit_data, fitted):
    density = BlockDensity(fit_data, DEFAULT_SETTINGS)
    exact = density.estimate_model_error(fit_data.target)
    assert exact == DEFAULT_SETTINGS.smallest_model_error
    bins = slice(0, fit_data.layout.bins)
    wrong = fit_data.target.copy()
    wrong[:, bins] *= 1.2
    error = density.estimate_model_error(wrong)
    assert 0.1 < error < 0.25  # relative to the larger of both signals
    tolerant = BlockDensity(fit_data, DEFAULT_SETTINGS, error)
    gains = [
        (one.compute_log_density(fitted.features) - one.compute_log_density(wrong)).sum() for one in (density, tolerant)
    ]
    assert gains[1] < 0.5 * gains[0]


def set_repeat_variance(fit_data: FitData, standard_error_counts: float) -> FitData:
    """Return the pair as if the simulated repeats varied: their mean signal has this standard error, in counts."""
    variance = np.zeros_like(fit_data.state.mean)
    variance[:, : fit_data.layout.bins] = standard_error_counts**2
    return FitData(replace(fit_data.state, mean_variance=variance), fit_data.sessions, fit_data.layout)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("share", [0.0, 1.0])
def test_the_share_of_the_variance_between_simulated_repeats_is_estimated(fit_data, share, seed):
    """The prediction has an error with the variance of the sessions and `share` times that of simulated repeats."""
    rng, bins, counts = np.random.default_rng(seed), slice(0, fit_data.layout.bins), 40.0
    varied = set_repeat_variance(fit_data, counts)
    error = np.sqrt(fit_data.sessions.mean_variance[:, bins] + share * counts**2)
    predicted = fit_data.target.copy()
    predicted[:, bins] += error * rng.normal(size=error.shape)
    density = fit_density(varied, DEFAULT_SETTINGS, predicted)
    assert abs(density.repeat_share - share) <= 0.25
    assert density.compute_simulated_floor2() == pytest.approx(
        density.repeat_share * counts**2 * fit_data.layout.weight[bins].sum(), rel=0.2
    )


def test_variance_between_simulated_repeats_reduces_deviations_and_weights(fit_data):
    varied = set_repeat_variance(fit_data, standard_error_counts=200.0)
    mean_deviation, mean_deviation_of_varied = (
        BlockDensity(data, DEFAULT_SETTINGS).compute_deviations(fit_data.state.mean)[..., SIGNAL].mean()
        for data in (fit_data, varied)
    )
    assert mean_deviation_of_varied < 0.1 * mean_deviation
    signal_bins = slice(0, fit_data.layout.bins)
    assert varied.weight[:, signal_bins].max() < fit_data.weight[:, signal_bins].max()


def test_two_real_datasets_have_no_variance_of_the_reference_beside_the_floor(fit_data):
    pair = fit_data.state.pair
    assert prepare_pair(pair).state.mean_variance is not None
    assert prepare_pair(replace(pair, is_real_real=True)).state.mean_variance is None


def make_random_gains(fit_data: FitData, slope: float, seed: int) -> FittedEffect:
    """Return random gains of all taxels that change with the logarithm of the load by this slope."""
    rng = np.random.default_rng(seed)
    load = np.abs(fit_data.state.mean[:, : fit_data.layout.bins]).max(axis=(0, 1))
    gains = rng.normal(0.0, 0.05, len(load)) + slope * np.log(np.maximum(load, 1.0) / 1000.0)
    # Within two prior standard deviations, beyond which each gain alone is less probable.
    return FittedEffect(GainMismatch(TAXEL), np.clip(gains, -0.6, 0.6)[None])


@pytest.mark.parametrize("seed", range(3))
def test_gains_that_depend_on_the_load_are_less_probable(fit_data, seed):
    """The load trend is the absolute t value of the regression of the gains on the logarithm of the load."""
    search = CandidateSearch(fit_data, {}, BlockDensity(fit_data, DEFAULT_SETTINGS), DEFAULT_SETTINGS)
    independent, dependent = make_random_gains(fit_data, 0.0, seed), make_random_gains(fit_data, -0.2, seed)
    assert compute_load_trend(fit_data.state, independent) < 3.5
    assert compute_load_trend(fit_data.state, dependent) > 5.0
    priors = [search.compute_log_prior(CompositeModel((one,))) for one in (independent, dependent)]
    assert priors[1] < priors[0] - 10.0


def test_t_value_of_a_slope_agrees_with_the_regression_of_scipy():
    rng = np.random.default_rng(5)
    x, y = rng.normal(size=20), rng.normal(size=20)
    for slope in (0.0, 0.3, -2.0):
        regression = linregress(x, y + slope * x)
        assert compute_slope_t(x, y + slope * x) == pytest.approx(abs(regression.slope / regression.stderr))


def test_t_value_of_an_undetermined_slope_is_0():
    x = np.arange(9.0)
    assert compute_slope_t(np.ones(9), x) == 0.0  # all x are equal
    assert compute_slope_t(x, np.ones(9)) == 0.0  # no deviation from a line


def test_only_properties_of_boards_and_taxels_have_a_load_trend(fit_data, fitted):
    assert compute_load_trend(fit_data.state, fitted.composite.fitted_effects[0]) == 0.0
    delays = np.linspace(0.0, 0.1, 2)[None]
    assert compute_load_trend(fit_data.state, FittedEffect(Latency(BOARD), delays)) == 0.0
