"""Several causes in one dataset: each is reported, and none is reported for the model error of another."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from taxel.gap.data.pair import read_pair
from taxel.gap.data.prepare import compute_recording_means, prepare_pair
from taxel.gap.diagnosis import diagnose
from taxel.gap.effects.hysteresis import Hysteresis
from taxel.gap.effects.proximity import Proximity
from taxel.gap.effects.saturation import Saturation
from taxel.gap.fitting.composite import CompositeModel, FittedEffect

pytestmark = pytest.mark.slow

ROWS, COLUMNS = 6, 5


def blur_signal(signal_counts):
    boards = signal_counts.reshape(len(signal_counts), 2, ROWS, COLUMNS)
    return gaussian_filter(boards, (0, 0, 0.8, 0.8), mode="constant").reshape(signal_counts.shape)


def blur_and_clip(force, signal_counts):
    return np.minimum(blur_signal(signal_counts), 400.0)


def triple_signal(force, signal_counts):
    return 3.0 * signal_counts


def make_slow_noise(counts):
    """Return a raw effect: noise with this standard deviation and a correlation of 0.9 between frames."""

    def add_noise(raw, valid, rng):
        noise = rng.normal(0.0, 1.0, raw.shape)
        for frame in range(1, len(noise)):
            noise[frame] = 0.9 * noise[frame - 1] + np.sqrt(1.0 - 0.9**2) * noise[frame]
        return raw + counts * noise, valid

    return add_noise


@pytest.mark.parametrize("repeat_std", [0.03, 0.3])
def test_two_causes_and_strong_noise_are_all_reported(write_world, tmp_path, repeat_std):
    paths = write_world(
        tmp_path, effect=blur_and_clip, raw_effect=make_slow_noise(80.0), repeat_std=repeat_std, conditions=10
    )
    diagnosis = diagnose(*paths)
    verdict = diagnosis.report["verdict"]
    noise_effects = {"noise", "baseline_drift"}  # slow noise changes the means of a grasp, too
    assert set(verdict["effects"]) - noise_effects - {"unknown"} == {"contact_propagation", "saturation"}
    # `size`: gap that an effect alone produces, divided by the floor. Noise raises the floor, too, so its size is only
    # about 0.5, the smallest size of a cause.
    assert {name: diagnosis.comparison.effects[name].size for name in noise_effects} == pytest.approx(
        dict.fromkeys(noise_effects, 0.5), abs=0.3
    )
    assert sum(verdict["probabilities"][name] for name in noise_effects) > 0.3
    assert all(diagnosis.comparison.effects[name].weight > 0.99 for name in noise_effects)


@pytest.mark.parametrize("effect", [Saturation("clip"), Proximity("linear")], ids=lambda one: one.name)
def test_a_hysteresis_at_neutral_values_does_not_change_the_features_of_another_effect(get_world_paths, effect):
    state = prepare_pair(read_pair(*get_world_paths())).state
    hysteresis = Hysteresis("drop")
    active = FittedEffect(effect, effect.make_typical_values(state))
    neutral = FittedEffect(hysteresis, hysteresis.make_neutral_values(state))
    features_alone = CompositeModel.from_effects([active]).predict_features(state)
    features_with_neutral = CompositeModel.from_effects([active, neutral]).predict_features(state)
    np.testing.assert_array_equal(features_alone, features_with_neutral)


def test_onset_features_without_a_simulated_onset_have_zero_weight(get_world_paths):
    # Forces so small that only the real signal, which is tripled, reaches the threshold of an onset.
    pair = read_pair(*get_world_paths(effect=triple_signal, largest_force_n=0.03))
    fit_data = prepare_pair(pair)
    onset = fit_data.layout.onset
    real, simulated = (
        compute_recording_means(pair, one, fit_data.layout).mean[:, onset] for one in (pair.real, pair.sim)
    )
    is_only_real = np.isfinite(real) & ~np.isfinite(simulated)
    assert is_only_real.any()
    assert (fit_data.weight[:, onset][is_only_real] == 0.0).all()
    first_signal_bin = 0
    assert (fit_data.weight[:, first_signal_bin] > 0.0).all()
