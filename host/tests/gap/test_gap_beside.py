"""Causes beside each other: none hides another, none is named for what another's model does not do."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from taxel.gap.data.pair import read_pair
from taxel.gap.data.prepare import means_of, prepared
from taxel.gap.diagnosis import diagnose
from taxel.gap.effects.hysteresis import Hysteresis
from taxel.gap.effects.proximity import Proximity
from taxel.gap.effects.saturation import Saturation
from taxel.gap.fitting.composite import CompositeModel, FittedEffect

pytestmark = pytest.mark.slow

ROWS, COLUMNS = 6, 5


def film(signal_counts):
    boards = signal_counts.reshape(len(signal_counts), 2, ROWS, COLUMNS)
    return gaussian_filter(boards, (0, 0, 0.8, 0.8), mode="constant").reshape(signal_counts.shape)


def film_that_ends(force, signal_counts):
    return np.minimum(film(signal_counts), 400.0)


def three_times(force, signal_counts):
    return 3.0 * signal_counts


def slow_noise(counts):
    """Noise of so many counts that hardly changes from frame to frame."""

    def after(raw, valid, rng):
        noise = rng.normal(0.0, 1.0, raw.shape)
        for frame in range(1, len(noise)):
            noise[frame] = 0.9 * noise[frame - 1] + np.sqrt(1.0 - 0.9**2) * noise[frame]
        return raw + counts * noise, valid

    return after


@pytest.mark.parametrize("scatter", [0.03, 0.3])
def test_two_causes_and_strong_noise_are_all_reported(world, tmp_path, scatter):
    paths = world(tmp_path, effect=film_that_ends, after=slow_noise(80.0), repeat_scatter=scatter, conditions=10)
    diagnosis = diagnose(*paths)
    verdict = diagnosis.report["verdict"]
    slow = {"noise", "baseline_drift"}  # slow noise changes the means of a grasp, too
    assert set(verdict["effects"]) - slow - {"unknown"} == {"contact_propagation", "saturation"}
    # The noise alone produces about half a floor, the limit of a cause, because it raises the floor as well.
    assert {name: diagnosis.comparison.effects[name].size for name in slow} == pytest.approx(
        dict.fromkeys(slow, 0.5), abs=0.3
    )
    assert sum(verdict["probabilities"][name] for name in slow) > 0.3
    assert all(diagnosis.comparison.effects[name].weight > 0.99 for name in slow)


@pytest.mark.parametrize("effect", [Saturation("clip"), Proximity("linear")], ids=lambda one: one.name)
def test_an_effect_at_neutral_values_does_not_change_a_composite_model(written, effect):
    state = prepared(read_pair(*written())).state
    sharp, idle = FittedEffect(effect, effect.typical(state)), Hysteresis("drop")
    alone, beside = CompositeModel.of([sharp]), CompositeModel.of([sharp, FittedEffect(idle, idle.neutral(state))])
    np.testing.assert_array_equal(alone.features(state), beside.features(state))


def test_onset_features_without_a_simulated_onset_have_zero_weight(written):
    pair = read_pair(*written(effect=three_times, most=0.03))
    judge = prepared(pair)
    onset = judge.layout.onset
    real, simulated = (means_of(pair, one, judge.layout).mean[:, onset] for one in (pair.real, pair.sim))
    hand_alone = np.isfinite(real) & ~np.isfinite(simulated)
    assert hand_alone.any()
    assert (judge.weight[:, onset][hand_alone] == 0.0).all()
    assert (judge.weight[:, 0] > 0.0).all()
