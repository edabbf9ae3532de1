"""Readings and advice of the monitor for a skin with known frames."""

import json

import numpy as np
import pytest

from taxel.stream import BoardCount


def test_touch_between_two_readings_is_reported_in_the_next_reading_only(fake_skin):
    skin = fake_skin()
    skin.pass_time(1.0)
    assert not skin.read().active.any()
    skin.raw[7] -= 400
    skin.pass_time(0.05)
    skin.raw[7] += 400
    skin.pass_time(0.05)
    reading = skin.read()
    assert np.flatnonzero(reading.active).tolist() == [7]
    assert reading.signal_counts[7] == 400.0
    assert reading.boards[0].largest_signal == reading.largest_signal == 400.0
    skin.pass_time(0.05)
    assert not skin.read().active.any()  # the touch is reported once


def test_signal_equal_to_the_threshold_is_not_active(fake_skin):
    skin = fake_skin()
    skin.pass_time(1.0)
    # The threshold is 150 counts.
    skin.raw[3] -= 150
    skin.raw[4] -= 151
    skin.pass_time(0.1)
    assert np.flatnonzero(skin.read().active).tolist() == [4]


def test_rates_equal_the_rate_of_the_frames(fake_skin):
    skin = fake_skin()
    for _ in range(30):
        skin.pass_time(0.1)
        reading = skin.read()
    assert reading.scans_hz == pytest.approx(20.0)
    assert reading.frames_hz == pytest.approx(20.0 * 17)
    assert reading.frames == 60 * 17
    assert reading.boards_streaming == 17


def test_board_connected_later_has_its_own_baseline(fake_skin):
    skin = fake_skin()
    *first_boards, late_board = skin.hand.boards
    skin.pass_time(2.0, first_boards)
    reading = skin.read()
    assert reading.is_measuring
    assert reading.boards[-1].state == "no frame yet"
    assert np.isnan(reading.signal_counts[skin.hand.get_slice(late_board.address)]).all()
    skin.pass_time(0.1)
    assert skin.read().boards[-1].baseline_progress == pytest.approx(2 / 3)  # 0.1 s: 2 frames of a baseline of 3
    skin.pass_time(0.1)
    reading = skin.read()
    assert reading.boards[-1].state == "streaming"
    assert (reading.signal_counts == 0.0).all()


def test_signals_and_rate_of_a_silent_board_are_removed_and_the_advice_names_it(fake_skin):
    skin = fake_skin()
    skin.pass_time(1.0)
    skin.raw[0] -= 500
    skin.pass_time(0.2)
    assert skin.read().active[0]
    skin.pass_time(1.2, skin.hand.boards[1:])
    reading = skin.read()
    assert reading.boards[0].state == "silent"
    assert reading.boards[0].rate_hz == 0.0
    assert np.isnan(reading.signal_counts[0])
    assert not reading.active.any()
    assert "palm (0x20)" in reading.advice


def test_restarted_baseline_contains_only_frames_after_the_request(fake_skin):
    skin = fake_skin()
    skin.pass_time(1.0)
    skin.raw[:] -= 300
    skin.pass_time(0.2)
    assert skin.read().active.all()
    skin.monitor.restart_baseline()
    skin.pass_time(0.05)
    assert skin.read().baseline_progress == pytest.approx(1 / 3)  # 0.05 s: the first frame of a baseline of 3
    skin.pass_time(0.2)
    reading = skin.read()
    assert reading.is_measuring
    assert not reading.active.any()


def test_rates_of_a_recorded_stream_follow_the_clock_of_the_stream(fake_skin):
    skin = fake_skin(is_real_time=False, is_recorded=True)
    skin.now_s = 100.0
    for _ in range(20):
        skin.pass_time(0.2)
        reading = skin.monitor.read(5e4)  # the time of the call is ignored
    assert reading.scans_hz == pytest.approx(20.0)
    assert reading.age_s is None
    assert reading.boards_streaming == 17


