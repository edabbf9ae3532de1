"""Activation: a signal strictly above the threshold; missing and saturated taxels are separate states."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from taxel.signal import ACTIVATION_THRESHOLD_COUNTS, Activation, compute_baseline


def test_a_signal_of_exactly_150_counts_is_not_active():
    frame = Activation([1000.0, 1000.0, 1000.0])(np.array([851, 850, 849], np.uint16))
    assert ACTIVATION_THRESHOLD_COUNTS == 150.0
    assert frame.signal_counts.tolist() == [149.0, 150.0, 151.0]
    assert frame.active.tolist() == [False, False, True]


def test_a_fraction_of_a_count_above_150_is_active():
    frame = Activation([1000.0, 1000.01])(np.array([850, 850], np.uint16))
    assert frame.active.tolist() == [False, True]


def test_the_threshold_is_a_parameter():
    frame = Activation([1000.0, 1000.0], threshold=20)([980, 979])
    assert frame.active.tolist() == [False, True]


def test_a_missing_taxel_is_neither_active_nor_inactive():
    frame = Activation([1000.0] * 3)([500, 500, 1000], valid=[True, False, True])
    assert frame.active.tolist() == [True, False, False]
    assert frame.missing.tolist() == [False, True, False]
    assert np.isnan(frame.signal_counts).tolist() == [False, True, False]


def test_a_taxel_of_a_missing_frame_is_only_missing_and_neither_active_nor_saturated():
    frame = Activation([1000.0] * 2)([0, 65_535], valid=False)
    assert frame.missing.all()
    assert not (frame.active | frame.saturated | frame.suspect_baseline).any()


def test_a_nan_count_is_reported_as_missing():
    frame = Activation([1000.0] * 2)(np.array([np.nan, 1000.0]))
    assert frame.missing.tolist() == [True, False]


def test_a_saturated_taxel_can_be_active():
    frame = Activation([1000.0, 1000.0, 65_500.0])([0, 1, 65_535])
    assert frame.saturated.tolist() == [True, False, True]
    assert frame.active.tolist() == [True, True, False]


def test_the_saturation_floor_is_per_taxel():
    activation = Activation([1000.0] * 3, saturation_floor_counts=[400, 300, 0])
    frame = activation([400, 400, 400])
    assert frame.saturated.tolist() == [True, False, False]  # a count at or below the floor of its taxel
    assert frame.active.all()


def test_a_scalar_saturation_floor_applies_to_all_taxels():
    assert Activation([1000.0] * 2, saturation_floor_counts=50)([50, 51]).saturated.tolist() == [True, False]


def test_a_count_above_the_baseline_by_more_than_the_threshold_makes_the_baseline_suspect():
    frame = Activation([1000.0] * 3)([1150, 1151, 849])
    assert frame.suspect_baseline.tolist() == [False, True, False]


def test_a_touch_through_the_whole_baseline_makes_the_baseline_suspect_after_its_release():
    touched = np.full((100, 2), 30_000, np.uint16)
    touched[:, 1] -= 400
    baseline = compute_baseline(touched)
    assert not baseline.disturbed.any()
    # The count of the released taxel 1 exceeds its baseline by 400, but contact can only lower a count.
    released = Activation(baseline.mean)(np.full(2, 30_000, np.uint16))
    assert released.suspect_baseline.tolist() == [False, True]


@given(
    hnp.arrays(np.uint16, (7, 3)),
    hnp.arrays(np.bool_, (7, 3)),
    hnp.arrays(np.float64, 3, elements=st.floats(0, 65_535)),
)
def test_a_block_of_frames_gives_the_same_result_as_its_single_frames(raw, valid, mean):
    activation = Activation(mean)
    block = activation(raw, valid)
    for index in range(7):
        frame = activation(raw[index], valid[index])
        for field in ("signal_counts", "active", "missing", "saturated", "suspect_baseline"):
            assert getattr(block, field)[index].tobytes() == getattr(frame, field).tobytes()


def test_the_validity_of_a_frame_applies_to_all_its_taxels():
    block = Activation([1000.0] * 2)(np.full((3, 2), 800), valid=np.array([True, False, True]))
    assert block.missing.tolist() == [[False] * 2, [True] * 2, [False] * 2]


def test_the_baseline_array_of_the_caller_is_copied():
    mean = np.array([1000.0])
    activation = Activation(mean)
    mean[:] = 0.0
    assert activation([800]).active.tolist() == [True]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Activation([1.0, np.nan]), "found nan at taxel 1"),
        (lambda: Activation([np.inf]), "baseline_mean"),
        (lambda: Activation([]), "baseline_mean"),
        (lambda: Activation([[1.0]]), "baseline_mean"),
        (lambda: Activation([1.0], threshold=0), "threshold"),
        (lambda: Activation([1.0], threshold=-150), "threshold"),
        (lambda: Activation([1.0], threshold=float("nan")), "threshold"),
        (lambda: Activation([1.0], saturation_floor_counts=[1, 2]), "saturation_floor_counts"),
        (lambda: Activation([1.0], saturation_floor_counts=-1), "saturation_floor_counts"),
        (lambda: Activation([1.0])([1, 2]), "1 taxels"),
        (lambda: Activation([1.0])(5), "raw_counts"),
        (lambda: Activation([1.0])([-1]), "raw_counts"),
        (lambda: Activation([1.0])([65_535.5]), "raw_counts"),
        (lambda: Activation([1.0])([True]), "raw_counts"),
        (lambda: Activation([1.0])([1], valid=[1]), "valid"),
    ],
)
def test_an_invalid_input_raises_a_one_line_error(call, message):
    with pytest.raises(ValueError, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)
