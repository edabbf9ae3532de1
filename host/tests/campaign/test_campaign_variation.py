"""Variation between repeats: scaling of unit samples, and the balanced design of the simulator."""

import numpy as np
import pytest

from taxel.campaign.variation import FACTORS, Variation, sample_balanced_variation, sample_grasp_variation
from taxel.hand.transforms import to_rotation_vector


def make_design(repeats: int, seed: int = 1, name: str = "cylinder top") -> np.ndarray:
    """Make the balanced unit samples f64[repeats, 7] of the first repeats of a grasp."""
    return np.stack([sample_balanced_variation(seed, name, repeat) for repeat in range(repeats)])


def test_unit_samples_are_scaled_to_metres_radians_and_a_grip_factor():
    variation = Variation(object_m=1e-3, object_rad=0.02, grip=0.1)
    offset, grip = variation.apply(np.array([1.0, -2.0, 0.0, 0.0, 1.0, 0.0, -0.5]))
    np.testing.assert_allclose(offset[:3, 3], [1e-3, -2e-3, 0.0], atol=1e-15)
    np.testing.assert_allclose(to_rotation_vector(offset), [0.0, 0.02, 0.0], atol=1e-12)
    assert grip == pytest.approx(0.95)


def test_the_grip_factor_is_never_negative():
    assert Variation(grip=0.1).apply(np.full(FACTORS, -100.0))[1] == 0.0


def test_the_factor_of_an_object_scales_its_motion_but_not_the_grip():
    variation = Variation(object_m=1e-3, object_rad=0.02, grip=0.1, objects=(("cylinder", 0.5),))
    sample = np.array([1.0, -2.0, 0.0, 0.0, 1.0, 0.0, -0.5])
    assert variation.for_object("cylinder") == Variation(object_m=0.5e-3, object_rad=0.01, grip=0.1)
    assert variation.for_object("cylinder").apply(sample)[1] == variation.for_object("wedge").apply(sample)[1]
    np.testing.assert_array_equal(variation.for_object("wedge").apply(sample)[0], variation.apply(sample)[0])


@pytest.mark.parametrize("repeats", [2, 6, 8, 10, 16])
def test_an_even_number_of_repeats_has_zero_mean_and_unit_variance(repeats):
    samples = make_design(repeats)
    np.testing.assert_array_equal(samples.mean(axis=0), 0.0)
    np.testing.assert_array_equal(samples.var(axis=0), 1.0)


def test_sixteen_repeats_confound_no_two_factors():
    samples = make_design(16)
    np.testing.assert_allclose(samples.T @ samples / 16, np.eye(FACTORS), atol=1e-12)


def test_seed_and_name_determine_the_signs():
    assert (make_design(4) == make_design(4)).all()
    keys = [(seed, name) for seed in (1, 2) for name in ("cylinder top", "cylinder side_1")]
    assert len({make_design(16, seed, name).tobytes() for seed, name in keys}) == len(keys)


def test_repeated_attempts_have_new_samples_and_the_first_attempt_has_those_of_the_grasp():
    """The random generator of a first attempt has the seed [seed of the campaign, 2, id of the grasp].

    The samples of a balanced design are signs, +1 or -1.
    """
    samples = [sample_grasp_variation(1, "s0_00", attempt) for attempt in range(3)]
    np.testing.assert_array_equal(samples[0], np.random.default_rng([1, 2, *b"s0_00"]).normal(size=FACTORS))
    assert len({sample.tobytes() for sample in samples}) == 3
    signs = [sample_balanced_variation(1, "cylinder top", 0, attempt) for attempt in range(3)]
    np.testing.assert_array_equal(signs[0], sample_balanced_variation(1, "cylinder top", 0))
    assert all(set(np.abs(sign)) == {1.0} for sign in signs)
    assert len({sign.tobytes() for sign in signs}) == 3
