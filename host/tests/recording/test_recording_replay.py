"""Replay of measured touches on the emulated skin: the decoded touches equal the recording."""

import numpy as np
import pytest

from taxel.hand import load_hand
from taxel.hand.world import WorldSettings
from taxel.link import CaptureError
from taxel.recording import RecordingError, Tiling, TouchRecording, list_recordings, load_recording
from taxel.recording.replay import ReplayOptions, compute_lead_in_s, decode_capture, replay_touches
from taxel.recording.scoring import SourceTouches, score_replay

ALLEGRO = load_hand("allegro")


def make_touch_recording(touched_frames, frames=40, period_s=0.1):
    """Make a recording in which 3 x 4 neighbouring panel values are touched during `touched_frames`."""
    values = np.zeros((frames, 27, 15), np.int16)
    values[touched_frames, 10:13, 6:10] = 240
    return TouchRecording("synthetic", period_s * np.arange(frames), values, np.full(frames, "TAP"))


@pytest.mark.parametrize("name", list_recordings())
def test_measured_touches_are_decoded_without_error(name):
    """Only touches that lie between two samples are missed.

    For a sample at a step of the source, the values before and after the step are both accepted; such samples are few.
    """
    score = replay_touches(load_recording(name), ALLEGRO, ReplayOptions(start_s=30.0, seconds=10.0))
    assert score.boards == 17
    assert score.true_positives > 100
    assert (score.false_positives, score.false_negatives, score.wrong_counts) == (0, 0, 0)
    assert score.f1 == 1.0
    assert score.at_steps < 0.1 * score.true_positives
    assert score.touches_missed == score.touches_unsampled
    assert score.touches_spurious == 0
    assert score.map_active.sum() > 0


@pytest.mark.parametrize("seed", [2, 3])
def test_clock_errors_of_the_boards_do_not_change_the_score(seed):
    """The seed of the emulated world determines the rate errors of the boards' clocks."""
    options = ReplayOptions(seconds=5.0, settings=WorldSettings(seed=seed))
    score = replay_touches(load_recording("P2_index_right"), ALLEGRO, options)
    assert score.f1 == 1.0
    assert score.wrong_counts == 0


def test_synthetic_touches_are_found_at_their_taxels_and_times():
    """Three touches (frames 5 to 9, 20 to 21, and 30) of panel rows 10 to 12 and columns 6 to 9, 240 counts each."""
    score = replay_touches(make_touch_recording([*range(5, 10), *range(20, 22), 30]), ALLEGRO)
    assert (score.touches, score.touches_found, score.touches_spurious) == (3, 3, 0)
    assert score.f1 == 1.0
    assert score.onset_delay_s.max() < 0.1
    tiling = Tiling.for_hand(ALLEGRO)
    is_touched = np.zeros((27, 15), bool)
    is_touched[10:13, 6:10] = True
    assert sorted(np.flatnonzero(score.map_active)) == sorted(tiling.taxel_of_cell[is_touched.ravel()])
    assert np.nanmax(score.map_signal) == 240.0


def test_recording_without_touch_gives_no_activity():
    score = replay_touches(make_touch_recording([]), ALLEGRO)
    assert (score.touches, score.touches_spurious, score.true_positives, score.false_positives) == (0, 0, 0, 0)


def test_kept_capture_gives_the_same_score_and_a_lower_one_for_another_source(tmp_path):
    recording = make_touch_recording(range(5, 20))
    score = replay_touches(recording, ALLEGRO, folder=tmp_path)
    boards = decode_capture(tmp_path / "touches.capture", ALLEGRO, compute_lead_in_s(ALLEGRO, WorldSettings()))
    tiling = Tiling.for_hand(ALLEGRO)
    repeated = score_replay(SourceTouches(recording.time_s, tiling.to_taxels(recording.values), 150.0), boards)
    assert str(repeated) == str(score)

    # The same capture does not agree with a source moved by two columns, or delayed by five frames.
    moved = np.roll(recording.values, 2, axis=2)
    wrong_position = score_replay(SourceTouches(recording.time_s, tiling.to_taxels(moved), 150.0), boards)
    assert wrong_position.f1 < 0.6
    late = np.roll(recording.values, 5, axis=0)
    wrong_time = score_replay(SourceTouches(recording.time_s, tiling.to_taxels(late), 150.0), boards)
    assert wrong_time.f1 < 0.8


def test_existing_capture_is_not_overwritten(tmp_path):
    (tmp_path / "touches.capture").write_bytes(b"existing")
    with pytest.raises(CaptureError, match="exists already"):
        replay_touches(make_touch_recording([5]), ALLEGRO, folder=tmp_path)
    assert (tmp_path / "touches.capture").read_bytes() == b"existing"


def test_time_without_frames_is_refused():
    with pytest.raises(RecordingError, match=r"'synthetic': no frame from 100 s to 110 s; it lasts 3.9 s"):
        replay_touches(make_touch_recording([5]), ALLEGRO, ReplayOptions(start_s=100.0, seconds=10.0))


def test_hand_that_is_too_small_is_refused():
    with pytest.raises(RecordingError, match="too small"):
        replay_touches(make_touch_recording([5]), load_hand("flat8"))


def test_board_that_does_not_respond_is_named():
    """The thumb's fingertip board (0x22) is unplugged from 0 s on: no frames for the baseline, none after it."""
    with pytest.raises(
        RecordingError, match=r"board fingertip_thumb of hand 'allegro': expected 100 frames.*found 0 and 0"
    ):
        replay_touches(
            make_touch_recording([5]), ALLEGRO, ReplayOptions(settings=WorldSettings(faults=("0 unplug 0x22",)))
        )
