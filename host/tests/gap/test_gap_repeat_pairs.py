"""Variance of the mean of simulated repeats whose variation cancels in pairs."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.gap.data.time_grid import TimeGrid
from taxel.gap.features.features import FeatureLayout
from taxel.gap.features.repeat_pairs import estimate_pair_shares
from taxel.recording.grasp_format import Phase

CONDITIONS, REPEATS, TAXELS = 6, 8, 200


@pytest.fixture(scope="module")
def layout() -> FeatureLayout:
    """Layout of the features of grasps with closing and hold."""
    return FeatureLayout.from_time_grid(TimeGrid.from_durations({Phase.CLOSING: 2.0, Phase.HOLD: 2.0}, 30.0))


def make_features(layout: FeatureLayout, opposite: float) -> np.ndarray:
    """Return features f32[R, F, n] in counts. opposite: share of the deviation of a repeat 2 k that the repeat 2 k + 1
    has with the opposite sign; 0: all repeats are independent.
    """
    rng = np.random.default_rng(8)
    shape = CONDITIONS, REPEATS // 2, 2, layout.count, TAXELS
    values = 20.0 * rng.normal(size=shape)
    values[:, :, 1] = -opposite * values[:, :, 0] + np.sqrt(1.0 - opposite**2) * values[:, :, 1]
    return values.reshape(-1, *shape[3:]).astype(np.float32)


def estimate(features: np.ndarray, layout: FeatureLayout, repeats: int = REPEATS) -> np.ndarray:
    """Return the shares f64[5] of features with `repeats` grasps of each condition."""
    condition, iteration = np.repeat(np.arange(CONDITIONS), repeats), np.tile(np.arange(repeats), CONDITIONS)
    return estimate_pair_shares(features, condition, iteration, layout)


@pytest.mark.parametrize(("opposite", "share"), [(0.0, 1.0), (0.6, 0.4), (1.0, 0.0)])
def test_share_is_1_minus_the_negative_correlation_of_both_repeats(layout, opposite, share):
    assert estimate(make_features(layout, opposite), layout) == pytest.approx(share, abs=0.06)


def test_share_of_one_family_does_not_depend_on_the_others(layout):
    """The share is the ratio of two estimates of the variance of the mean: from pairs, and from single repeats.

    Repeats of a pair deviate in opposite directions (share 0), except in the onset features (share 1).
    """
    features = make_features(layout, 1.0)
    features[:, layout.onset] = make_features(layout, 0.0)[:, layout.onset]
    shares = dict(zip(("signal", "noise", "missing", "onset", "drift"), estimate(features, layout), strict=True))
    assert shares["onset"] == pytest.approx(1.0, abs=0.2)
    assert shares["signal"] == pytest.approx(0.0, abs=1e-6)


def test_repeats_without_a_partner_are_omitted(layout):
    """The repeats 2 k and 2 k + 1 deviate in opposite directions, so their mean does not vary: the variance share is 0.

    Repeat 2 has no partner, because repeat 3 is omitted.
    """
    features = make_features(layout, 1.0)
    condition, iteration = np.repeat(np.arange(CONDITIONS), REPEATS), np.tile(np.arange(REPEATS), CONDITIONS)
    kept = iteration != 3  # for example a faulty grasp
    shares = estimate_pair_shares(features[kept], condition[kept], iteration[kept], layout)
    assert shares == pytest.approx(0.0, abs=1e-6)


def test_share_is_1_without_two_pairs(layout):
    features = make_features(layout, 1.0).reshape(CONDITIONS, REPEATS, layout.count, TAXELS)[:, :3]
    np.testing.assert_array_equal(estimate(features.reshape(-1, layout.count, TAXELS), layout, repeats=3), 1.0)
