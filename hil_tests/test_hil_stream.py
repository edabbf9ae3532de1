"""Frames of all boards arrive in order and without losses."""

import itertools

import numpy as np

from taxel.skin import Skin

N_SCANS = 60


def test_no_frame_is_lost_in_sixty_scans(skin: Skin) -> None:
    for _ in itertools.islice(skin.scans(), N_SCANS):
        pass
    assert skin.losses.lost_on_wire == 0
    assert {address: count.missing for address, count in skin.losses.boards.items()} == {
        board.address: 0 for board in skin.hand.boards
    }


def test_every_scan_after_the_first_contains_all_boards(skin: Skin) -> None:
    scans = list(itertools.islice(skin.scans(), 10))
    assert all(scan.valid.all() for scan in scans[1:])


def test_cycles_of_a_board_are_consecutive_and_its_timestamps_increase(skin: Skin) -> None:
    last: dict[int, tuple[int, int]] = {}
    for frame in itertools.islice(skin, 200):
        if frame.address in last:
            cycle, board_time = last[frame.address]
            assert (frame.cycle - cycle) % 65536 == 1
            assert 0 < (frame.board_time_us - board_time) % 2**32 < 1_000_000
        last[frame.address] = (frame.cycle, frame.board_time_us)


def test_every_poll_has_one_outcome_in_the_counters_of_the_hub(skin: Skin) -> None:
    for _ in itertools.islice(skin.scans(), 30):
        pass
    skin.hub.read_status()
    for fields in skin.hub.board_status.values():
        outcomes = ("forwarded", "repeated", "nacks", "timeouts", "crc_errors", "bus_errors", "dropped")
        in_progress = fields["polls"] - sum(fields[name] for name in outcomes)
        assert in_progress in {0, 1}, fields


def test_rate_limit_of_5_hz_gives_one_scan_every_0_2_s(skin: Skin) -> None:
    skin.hub.set_rate(5.0)
    times = [scan.time_s for scan in itertools.islice(skin.scans(), 18)][12:]
    assert np.isclose(np.median(np.diff(times)), 0.2, rtol=0.05)


def test_streaming_resumes_after_one_restart_of_a_rebooted_hub(skin: Skin) -> None:
    skin.hub.reboot()
    for _ in itertools.islice(skin.scans(), 5):
        pass
    assert skin.losses.restarts == 1
