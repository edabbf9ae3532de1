"""Measured touches come out of the emulated skin as they went in."""

import numpy as np
import pytest

from taxel.hand import load_hand
from taxel.hand.world import WorldSettings
from taxel.link import CaptureError
from taxel.recording import RecordingError, Tiling, TouchRecording, load_recording, recordings
from taxel.recording.replay import decode_capture, lead_in, replay_touches
from taxel.recording.scoring import SourceTouches, score_replay

ALLEGRO = load_hand("allegro")


def synthetic(touched_frames, frames=40, period_s=0.1):
    """A block of 3 x 4 cells is pressed during `touched_frames`; everything else is flat."""
    values = np.zeros((frames, 27, 15), np.int16)
    values[touched_frames, 10:13, 6:10] = 240
    return TouchRecording("synthetic", period_s * np.arange(frames), values, np.full(frames, "TAP"))


@pytest.mark.parametrize("name", recordings())
def test_measured_touches_come_out_as_they_went_in(name):
    score = replay_touches(load_recording(name), ALLEGRO, start_s=30.0, seconds=10.0)
    assert score.boards == 17
    assert score.true_positives > 100
    assert (score.false_positives, score.false_negatives, score.wrong_counts) == (0, 0, 0)
    assert score.f1 == 1.0
    assert score.at_steps < 0.1 * score.true_positives
    assert score.touches_missed == score.touches_unsampled
    assert score.touches_spurious == 0
    assert score.map_active.sum() > 0


@pytest.mark.parametrize("seed", [2, 3])
def test_boards_with_other_clocks_change_nothing(seed):
    score = replay_touches(load_recording("P2_index_right"), ALLEGRO, seconds=5.0, settings=WorldSettings(seed=seed))
    assert score.f1 == 1.0
    assert score.wrong_counts == 0


def test_known_touches_are_found_where_and_when_they_were():
    score = replay_touches(synthetic([*range(5, 10), *range(20, 22), 30]), ALLEGRO)
    assert (score.touches, score.touches_found, score.touches_spurious) == (3, 3, 0)
    assert score.f1 == 1.0
    assert score.onset_delay_s.max() < 0.1
    tiling = Tiling.of(ALLEGRO)
    pressed = np.zeros((27, 15), bool)
    pressed[10:13, 6:10] = True
    assert sorted(np.flatnonzero(score.map_active)) == sorted(tiling.taxel_of_cell[pressed.ravel()])
    assert np.nanmax(score.map_signal) == 240.0


def test_a_recording_without_touch_gives_no_activity():
    score = replay_touches(synthetic([]), ALLEGRO)
    assert (score.touches, score.touches_spurious, score.true_positives, score.false_positives) == (0, 0, 0, 0)


def test_a_capture_is_left_for_another_look_and_another_source_does_not_fit_it(tmp_path):
    recording = synthetic(range(5, 20))
    score = replay_touches(recording, ALLEGRO, folder=tmp_path)
    boards = decode_capture(tmp_path / "touches.capture", ALLEGRO, lead_in(ALLEGRO, WorldSettings()))
    tiling = Tiling.of(ALLEGRO)
    again = score_replay(SourceTouches(recording.time_s, tiling.spread(recording.values), 150.0), boards)
    assert str(again) == str(score)

    moved = np.roll(recording.values, 2, axis=2)
    wrong_place = score_replay(SourceTouches(recording.time_s, tiling.spread(moved), 150.0), boards)
    assert wrong_place.f1 < 0.6
    late = np.roll(recording.values, 5, axis=0)
    wrong_time = score_replay(SourceTouches(recording.time_s, tiling.spread(late), 150.0), boards)
    assert wrong_time.f1 < 0.8


def test_a_capture_is_never_overwritten(tmp_path):
    (tmp_path / "touches.capture").write_bytes(b"precious")
    with pytest.raises(CaptureError, match="exists already"):
        replay_touches(synthetic([5]), ALLEGRO, folder=tmp_path)
    assert (tmp_path / "touches.capture").read_bytes() == b"precious"


def test_no_frame_in_the_time_asked_for_is_refused():
    with pytest.raises(RecordingError, match=r"'synthetic': no frame from 100 s to 110 s; it lasts 3.9 s"):
        replay_touches(synthetic([5]), ALLEGRO, start_s=100.0, seconds=10.0)


def test_a_hand_too_small_is_refused():
    with pytest.raises(RecordingError, match="too small"):
        replay_touches(synthetic([5]), load_hand("flat8"))


def test_a_board_that_never_answers_is_named():
    with pytest.raises(
        RecordingError, match=r"board fingertip_thumb of hand 'allegro': expected 100 frames.*found 0 and 0"
    ):
        replay_touches(synthetic([5]), ALLEGRO, settings=WorldSettings(faults=("0 unplug 0x22",)))
