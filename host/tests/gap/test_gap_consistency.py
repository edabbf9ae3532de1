"""Consistency of a predicted change over the sessions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from taxel.gap.comparison.candidates import CandidateSearch
from taxel.gap.comparison.consistency import (
    NO_EVIDENCE,
    compute_consistency,
    compute_session_consistency,
)
from taxel.gap.comparison.density import BlockDensity
from taxel.gap.comparison.held_out import predict_held_out
from taxel.gap.comparison.settings import DEFAULT_SETTINGS
from taxel.gap.effects.effect import TAXEL
from taxel.gap.effects.gain_mismatch import GainMismatch
from taxel.gap.features.features import SessionMeans, compute_known_mean
from taxel.gap.fitting.composite import CompositeModel
from taxel.gap.fitting.fit import fit, start_effect
from taxel.gap.fitting.fit_data import FitData


def make_search(fit_data: FitData) -> CandidateSearch:
    return CandidateSearch(fit_data, {}, BlockDensity(fit_data, DEFAULT_SETTINGS), DEFAULT_SETTINGS)


def test_a_change_that_all_units_show_has_evidence():
    products, squares = np.array([1.05, 0.9, 1.0, 1.1]), np.ones(4)
    found = compute_consistency(products, squares)
    assert found.amplitude == pytest.approx(1.0125)
    assert found.evidence > 6.0


def test_a_change_in_one_unit_alone_has_hardly_any_evidence():
    """Other units neither predict nor show the change. The probability of such a ratio is near one half."""
    one_only = compute_consistency(np.array([50.0, 0.0, 0.0, 0.0]), np.array([50.0, 0.01, 0.01, 0.01]))
    assert one_only.evidence < 2.0 * NO_EVIDENCE.evidence


def test_the_evidence_of_random_amplitudes_is_that_of_a_probability():
    """The probability is uniformly distributed if the change is absent, so its negative logarithm has the mean 1."""
    rng = np.random.default_rng(11)
    evidence = [compute_consistency(rng.normal(size=5), np.ones(5)).evidence for _ in range(4000)]
    assert np.mean(evidence) == pytest.approx(1.0, abs=0.06)
    assert np.mean(np.array(evidence) > -np.log(0.01)) == pytest.approx(0.01, abs=0.005)


def test_equal_amplitudes_have_finite_evidence():
    """Without any variation between the units, the probability is 0 within the precision of the computer."""
    found = compute_consistency(np.full(5, 2.0), np.ones(5))
    assert found.amplitude == 2.0
    assert 100.0 < found.evidence < np.inf


@pytest.mark.parametrize("squares", [[], [4.0], [4.0, 0.0]])
def test_fewer_than_two_units_have_no_evidence(squares):
    assert compute_consistency(np.array(squares), np.array(squares)) == NO_EVIDENCE


def test_targets_without_a_session_are_means_of_the_other_sessions(fit_data):
    targets = fit_data.targets_without_session
    sessions = fit_data.sessions.value.shape[1]
    assert len(targets) == sessions
    assert np.mean(targets, axis=0) == pytest.approx(fit_data.target, abs=1e-9)
    others = compute_known_mean(np.delete(fit_data.sessions.value, 1, axis=1), 1)
    assert targets[1] == pytest.approx(np.nan_to_num(others), abs=1e-9)


def test_linearised_fits_without_a_session_agree_with_refits(fit_data, fitted):
    prediction = predict_held_out(fit_data, fitted.composite, ())
    for composite, target in zip(prediction.session_composites, fit_data.targets_without_session, strict=True):
        refitted = fitted
        for _ in range(3):  # a single fit ends shortly before the minimum
            refitted = fit(replace(fit_data.build_problem(), target=target), refitted.composite)
        expected = refitted.composite.fitted_effects[0].values
        assert composite.fitted_effects[0].values == pytest.approx(expected, rel=0.01)


def test_a_step_out_of_the_range_of_the_linearisation_is_not_used(fit_data, fitted):
    search = make_search(fit_data)
    candidate = search.evaluate(fitted.composite, fitted.features)
    far = fitted.composite.with_values([100.0 * fitted.composite.fitted_effects[0].values])
    sessions = fit_data.sessions.value.shape[1]
    wrong = replace(candidate, prediction=replace(candidate.prediction, session_composites=(far,) * sessions))
    for features in wrong.predict_sessions(fit_data):
        assert features is candidate.features


def test_the_correct_effect_is_consistent_over_the_sessions(fit_data, fitted):
    search = make_search(fit_data)
    empty = search.evaluate(CompositeModel(), fit_data.state.mean)
    correct = search.evaluate(fitted.composite, fitted.features)
    found = compute_session_consistency(fit_data, correct.predict_sessions(fit_data), empty.predict_sessions(fit_data))
    assert found.amplitude == pytest.approx(1.0, abs=0.05)
    assert found.evidence > 5.0


def make_gains_of_sessions(fit_data: FitData, seed: int) -> FitData:
    """Return the pair with real sessions that are the simulation times gains: each taxel has another gain in each
    session, equal in all conditions.
    """
    model, bins = fit_data.state.mean, slice(0, fit_data.layout.bins)
    sessions, taxels = fit_data.sessions.value.shape[1], model.shape[2]
    gains = np.random.default_rng(seed).normal(1.0, 0.05, (sessions, taxels))
    value = np.repeat(model[:, None], sessions, axis=1)
    value[:, :, bins] *= gains[None, :, None]
    real = SessionMeans(value, fit_data.sessions.count, fit_data.sessions.repeat_variance)
    return FitData(fit_data.state, real, fit_data.layout)


def test_gains_that_change_between_sessions_are_no_evidence_for_a_gain_mismatch(fit_data):
    """The fitted gains follow the mean of the sessions, which predicts all conditions, but no further session."""
    amplitudes = []
    for seed in range(8):
        varied = make_gains_of_sessions(fit_data, seed)
        fitted = varied.fit_in_sample(CompositeModel((start_effect(varied.state, GainMismatch(TAXEL)),)))
        search = make_search(varied)
        empty = search.evaluate(CompositeModel(), varied.state.mean)
        gains = search.evaluate(fitted.composite, fitted.features)
        assert gains.held_out.sum() > empty.held_out.sum() + 5.0
        found = compute_session_consistency(varied, gains.predict_sessions(varied), empty.predict_sessions(varied))
        assert found.evidence < 5.0
        amplitudes.append(found.amplitude)
    assert np.mean(amplitudes) == pytest.approx(0.0, abs=0.2)
