"""Grouping of frames by poll cycle: lost frames, and counters that wrap or restart."""

import numpy as np
import pytest

from taxel.campaign.poll_cycles import CLOCK_MODULUS_US, CYCLE_MODULUS, PollCycles, group_by_poll_cycle
from taxel.hand import load_hand
from taxel.stream import TaxelFrame

HAND = load_hand("allegro")
ADDRESSES = [board.address for board in HAND.boards]
PERIOD_S = 0.05


def make_frame(address: int, cycle: int, count: int | None = None, clock_us: int | None = None) -> TaxelFrame:
    """A frame of cycle number `cycle` before any wrap; every count of it is `count`."""
    size = HAND.get_board(address).kind.taxel_count
    value = cycle % 1000 + address if count is None else count
    clock = round(cycle * PERIOD_S * 1e6) if clock_us is None else clock_us
    return TaxelFrame(
        address,
        cycle % CYCLE_MODULUS,
        cycle % CYCLE_MODULUS,
        cycle * PERIOD_S + address * 1e-5,
        clock % CLOCK_MODULUS_US,
        0,
        np.full(size, value, np.uint16),
    )


def read_board_columns(rows: PollCycles, address: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(counts of the first taxel, valid, clock) of a board."""
    taxels, column = HAND.get_slice(address), ADDRESSES.index(address)
    counts = rows.raw_counts[:, taxels]
    assert (counts == counts[:, :1]).all()
    return counts[:, 0], rows.valid[:, column], rows.sensor_time[:, column]


def group_frame_by_frame(frames: list[TaxelFrame], cycles: list[int]) -> PollCycles:
    """Reference for `group_by_poll_cycle`. cycles: the true cycle number of each frame."""
    present = sorted(set(cycles))
    rows = PollCycles(
        np.full(len(present), np.inf),
        np.zeros((len(present), HAND.n_taxels), np.uint16),
        np.zeros((len(present), len(ADDRESSES)), bool),
        np.zeros((len(present), len(ADDRESSES))),
    )
    for column, address in enumerate(ADDRESSES):
        by_cycle = {cycle: frame for frame, cycle in zip(frames, cycles, strict=True) if frame.address == address}
        counts, clock, previous_us = 0, 0.0, None
        for row, cycle in enumerate(present):
            if cycle in by_cycle:
                frame = by_cycle[cycle]
                counts = int(frame.raw_counts[0])
                step_us = 0 if previous_us is None else (frame.board_time_us - previous_us) % CLOCK_MODULUS_US
                clock = frame.board_time_us * 1e-6 if previous_us is None else clock + step_us * 1e-6
                previous_us = frame.board_time_us
                rows.valid[row, column] = True
                rows.time_s[row] = min(rows.time_s[row], frame.time_s)
            rows.raw_counts[row, HAND.get_slice(address)] = counts
            rows.sensor_time[row, column] = clock
    return rows


def test_no_frames_give_no_rows():
    rows = group_by_poll_cycle(HAND, [])
    assert rows.time_s.shape == (0,)
    assert rows.raw_counts.shape == (0, HAND.n_taxels)
    assert rows.valid.shape == rows.sensor_time.shape == (0, len(ADDRESSES))


def test_a_row_is_one_cycle_and_its_time_is_that_of_the_first_scan():
    rows = group_by_poll_cycle(HAND, [make_frame(address, cycle) for cycle in range(3) for address in ADDRESSES])
    assert rows.valid.all()
    assert rows.time_s == pytest.approx(np.arange(3) * PERIOD_S + min(ADDRESSES) * 1e-5)
    for address in ADDRESSES:
        assert read_board_columns(rows, address)[0].tolist() == [address, address + 1, address + 2]


def test_a_missing_frame_repeats_the_latest_counts_and_is_not_valid():
    complete, incomplete = ADDRESSES[:2]
    frames = [make_frame(complete, cycle) for cycle in range(5)]
    frames += [make_frame(incomplete, cycle, 500 + cycle) for cycle in (1, 3)]
    frames.sort(key=lambda frame: frame.time_s)
    counts, valid, clock = read_board_columns(group_by_poll_cycle(HAND, frames), incomplete)
    assert counts.tolist() == [0, 501, 501, 503, 503]
    assert valid.tolist() == [False, True, False, True, False]
    assert clock == pytest.approx([0.0, 0.05, 0.05, 0.15, 0.15])


def test_a_cycle_without_frames_gives_no_row():
    rows = group_by_poll_cycle(HAND, [make_frame(ADDRESSES[0], cycle) for cycle in (0, 1, 4)])
    assert len(rows.time_s) == 3
    assert rows.valid[:, 0].all()
    assert not rows.valid[:, 1:].any()


def test_rows_are_contiguous_across_a_wrap_of_the_cycle_number():
    first_cycle = CYCLE_MODULUS - 2
    frames = [make_frame(address, cycle) for cycle in range(first_cycle, first_cycle + 5) for address in ADDRESSES]
    rows = group_by_poll_cycle(HAND, frames)
    assert rows.valid.all()
    assert np.diff(rows.time_s) == pytest.approx([PERIOD_S] * 4)


def test_the_first_frame_of_a_board_after_the_wrap_is_in_the_right_cycle():
    early_board, late_board = ADDRESSES[3], ADDRESSES[0]
    first_cycle = CYCLE_MODULUS - 2
    frames = [make_frame(early_board, cycle) for cycle in range(first_cycle, first_cycle + 6)]
    frames += [make_frame(late_board, cycle) for cycle in range(first_cycle + 3, first_cycle + 6)]
    _, valid, _ = read_board_columns(
        group_by_poll_cycle(HAND, sorted(frames, key=lambda frame: frame.time_s)), late_board
    )
    assert valid.tolist() == [False] * 3 + [True] * 3


def test_boards_without_a_common_cycle_keep_their_order():
    first_board, second_board = ADDRESSES[:2]
    first_cycle = CYCLE_MODULUS - 100
    cycles = [*range(first_cycle, first_cycle + 5), *range(first_cycle + 200, first_cycle + 205)]
    frames = [make_frame(first_board, cycle) for cycle in cycles[:5]] + [
        make_frame(second_board, cycle) for cycle in cycles[5:]
    ]
    rows = group_by_poll_cycle(HAND, frames)
    assert read_board_columns(rows, first_board)[1].tolist() == [True] * 5 + [False] * 5
    assert read_board_columns(rows, second_board)[1].tolist() == [False] * 5 + [True] * 5
    assert (np.diff(rows.time_s) > 0).all()


def test_a_restarted_hub_overwrites_no_row():
    address = ADDRESSES[0]
    frames = [make_frame(address, cycle) for cycle in range(1000, 1005)]
    frames += [make_frame(address, cycle)._replace(cycle=cycle - 1005) for cycle in range(1005, 1010)]
    rows = group_by_poll_cycle(HAND, frames)
    assert read_board_columns(rows, address)[0].tolist() == [frame.raw_counts[0] for frame in frames]


def test_the_clock_of_a_board_wraps_and_steps_back_at_a_restart():
    address = ADDRESSES[2]

    def read_board_clock(clocks_us: list[int]) -> np.ndarray:
        frames = [make_frame(address, cycle, 1, clock_us) for cycle, clock_us in enumerate(clocks_us)]
        return read_board_columns(group_by_poll_cycle(HAND, frames), address)[2]

    wrapping = [CLOCK_MODULUS_US - 50_000, CLOCK_MODULUS_US, CLOCK_MODULUS_US + 50_000]
    assert read_board_clock(wrapping) == pytest.approx(np.array(wrapping) * 1e-6)
    assert read_board_clock([9_000_000, 40_000]) == pytest.approx([9.0, 0.04])


def test_between_selects_rows_by_time():
    rows = group_by_poll_cycle(HAND, [make_frame(ADDRESSES[0], cycle) for cycle in range(10)])
    selection = rows.between(rows.time_s[2], rows.time_s[5])
    assert selection.time_s.tolist() == rows.time_s[2:5].tolist()
    assert selection.raw_counts.tolist() == rows.raw_counts[2:5].tolist()
    assert len(selection.valid) == len(selection.sensor_time) == 3
    assert len(rows.between(100.0, 200.0).time_s) == 0


@pytest.mark.parametrize("seed", range(12))
def test_random_losses_agree_with_the_frame_by_frame_reference(seed):
    rng = np.random.default_rng(seed)
    print(f"seed {seed}")
    first_cycle, clocks = int(rng.integers(0, 2 * CYCLE_MODULUS)), rng.integers(0, CLOCK_MODULUS_US, len(ADDRESSES))
    loss_rate = rng.uniform(0.0, 1.0, len(ADDRESSES))
    frames, cycles = [], []
    for cycle in range(first_cycle, first_cycle + 40):
        for column, address in enumerate(ADDRESSES):
            if rng.random() >= loss_rate[column] and not (column == 5 and cycle < first_cycle + 20):
                clock = int(clocks[column]) + (cycle - first_cycle) * 53_000_000
                frames.append(make_frame(address, cycle, int(rng.integers(0, 65536)), clock))
                cycles.append(cycle)
    rows, reference = group_by_poll_cycle(HAND, frames), group_frame_by_frame(frames, cycles)
    assert rows.time_s.tolist() == reference.time_s.tolist()
    assert (rows.raw_counts == reference.raw_counts).all()
    assert (rows.valid == reference.valid).all()
    assert rows.sensor_time == pytest.approx(reference.sensor_time)
