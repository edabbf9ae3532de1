"""What the monitor says of a skin whose every frame is known."""

from __future__ import annotations

import json

import numpy as np
import pytest

from taxel.stream import BoardCount


def test_a_touch_between_two_readings_is_seen(puppet):
    skin = puppet()
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
    assert not skin.read().active.any()  # and it is told once


def test_the_threshold_is_exceeded_strictly(puppet):
    skin = puppet()
    skin.pass_time(1.0)
    skin.raw[3] -= 150
    skin.raw[4] -= 151
    skin.pass_time(0.1)
    assert np.flatnonzero(skin.read().active).tolist() == [4]


def test_rates_are_those_of_the_frames(puppet):
    skin = puppet()
    for _ in range(30):
        skin.pass_time(0.1)
        reading = skin.read()
    assert reading.scans_hz == pytest.approx(20.0)
    assert reading.frames_hz == pytest.approx(20.0 * 17)
    assert reading.frames == 60 * 17
    assert reading.boards_streaming == 17


def test_a_board_that_is_plugged_in_later_takes_its_own_baseline(puppet):
    skin = puppet()
    *first, late = skin.hand.boards
    skin.pass_time(2.0, first)
    reading = skin.read()
    assert reading.is_measuring
    assert reading.boards[-1].state == "no frame yet"
    assert np.isnan(reading.signal_counts[skin.hand.get_slice(late.address)]).all()
    skin.pass_time(0.1)
    assert skin.read().boards[-1].baseline == pytest.approx(2 / 3)
    skin.pass_time(0.1)
    reading = skin.read()
    assert reading.boards[-1].state == "streaming"
    assert (reading.signal_counts == 0.0).all()


def test_a_silent_boards_last_words_are_not_shown(puppet):
    skin = puppet()
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


def test_the_baseline_can_be_taken_again(puppet):
    skin = puppet()
    skin.pass_time(1.0)
    skin.raw[:] -= 300
    skin.pass_time(0.2)
    assert skin.read().active.all()
    skin.monitor.begin_baseline()
    skin.pass_time(0.05)
    assert skin.read().baseline == pytest.approx(1 / 3)
    skin.pass_time(0.2)
    reading = skin.read()
    assert reading.is_measuring
    assert not reading.active.any()


def test_a_recorded_streams_clock_is_its_own(puppet):
    skin = puppet(is_real_time=False, is_recorded=True)
    skin.now_s = 100.0
    for _ in range(20):
        skin.pass_time(0.2)
        reading = skin.monitor.read(5e4)  # the user's clock is of no matter
    assert reading.scans_hz == pytest.approx(20.0)
    assert reading.age_s is None
    assert reading.boards_streaming == 17


def test_counts_of_stream_and_hub_are_handed_on(puppet):
    skin = puppet(counts={0x20: BoardCount(10, 2, 1)})
    skin.losses.lost_on_wire = 5
    skin.hub.status = {"frames_dropped": 3, "bus_recoveries": 1, "cycle_time_us": 50_000}
    kinds = {"nacks": 4, "timeouts": 3, "crc_errors": 2, "bus_errors": 1}
    skin.hub.board_status[0x20] = {"state": 2, **kinds}
    skin.pass_time(1.0)
    reading = skin.read()
    assert (reading.missing, reading.damaged, reading.lost_on_wire) == (2, 1, 5)
    assert (reading.hub_dropped, reading.bus_recoveries, reading.cycle_s) == (3, 1, pytest.approx(0.05))
    assert reading.boards[0].bus_faults == 10
    said = json.loads(json.dumps(reading.as_dict(), allow_nan=False))
    assert said["missing"] == 2
    assert said["boards"][0]["bus_faults"] == 10


def advice(skin, seconds=3.0, boards=None):
    if seconds:
        skin.pass_time(seconds, boards)
    return skin.read().advice


def test_all_is_well_needs_no_advice(puppet):
    assert advice(puppet()) is None


def test_a_hub_without_boards_is_told_from_boards_without_frames(puppet):
    skin = puppet()
    assert advice(skin, 1.0, boards=()) is None  # they may still be starting
    assert "the hub knows 17 boards, but no frame comes" in advice(skin, 2.0, boards=())
    skin.hub.boards.clear()
    assert "none of the 17 boards does" in skin.read().advice


def test_silence_is_told_with_its_length(puppet):
    skin = puppet()
    skin.pass_time(2.0)
    skin.now_s += 7.0
    assert "no frames for 7 s" in skin.read().advice


def test_the_baselines_progress_is_told(puppet):
    skin = puppet()
    assert "taking the baseline, 67 %: do not touch the skin" in advice(skin, 0.1)


def test_a_baseline_that_was_touched_is_told(puppet):
    skin = puppet()
    skin.raw[:9] -= 2000
    skin.pass_time(0.05)
    skin.raw[:9] += 2000
    assert "9 taxels were touched while the baseline was taken" in advice(skin)


def test_a_skin_that_rests_above_its_baseline_is_told(puppet):
    skin = puppet()
    skin.pass_time(1.0)
    skin.read()
    skin.raw[:5] += 400
    assert "5 taxels rest above their baseline" in advice(skin)


def test_a_reader_that_is_too_slow_is_told(puppet):
    assert "300000 bytes wait" in advice(puppet(bytes_waiting=300_000))


def test_the_end_is_told(puppet):
    skin = puppet(is_real_time=False, is_recorded=True)
    assert skin.monitor.read(skin.now_s, is_ended=True).advice.startswith("puppet has ended without a frame")
    skin.pass_time(1.0)
    assert skin.monitor.read(skin.now_s, is_ended=True).advice == "puppet has ended"
