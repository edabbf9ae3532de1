"""Each begin and each end of a contact is reported as one event, and never for a missing frame."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra import numpy as hnp

from taxel.signal import Activation, ActivationTracker, Baseline, ContactEvent

RELEASED, PRESSED = 1000, 800  # raw counts of a taxel with a baseline of 1000 counts


@pytest.fixture
def tracker():
    """Tracker of two taxels with a baseline of 1000 counts."""
    return ActivationTracker(Activation([1000.0, 1000.0]))


def test_a_contact_gives_one_pressed_and_one_released_event(tracker):
    frames = [[RELEASED, RELEASED], [PRESSED, RELEASED], [PRESSED, RELEASED], [RELEASED, PRESSED]]
    assert [tracker.update(frame) for frame in frames] == [
        (),
        (ContactEvent(1, 0, "pressed"),),
        (),
        (ContactEvent(3, 0, "released"), ContactEvent(3, 1, "pressed")),
    ]


def test_the_first_sample_can_give_a_pressed_event(tracker):
    assert tracker.update([RELEASED, PRESSED]) == (ContactEvent(0, 1, "pressed"),)


def test_a_missing_frame_gives_no_event_and_keeps_the_active_taxels(tracker):
    tracker.update([PRESSED, RELEASED])
    assert tracker.update([RELEASED, PRESSED], valid=False) == ()
    assert tracker.active.tolist() == [True, False]
    assert tracker.update([PRESSED, RELEASED]) == ()


def test_a_change_during_a_gap_is_reported_at_the_first_valid_sample_after_it(tracker):
    tracker.update([PRESSED, RELEASED])
    tracker.update([0, 0], valid=False)
    assert tracker.update([RELEASED, RELEASED]) == (ContactEvent(2, 0, "released"),)


def test_a_missing_taxel_gives_no_event_while_the_other_taxel_does(tracker):
    assert tracker.update([PRESSED, PRESSED], valid=[False, True]) == (ContactEvent(0, 1, "pressed"),)
    assert tracker.has_valid_sample.tolist() == [False, True]


def test_a_touch_through_the_whole_baseline_makes_the_baseline_suspect_after_its_release():
    baseline = Baseline(2)
    for _ in range(100):
        baseline.update([30_000, 29_600])  # taxel 1 is touched, which lowers its count by 400
    baseline.require_undisturbed()
    tracker = ActivationTracker(Activation(baseline.mean))
    for frame in ([30_000, 29_600], [30_000, 30_000], [30_000, 29_600]):
        assert tracker.update(frame) == ()
    assert tracker.suspect_baseline.tolist() == [False, True]


def test_reset_returns_to_sample_0(tracker):
    tracker.update([PRESSED, 1500])
    tracker.reset()
    assert tracker.samples == 0
    assert not (tracker.active | tracker.has_valid_sample | tracker.suspect_baseline).any()
    assert tracker.update([PRESSED, RELEASED]) == (ContactEvent(0, 0, "pressed"),)


def test_a_rejected_frame_is_not_counted(tracker):
    with pytest.raises(ValueError, match="one frame"):
        tracker.update([[RELEASED, RELEASED]])
    with pytest.raises(ValueError, match="2 taxels"):
        tracker.update([RELEASED])
    assert tracker.samples == 0


@given(hnp.arrays(np.bool_, (30, 3)), hnp.arrays(np.bool_, (30, 3)))
def test_the_events_reproduce_the_state_and_occur_only_at_valid_samples(is_pressed, valid):
    tracker = ActivationTracker(Activation([1000.0] * 3))
    state = np.zeros(3, np.bool_)
    for index in range(30):
        for event in tracker.update(np.where(is_pressed[index], PRESSED, RELEASED), valid[index]):
            assert event.sample == index
            assert valid[index, event.taxel]
            assert state[event.taxel] != (event.kind == "pressed")
            state[event.taxel] = event.kind == "pressed"
        assert tracker.active.tolist() == state.tolist()
        assert (state == is_pressed[index])[valid[index]].all()
