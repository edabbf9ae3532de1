"""Scoring of decoded touches: correct, wrong and undecidable samples, detected and spurious touches."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.recording.scoring import DecodedBoard, SourceTouches, score_replay

FRAME_S = 0.1
SAMPLE_S = 0.03
TAXELS = 6


def make_source(values):
    """Make a source with one row of taxel values every FRAME_S and an activation threshold of 150 counts."""
    values = np.asarray(values)
    return SourceTouches(FRAME_S * np.arange(len(values)), values, 150.0)


def decode_exactly(source, delay_s=0.0, taxels=slice(0, TAXELS), first_s=0.0101, sample_s=SAMPLE_S):
    """Make a board that measures the source without error, `delay_s` late.

    The board starts a scan every `sample_s`, from `first_s` on, and measures its taxels one after the other, 1 ms
    apart.
    """
    n = taxels.stop - taxels.start
    start_s = np.arange(first_s, source.time_s[-1] + FRAME_S, sample_s)
    sampled_s = start_s[:, None] + 1e-3 * np.arange(n)
    signal = source.values[source.find_rows_at(sampled_s - delay_s), np.arange(taxels.start, taxels.stop)].astype(float)
    return DecodedBoard(taxels, np.arange(len(start_s)), sampled_s, signal, signal > 150.0)


@pytest.fixture
def two_touches():
    """Source with a touch of taxel 1 (2 frames), and then of the taxels 3 (2 frames) and 4 (3 frames).

    Taxel 5 stays at the threshold.
    """
    values = np.zeros((12, TAXELS), dtype=int)
    values[2:4, 1] = 200
    values[6:8, 3] = 180
    values[6:9, 4] = 151
    values[:, 5] = 150
    return make_source(values)


def test_touches_are_runs_of_frames_with_an_active_taxel(two_touches):
    assert two_touches.n_touches == 2
    assert two_touches.onset_s.tolist() == pytest.approx([0.2, 0.6])


def test_value_at_the_threshold_is_no_touch():
    assert make_source([[150], [151], [150]]).onset_s.tolist() == pytest.approx([0.1])


def test_touch_in_the_first_frame_has_its_onset_there():
    source = make_source([[200], [0]])
    assert source.onset_s.tolist() == [0.0]
    assert not source.active[source.find_rows_at(np.array([-0.01]))].any()


def test_last_of_several_frames_with_the_same_time_is_used():
    source = SourceTouches(np.array([0.0, 0.1, 0.1, 0.2]), np.array([[0], [200], [0], [0]]), 150.0)
    assert source.n_touches == 0


def test_exact_decoding_has_precision_recall_and_f1_of_one(two_touches):
    score = score_replay(two_touches, [decode_exactly(two_touches)])
    assert (score.false_positives, score.false_negatives, score.wrong_counts) == (0, 0, 0)
    assert score.precision == score.recall == score.f1 == 1.0
    assert (score.touches, score.touches_found, score.touches_missed, score.touches_spurious) == (2, 2, 0, 0)
    assert score.samples == score.frames * TAXELS
    assert (score.onset_delay_s >= 0.0).all()
    assert (score.onset_delay_s <= SAMPLE_S).all()


def test_each_sample_is_counted_as_true_or_false_and_positive_or_negative():
    """In the source, only taxel 0 is touched, from 0.1 to 0.2 s. The second of four scans finds the touch, the third
    misses it, and the third and the fourth find a false touch of taxel 1. These three errors are also wrong counts.
    """
    source = make_source([[0, 0], [200, 0], [0, 0]])
    sampled_s = np.array([0.05, 0.12, 0.15, 0.25])[:, None].repeat(2, axis=1)
    active = np.array([[False, False], [True, False], [False, True], [False, True]])
    signal = np.where(active, 200.0, 0.0)
    score = score_replay(source, [DecodedBoard(slice(0, 2), np.arange(4), sampled_s, signal, active)])
    assert score.true_positives == 1
    assert score.false_negatives == 1
    assert score.false_positives == 2
    assert score.true_negatives == 4
    assert score.wrong_counts == 3
    assert score.precision == pytest.approx(1 / 3)
    assert score.recall == 0.5
    assert score.f1 == pytest.approx(0.4)


@pytest.mark.parametrize("is_active", [True, False])
def test_a_sample_at_a_step_of_the_source_is_accepted_with_either_value(is_active):
    """The source steps at 0.1 s and 0.2 s; the first and the last sample lie within 1.5 ms of a step."""
    source = make_source([[0], [200], [0]])
    sampled_s = np.array([[0.0995], [0.15], [0.2014]])
    active = np.array([[is_active], [True], [is_active]])
    score = score_replay(source, [DecodedBoard(slice(0, 1), np.arange(3), sampled_s, 200.0 * active, active)])
    assert (score.at_steps, score.true_positives) == (2, 1)
    assert (score.false_positives, score.false_negatives, score.wrong_counts) == (0, 0, 0)


def test_a_sample_outside_the_step_tolerance_is_scored():
    """The source steps at 0.1 s and 0.2 s; the first and the last sample are 2 ms away, the tolerance is 1.5 ms."""
    source = make_source([[0], [200], [0]])
    sampled_s = np.array([[0.098], [0.15], [0.202]])
    score = score_replay(
        source, [DecodedBoard(slice(0, 1), np.arange(3), sampled_s, np.full((3, 1), 200.0), np.ones((3, 1), bool))]
    )
    assert (score.at_steps, score.true_positives, score.false_positives) == (0, 1, 2)


def test_decoding_shifted_by_one_taxel_has_a_low_score(two_touches):
    good = decode_exactly(two_touches)
    shifted = replace(
        good, signal_counts=np.roll(good.signal_counts, 1, axis=1), active=np.roll(good.active, 1, axis=1)
    )
    score = score_replay(two_touches, [shifted])
    assert score.f1 < 0.5
    assert score.false_positives > 0
    assert score.false_negatives > 0
    assert score.wrong_counts > 0
    assert (score.touches_found, score.touches_missed) == (1, 1)  # the shift moves one of two neighbours onto the other


def test_decoding_one_frame_late_has_a_low_score(two_touches):
    """The touches last two and three frames, so that a delay of one frame moves up to half of their samples."""
    score = score_replay(two_touches, [decode_exactly(two_touches, delay_s=FRAME_S)])
    assert score.f1 < 0.8
    assert score.false_positives > 0
    assert score.false_negatives > 0
    assert score.onset_delay_s.min() >= FRAME_S


def test_a_skin_without_activity_misses_every_touch(two_touches):
    good = decode_exactly(two_touches)
    score = score_replay(two_touches, [replace(good, active=np.zeros_like(good.active))])
    assert (score.touches_found, score.touches_missed, score.touches_spurious) == (0, 2, 0)
    assert (score.recall, score.f1) == (0.0, 0.0)
    assert "no onset" in str(score)


def test_activity_far_from_any_touch_is_spurious(two_touches):
    good = decode_exactly(two_touches)
    active = good.active.copy()
    active[(good.sampled_s > 0.45) & (good.sampled_s < 0.55)] = True
    score = score_replay(two_touches, [replace(good, active=active)])
    assert (score.touches_found, score.touches_spurious) == (2, 1)
    assert score.precision < 1.0
    assert score.recall == 1.0


def test_touch_between_two_samples_is_counted_as_unsampled(two_touches):
    # Scans at 10 ms, 510 ms and 1010 ms; the touches last from 200 ms to 400 ms and from 600 ms to 900 ms.
    score = score_replay(two_touches, [decode_exactly(two_touches, sample_s=0.5)])
    assert (score.touches_found, score.touches_missed, score.touches_unsampled) == (0, 2, 2)
    assert score.f1 == 1.0


def test_boards_are_scored_together(two_touches):
    """The maps show the poll cycle with the most active taxels: 3 and 4. Taxel 5 is at the threshold, not active."""
    parts = [
        decode_exactly(two_touches, taxels=slice(0, 3)),
        decode_exactly(two_touches, taxels=slice(3, 6), first_s=0.0202),
    ]
    score = score_replay(two_touches, parts)
    assert (score.boards, score.touches_found, score.f1) == (2, 2, 1.0)
    assert score.map_active.tolist() == [False, False, False, True, True, False]
    assert score.map_signal.tolist() == [0.0, 0.0, 0.0, 180.0, 151.0, 150.0]


def test_board_without_a_frame_is_missing_in_the_map(two_touches):
    board = decode_exactly(two_touches, taxels=slice(3, 6))
    score = score_replay(two_touches, [board])
    assert np.isnan(score.map_signal).tolist() == [True, True, True, False, False, False]


def test_scoring_without_frames_is_refused(two_touches):
    with pytest.raises(ValueError, match="at least one board frame"):
        score_replay(two_touches, [])


def test_text_of_a_score_is_one_line(two_touches):
    text = str(score_replay(two_touches, [decode_exactly(two_touches)]))
    assert "\n" not in text
    assert "F1 1.0000" in text
    assert "touches 2 of 2 found, 0 missed, 0 spurious" in text
