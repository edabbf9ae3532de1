"""Pressed and released are reported once, and never from a missing frame."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra import numpy as hnp

from taxel.signal import Activation, ActivationTracker, Baseline, ContactEvent

UP, DOWN = 1000, 800


@pytest.fixture
def tracker():
    return ActivationTracker(Activation([1000.0, 1000.0]))


def test_a_press_and_a_release_are_one_event_each(tracker):
    frames = [[UP, UP], [DOWN, UP], [DOWN, UP], [UP, DOWN]]
    assert [tracker.update(frame) for frame in frames] == [
        (),
        (ContactEvent(1, 0, "pressed"),),
        (),
        (ContactEvent(3, 0, "released"), ContactEvent(3, 1, "pressed")),
    ]


def test_the_first_sample_can_be_a_press(tracker):
    assert tracker.update([UP, DOWN]) == (ContactEvent(0, 1, "pressed"),)


def test_a_missing_frame_holds_the_state(tracker):
    tracker.update([DOWN, UP])
    assert tracker.update([UP, DOWN], valid=False) == ()
    assert tracker.active.tolist() == [True, False]
    assert tracker.update([DOWN, UP]) == ()


def test_a_change_during_a_gap_is_reported_after_it_with_its_own_index(tracker):
    tracker.update([DOWN, UP])
    tracker.update([0, 0], valid=False)
    assert tracker.update([UP, UP]) == (ContactEvent(2, 0, "released"),)


def test_a_taxel_can_be_missing_alone(tracker):
    assert tracker.update([DOWN, DOWN], valid=[False, True]) == (ContactEvent(0, 1, "pressed"),)
    assert tracker.known.tolist() == [False, True]


def test_a_touch_through_the_whole_baseline_is_known_after_its_release():
    baseline = Baseline(2)
    for _ in range(100):
        baseline.update([30_000, 29_600])
    baseline.require_undisturbed()
    tracker = ActivationTracker(Activation(baseline.mean))
    for frame in ([30_000, 29_600], [30_000, 30_000], [30_000, 29_600]):
        assert tracker.update(frame) == ()
    assert tracker.suspect_baseline.tolist() == [False, True]


def test_reset_starts_again_at_sample_0(tracker):
    tracker.update([DOWN, 1500])
    tracker.reset()
    assert tracker.samples == 0
    assert not (tracker.active | tracker.known | tracker.suspect_baseline).any()
    assert tracker.update([DOWN, UP]) == (ContactEvent(0, 0, "pressed"),)


def test_a_frame_that_is_refused_is_not_counted(tracker):
    with pytest.raises(ValueError, match="one frame"):
        tracker.update([[UP, UP]])
    with pytest.raises(ValueError, match="2 taxels"):
        tracker.update([UP])
    assert tracker.samples == 0


@given(hnp.arrays(np.bool_, (30, 3)), hnp.arrays(np.bool_, (30, 3)))
def test_replaying_the_events_gives_the_state_and_each_comes_from_a_valid_sample(down, valid):
    tracker = ActivationTracker(Activation([1000.0] * 3))
    state = np.zeros(3, np.bool_)
    for index in range(30):
        for event in tracker.update(np.where(down[index], DOWN, UP), valid[index]):
            assert event.sample == index
            assert valid[index, event.taxel]
            assert state[event.taxel] != (event.kind == "pressed")
            state[event.taxel] = event.kind == "pressed"
        assert tracker.active.tolist() == state.tolist()
        assert (state == down[index])[valid[index]].all()
