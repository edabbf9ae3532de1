"""A touch during the baseline is detected; noise, impulses and drift are not reported as a touch."""

import numpy as np
import pytest

from taxel.signal import Baseline, compute_baseline, find_disturbed_taxels

SKIN_TAXELS = 1073
SAMPLES = 100
BASELINE_COUNTS = 30_000
MAX_SIGMA = 28.0  # largest standard deviation of the white noise, counts
SEEDS = [1, 20_260, 3_141_592]


@pytest.fixture(params=SEEDS, ids=lambda seed: f"seed{seed}")
def rng(request):
    """Random generator of each seed."""
    print(f"seed {request.param}")
    return np.random.default_rng(request.param)


def make_untouched(rng, sigma=MAX_SIGMA, taxels=SKIN_TAXELS):
    """Make values f64[SAMPLES, taxels]: the baseline with white noise of `sigma` counts."""
    return BASELINE_COUNTS + sigma * rng.standard_normal((SAMPLES, taxels))


def to_counts(values):
    return np.rint(values).astype(np.uint16)


def add_touch(values, first_frame, length, counts):
    """Lower every taxel by `counts` for `length` frames from frame first_frame[taxel] on."""
    frame = np.arange(SAMPLES)[:, None]
    return values - counts * ((frame >= first_frame) & (frame < first_frame + length))


def test_white_noise_of_28_counts_is_not_reported_as_a_touch(rng):
    assert not find_disturbed_taxels(to_counts(make_untouched(rng, taxels=10 * SKIN_TAXELS))).any()


def test_a_drift_of_a_few_counts_is_not_reported_as_a_touch(rng):
    drift = np.linspace(0, 5, SAMPLES)[:, None]
    for sign in (-1, 1):
        assert not find_disturbed_taxels(to_counts(make_untouched(rng) + sign * drift)).any()


def test_single_sample_impulses_of_256_counts_are_not_reported_as_a_touch(rng):
    values = make_untouched(rng, sigma=10.0)
    sign = rng.choice([-256, 256], values.shape)
    assert not find_disturbed_taxels(to_counts(values + sign * (rng.random(values.shape) < 0.05))).any()


def test_impulses_with_the_largest_noise_are_not_reported_as_a_touch(rng):
    values = make_untouched(rng)
    values[rng.integers(0, SAMPLES, 3)] -= 256
    assert not find_disturbed_taxels(to_counts(values)).any()


@pytest.mark.parametrize("length", [10, 11, 20, 33, 50, 67, 80, 90])
def test_a_touch_of_150_counts_is_detected_with_the_largest_noise(rng, length):
    first_frame = rng.integers(0, SAMPLES - length + 1, SKIN_TAXELS)
    assert find_disturbed_taxels(to_counts(add_touch(make_untouched(rng), first_frame, length, 150))).all()


@pytest.mark.parametrize("length", range(10, 91))
def test_a_touch_of_150_counts_without_noise_is_detected_at_any_position(length):
    first_frame = np.arange(SAMPLES - length + 1)
    values = np.full((SAMPLES, first_frame.size), float(BASELINE_COUNTS))
    assert find_disturbed_taxels(to_counts(add_touch(values, first_frame, length, 150))).all()


def test_only_the_touched_taxels_are_reported(rng):
    raw = make_untouched(rng)
    is_touched = rng.random(SKIN_TAXELS) < 0.1
    raw[40:73, is_touched] -= 400
    assert find_disturbed_taxels(to_counts(raw)).tolist() == is_touched.tolist()


def test_short_taps_in_a_third_of_the_samples_are_detected(rng):
    values = make_untouched(rng)
    values[::3] -= 400
    assert find_disturbed_taxels(to_counts(values)).all()


def test_a_touch_that_ends_during_the_baseline_is_detected():
    values = np.full((SAMPLES, 1), BASELINE_COUNTS)
    values[:33] -= 400
    assert find_disturbed_taxels(to_counts(values)).tolist() == [True]


def test_missing_frames_do_not_hide_a_touch(rng):
    # A touch of 300 counts from frame 20 on, for 40 of 200 frames, about 30 % of which are missing (count 0).
    raw = to_counts(add_touch(make_untouched(rng), np.full(SKIN_TAXELS, 20), 40, 300))
    raw = np.concatenate([raw, to_counts(make_untouched(rng))])
    valid = rng.random(raw.shape) > 0.3
    raw[~valid] = 0
    baseline = Baseline(SKIN_TAXELS)
    for frame, mask in zip(raw, valid, strict=True):
        baseline.update(frame, mask)
    assert baseline.disturbed.all()
    assert compute_baseline(raw, valid).disturbed.all()


def test_missing_frames_are_not_reported_as_a_touch(rng):
    raw = to_counts(np.concatenate([make_untouched(rng), make_untouched(rng)]))
    valid = rng.random(raw.shape) > 0.3
    raw[~valid] = 0
    assert not compute_baseline(raw, valid).disturbed.any()


def test_a_touch_through_all_samples_is_not_detected(rng):
    assert not find_disturbed_taxels(to_counts(make_untouched(rng) - 400)).any()


def test_the_smallest_detected_touch_is_a_parameter():
    values = np.full((SAMPLES, 1), BASELINE_COUNTS)
    values[:40] -= 60  # counts; less than the default limit of 90
    raw = to_counts(values)
    assert not find_disturbed_taxels(raw).any()
    assert find_disturbed_taxels(raw, max_disturbance_counts=50).all()
    assert compute_baseline(raw, max_disturbance_counts=50).disturbed.all()


@pytest.mark.parametrize(
    ("samples", "limit", "message"),
    [
        (np.zeros((0, 2), np.uint16), 90.0, "at least 1 sample"),
        (np.zeros(4, np.uint16), 90.0, "shape"),
        (np.zeros((4, 2), np.uint16), -1.0, "max_disturbance_counts"),
    ],
)
def test_an_invalid_input_raises_a_one_line_error(samples, limit, message):
    with pytest.raises(ValueError, match=message) as caught:
        find_disturbed_taxels(samples, limit)
    assert "\n" not in str(caught.value)
