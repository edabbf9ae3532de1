"""The baseline is the mean of the first valid samples of each taxel, from a stream or from a recording."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from taxel.signal import (
    BASELINE_SAMPLES,
    Baseline,
    DisturbedBaselineError,
    TooFewSamplesError,
    compute_baseline,
)


@st.composite
def sample_recordings(draw):
    """Strategy for (raw counts u16[frames, taxels], valid mask of the same shape, number of baseline samples)."""
    frames, taxels = draw(st.integers(1, 40)), draw(st.integers(1, 5))
    raw = draw(hnp.arrays(np.uint16, (frames, taxels)))
    valid = draw(hnp.arrays(np.bool_, (frames, taxels)))
    return raw, valid, draw(st.integers(2, 30))


def stream_baseline(raw, valid, samples):
    """Return the baseline after the update with each frame in turn."""
    baseline = Baseline(raw.shape[1], samples)
    for frame, mask in zip(raw, valid, strict=True):
        baseline.update(frame, mask)
    return baseline


@given(sample_recordings())
def test_streamed_and_vectorised_baselines_are_identical(recording):
    raw, valid, samples = recording
    baseline = stream_baseline(raw, valid, samples)
    if not baseline.is_ready:
        with pytest.raises(TooFewSamplesError) as caught:
            compute_baseline(raw, valid, samples)
        assert (caught.value.needed, caught.value.found) == (samples, valid.sum(axis=0).min())
        return
    result = compute_baseline(raw, valid, samples)
    assert baseline.mean.tobytes() == result.mean.tobytes()
    assert baseline.noise.tobytes() == result.noise.tobytes()
    assert baseline.disturbed.tolist() == result.disturbed.tolist()
    assert result.count.tolist() == [samples] * raw.shape[1]


@given(sample_recordings())
def test_mean_and_noise_equal_exact_rational_arithmetic(recording):
    raw, valid, samples = recording
    baseline = stream_baseline(raw, valid, samples)
    for taxel in range(raw.shape[1]):
        counts = raw[valid[:, taxel], taxel].tolist()[:samples]
        if len(counts) < samples:
            assert not baseline.ready_mask[taxel]
            assert np.isnan(baseline.mean[taxel])
            assert np.isnan(baseline.noise[taxel])
            assert not baseline.disturbed[taxel]
            continue
        mean = Fraction(sum(counts), samples)
        variance = sum((Fraction(count) - mean) ** 2 for count in counts) / (samples - 1)
        assert baseline.ready_mask[taxel]
        assert baseline.mean[taxel] == float(mean)
        assert baseline.noise[taxel] == pytest.approx(float(variance) ** 0.5, rel=1e-14)


def test_the_default_baseline_is_ready_after_100_samples():
    baseline = Baseline(2)
    ready = [baseline.update(np.array([1000, 2000], np.uint16)) for _ in range(BASELINE_SAMPLES)]
    assert BASELINE_SAMPLES == 100
    assert ready == [False] * 99 + [True]
    assert baseline.mean.tolist() == [1000.0, 2000.0]
    assert baseline.noise.tolist() == [0.0, 0.0]


def test_sums_are_exact_for_the_largest_counts_and_the_longest_baseline():
    """46,340 samples of u16 counts are the most whose sums fit in 63 bits (`MAX_BASELINE_SAMPLES`)."""
    raw = np.full((46_340, 1), 65_535, np.uint16)
    raw[0] = 65_534
    result = compute_baseline(raw, samples=46_340)
    assert result.mean[0] == float(65_535 - Fraction(1, 46_340))
    assert result.noise[0] == pytest.approx(46_340**-0.5, rel=1e-12)


def test_a_missing_frame_is_ignored():
    baseline = Baseline(1, samples=2)
    baseline.update([100])
    baseline.update([60_000], valid=False)
    assert baseline.progress == 0.5
    assert baseline.update([104])
    assert baseline.mean.tolist() == [102.0]


def test_samples_are_counted_per_taxel():
    baseline = Baseline(2, samples=2)
    baseline.update([10, 20], valid=[True, False])
    baseline.update([12, 22])
    assert baseline.ready_mask.tolist() == [True, False]
    assert baseline.count.tolist() == [2, 1]
    assert baseline.progress == 0.75
    assert baseline.update([9_000, 24])
    assert baseline.mean.tolist() == [11.0, 23.0]


def test_the_validity_of_a_frame_has_the_effect_of_the_same_validity_of_each_taxel():
    raw = np.arange(12, dtype=np.uint16).reshape(6, 2)
    frames = np.array([True, False, True, True, False, True])
    by_frame = compute_baseline(raw, frames, samples=3)
    by_taxel = compute_baseline(raw, np.repeat(frames[:, None], 2, axis=1), samples=3)
    # The valid frames are [0, 1], [4, 5] and [6, 7].
    assert by_frame.mean.tolist() == by_taxel.mean.tolist() == [10 / 3, 13 / 3]


def test_frames_after_completion_are_ignored():
    baseline = Baseline(1, samples=2)
    for count in (10, 12, 5_000, 5_000):
        baseline.update([count])
    assert baseline.mean.tolist() == [11.0]
    assert baseline.is_ready


def test_reset_discards_all_samples():
    baseline = Baseline(1, samples=2)
    baseline.update([10])
    baseline.update([12])
    baseline.reset()
    assert (baseline.is_ready, baseline.progress) == (False, 0.0)
    baseline.update([20])
    baseline.update([22])
    assert baseline.mean.tolist() == [21.0]


def make_touched_recording():
    """Make counts u16[100 frames, 8 taxels]: the first seven taxels are touched for a third of the frames."""
    raw = np.full((100, 8), 30_000, np.uint16)
    raw[30:63, :7] -= 400
    return raw


def test_a_disturbed_baseline_keeps_its_mean_and_raises_on_request():
    raw = make_touched_recording()
    result = compute_baseline(raw)
    # Seven taxels are 400 counts lower in 33 of 100 frames, which lowers their mean by 132 counts.
    assert result.mean.tolist() == [30_000.0 - 0.33 * 400.0] * 7 + [30_000.0]
    with pytest.raises(DisturbedBaselineError) as caught:
        result.require_undisturbed()
    assert str(caught.value) == (
        "baseline disturbed on 7 of 8 taxels (0, 1, 2, 3, 4, ...); "
        "remove all objects from the skin and repeat the baseline"
    )
    assert caught.value.taxels == [0, 1, 2, 3, 4, 5, 6]


def test_a_streamed_disturbed_baseline_raises_on_request():
    raw = make_touched_recording()
    baseline = stream_baseline(raw, np.ones(raw.shape, np.bool_), 100)
    with pytest.raises(DisturbedBaselineError):
        baseline.require_undisturbed()


def test_an_incomplete_baseline_raises_too_few_samples():
    baseline = Baseline(3)
    baseline.update([1, 2, 3], valid=[True, False, True])
    with pytest.raises(TooFewSamplesError, match=r"taxel 1: expected 100 valid samples, found 0") as caught:
        baseline.require_undisturbed()
    assert (caught.value.taxel, caught.value.needed, caught.value.found) == (1, 100, 0)


def test_a_result_does_not_change_when_its_baseline_is_reset():
    baseline = Baseline(1, samples=2)
    baseline.update([10])
    baseline.update([12])
    result = baseline.result()
    baseline.reset()
    assert (result.mean.tolist(), result.count.tolist()) == ([11.0], [2])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Baseline(0), "n_taxels"),
        (lambda: Baseline(3, samples=1), "samples"),
        (lambda: Baseline(3, samples=46_341), "samples"),
        (lambda: Baseline(3, max_disturbance_counts=0), "max_disturbance_counts"),
        (lambda: Baseline(3, max_disturbance_counts=float("nan")), "max_disturbance_counts"),
        (lambda: Baseline(3).update([1, 2]), "3 taxels"),
        (lambda: Baseline(3).update([[1, 2, 3]]), "raw_counts"),
        (lambda: Baseline(3).update([1.0, 2.0, 3.0]), "float64"),
        (lambda: Baseline(3).update([1, 2, 65_536]), "65535"),
        (lambda: Baseline(3).update([1, 2, -1]), "raw_counts"),
        (lambda: Baseline(3).update([1, 2, 3], valid=[True]), "valid"),
        (lambda: Baseline(3).update([1, 2, 3], valid=[1, 1, 0]), "valid"),
        (lambda: compute_baseline(np.zeros((5, 0), np.uint16)), "at least 1 taxel"),
        (lambda: compute_baseline(np.zeros(5, np.uint16)), "raw_counts"),
        (lambda: compute_baseline(np.zeros((5, 2), np.uint16), np.ones(2, np.bool_)), "valid"),
    ],
)
def test_an_invalid_input_raises_a_one_line_error(call, message):
    with pytest.raises(ValueError, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)