def test_reading_has_the_counters_of_stream_and_hub(fake_skin):
    skin = fake_skin(counts={0x20: BoardCount(received=10, missing=2, damaged=1)})
    skin.losses.lost_on_wire = 5
    skin.hub.status = {"frames_dropped": 3, "bus_recoveries": 1, "cycle_time_us": 50_000}
    bus_faults = {"nacks": 4, "timeouts": 3, "crc_errors": 2, "bus_errors": 1}
    skin.hub.board_status[0x20] = {"state": 2, **bus_faults}
    skin.pass_time(1.0)
    reading = skin.read()
    assert (reading.missing, reading.damaged, reading.lost_on_wire) == (2, 1, 5)
    assert (reading.hub_dropped, reading.bus_recoveries, reading.cycle_s) == (3, 1, pytest.approx(0.05))
    assert reading.boards[0].bus_faults == 10
    values = json.loads(json.dumps(reading.as_dict(), allow_nan=False))
    assert values["missing"] == 2
    assert values["boards"][0]["bus_faults"] == 10


def read_advice_after(skin, seconds=3.0, boards=None):
    """Pass frames of these boards (None: all) for some seconds, and return the advice of the next reading."""
    if seconds:
        skin.pass_time(seconds, boards)
    return skin.read().advice


def test_healthy_skin_causes_no_advice(fake_skin):
    assert read_advice_after(fake_skin()) is None


def test_advice_distinguishes_missing_boards_from_missing_frames(fake_skin):
    skin = fake_skin()
    assert read_advice_after(skin, 1.0, boards=()) is None  # boards may still be starting
    assert "the hub reports 17 boards, but no frame arrives" in read_advice_after(skin, 2.0, boards=())
    skin.hub.boards.clear()
    assert "none of the 17 boards does" in skin.read().advice


def test_advice_states_the_duration_without_frames(fake_skin):
    skin = fake_skin()
    skin.pass_time(2.0)
    skin.now_s += 7.0
    assert "no frames for 7 s" in skin.read().advice


def test_advice_names_a_branch_whose_boards_stop_together(fake_skin):
    skin = fake_skin()
    skin.pass_time(2.0)
    skin.pass_time(2.0, [board for board in skin.hand.boards if board.branch != "index"])
    assert skin.read().advice.startswith("branch fault: no response from branch index (all 5 boards: 0x23, 0x26, ")


def test_advice_names_single_boards_that_stop_one_after_the_other(fake_skin):
    skin = fake_skin()
    boards = list(skin.hand.boards)
    for board in skin.hand.find_branch("pinkie"):
        boards.remove(board)
        skin.pass_time(1.2, boards)
    assert skin.read().advice.startswith("no response from fingertip_pinkie (0x25), proximal_front_pinkie (0x28)")


def test_advice_of_a_responding_hub_without_boards_names_the_branches(fake_skin):
    skin = fake_skin()
    skin.pass_time(2.0)
    skin.now_s += 7.0
    skin.hub.seconds_since_message = 0.5
    assert "disconnect the branches one at a time" in skin.read().advice


def test_advice_states_the_progress_of_the_baseline(fake_skin):
    skin = fake_skin()
    assert "baseline 67 % complete: do not touch the skin" in read_advice_after(skin, 0.1)


def test_advice_reports_touches_during_the_baseline(fake_skin):
    skin = fake_skin()
    skin.raw[:9] -= 2000
    skin.pass_time(0.05)
    skin.raw[:9] += 2000
    assert "9 taxels were touched during the baseline" in read_advice_after(skin)


def test_advice_reports_counts_above_the_baseline(fake_skin):
    skin = fake_skin()
    skin.pass_time(1.0)
    skin.read()
    skin.raw[:5] += 400
    assert "5 taxels are above their baseline" in read_advice_after(skin)


def test_advice_reports_a_reader_that_is_too_slow(fake_skin):
    assert "300000 bytes wait" in read_advice_after(fake_skin(bytes_waiting=300_000))


def test_advice_reports_the_end_of_the_stream(fake_skin):
    skin = fake_skin(is_real_time=False, is_recorded=True)
    assert skin.monitor.read(skin.now_s, is_ended=True).advice.startswith("fake has ended without a frame")
    skin.pass_time(1.0)
    assert skin.monitor.read(skin.now_s, is_ended=True).advice == "fake has ended"
