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
    """Make a frame of a board. cycle: number of its poll cycle, without wraps.

    count: value of all counts of the frame; None: a value that depends on cycle and board. clock_us: time of the
    board's clock, without wraps; None: `PERIOD_S` per cycle.
    """
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


def read_board_columns(grouped: PollCycles, address: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the counts of a board's first taxel, the validity and the clock of the board, for each poll cycle.

    Asserts that all taxels of the board have equal counts.
    """
    taxels, column = HAND.get_slice(address), ADDRESSES.index(address)
    counts = grouped.raw_counts[:, taxels]
    assert (counts == counts[:, :1]).all()
    return counts[:, 0], grouped.valid[:, column], grouped.sensor_time[:, column]


def group_frame_by_frame(frames: list[TaxelFrame], cycles: list[int]) -> PollCycles:
    """Group frames by poll cycle with a simple loop, as a reference for `group_by_poll_cycle`.

    cycles: the true cycle number of each frame.
    """
    present = sorted(set(cycles))
    grouped = PollCycles(
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
                grouped.valid[row, column] = True
                grouped.time_s[row] = min(grouped.time_s[row], frame.time_s)
            grouped.raw_counts[row, HAND.get_slice(address)] = counts
            grouped.sensor_time[row, column] = clock
    return grouped


def test_no_frames_give_no_poll_cycles():
    grouped = group_by_poll_cycle(HAND, [])
    assert grouped.time_s.shape == (0,)
    assert grouped.raw_counts.shape == (0, HAND.n_taxels)
    assert grouped.valid.shape == grouped.sensor_time.shape == (0, len(ADDRESSES))


def test_the_frames_of_a_cycle_are_grouped_with_the_time_of_the_first_scan():
    """`make_frame` sets the time of a frame to cycle * PERIOD_S + address * 1e-5 s, and its counts to
    cycle + address.
    """
    grouped = group_by_poll_cycle(HAND, [make_frame(address, cycle) for cycle in range(3) for address in ADDRESSES])
    assert grouped.valid.all()
    assert grouped.time_s == pytest.approx(np.arange(3) * PERIOD_S + min(ADDRESSES) * 1e-5)
    for address in ADDRESSES:
        assert read_board_columns(grouped, address)[0].tolist() == [address, address + 1, address + 2]


def test_a_missing_frame_repeats_the_latest_counts_and_is_not_valid():
    """The counts of the incomplete board are 500 + cycle, and 0 before its first frame; a cycle takes 0.05 s."""
    complete, incomplete = ADDRESSES[:2]
    frames = [make_frame(complete, cycle) for cycle in range(5)]
    frames += [make_frame(incomplete, cycle, 500 + cycle) for cycle in (1, 3)]
    frames.sort(key=lambda frame: frame.time_s)
    counts, valid, clock = read_board_columns(group_by_poll_cycle(HAND, frames), incomplete)
    assert counts.tolist() == [0, 501, 501, 503, 503]
    assert valid.tolist() == [False, True, False, True, False]
    assert clock == pytest.approx([0.0, 0.05, 0.05, 0.15, 0.15])


def test_a_cycle_without_frames_is_omitted():
    grouped = group_by_poll_cycle(HAND, [make_frame(ADDRESSES[0], cycle) for cycle in (0, 1, 4)])
    assert len(grouped.time_s) == 3
    assert grouped.valid[:, 0].all()
    assert not grouped.valid[:, 1:].any()


def test_no_cycle_is_lost_when_the_cycle_number_wraps():
    first_cycle = CYCLE_MODULUS - 2
    frames = [make_frame(address, cycle) for cycle in range(first_cycle, first_cycle + 5) for address in ADDRESSES]
    grouped = group_by_poll_cycle(HAND, frames)
    assert grouped.valid.all()
    assert np.diff(grouped.time_s) == pytest.approx([PERIOD_S] * 4)


def test_a_board_whose_first_frame_arrives_after_the_wrap_is_in_the_correct_cycles():
    early_board, late_board = ADDRESSES[3], ADDRESSES[0]
    first_cycle = CYCLE_MODULUS - 2
    frames = [make_frame(early_board, cycle) for cycle in range(first_cycle, first_cycle + 6)]
    frames += [make_frame(late_board, cycle) for cycle in range(first_cycle + 3, first_cycle + 6)]
    _, valid, _ = read_board_columns(
        group_by_poll_cycle(HAND, sorted(frames, key=lambda frame: frame.time_s)), late_board
    )
    assert valid.tolist() == [False] * 3 + [True] * 3


def test_boards_without_a_common_cycle_keep_their_order():
    """The second board sends 200 cycles after the first one; the 16-bit cycle number wraps between them."""
    first_board, second_board = ADDRESSES[:2]
    first_cycle = CYCLE_MODULUS - 100
    cycles = [*range(first_cycle, first_cycle + 5), *range(first_cycle + 200, first_cycle + 205)]
    frames = [make_frame(first_board, cycle) for cycle in cycles[:5]] + [
        make_frame(second_board, cycle) for cycle in cycles[5:]
    ]
    grouped = group_by_poll_cycle(HAND, frames)
    assert read_board_columns(grouped, first_board)[1].tolist() == [True] * 5 + [False] * 5
    assert read_board_columns(grouped, second_board)[1].tolist() == [False] * 5 + [True] * 5
    assert (np.diff(grouped.time_s) > 0).all()


def test_frames_of_a_restarted_hub_overwrite_no_earlier_frames():
    """After the first five frames the hub restarts, so that its cycle numbers begin at 0 again."""
    address = ADDRESSES[0]
    frames = [make_frame(address, cycle) for cycle in range(1000, 1005)]
    frames += [make_frame(address, cycle)._replace(cycle=cycle - 1005) for cycle in range(1005, 1010)]
    grouped = group_by_poll_cycle(HAND, frames)
    assert read_board_columns(grouped, address)[0].tolist() == [frame.raw_counts[0] for frame in frames]


def test_the_time_of_a_board_continues_across_a_wrap_and_steps_back_at_a_restart():
    address = ADDRESSES[2]

    def read_board_clock(clocks_us: list[int]) -> np.ndarray:
        frames = [make_frame(address, cycle, 1, clock_us) for cycle, clock_us in enumerate(clocks_us)]
        return read_board_columns(group_by_poll_cycle(HAND, frames), address)[2]

    # times of the board's 32-bit clock, without wraps
    wrapping = [CLOCK_MODULUS_US - 50_000, CLOCK_MODULUS_US, CLOCK_MODULUS_US + 50_000]
    assert read_board_clock(wrapping) == pytest.approx(np.array(wrapping) * 1e-6)
    assert read_board_clock([9_000_000, 40_000]) == pytest.approx([9.0, 0.04])


def test_between_selects_poll_cycles_by_time():
    grouped = group_by_poll_cycle(HAND, [make_frame(ADDRESSES[0], cycle) for cycle in range(10)])
    selection = grouped.between(grouped.time_s[2], grouped.time_s[5])
    assert selection.time_s.tolist() == grouped.time_s[2:5].tolist()
    assert selection.raw_counts.tolist() == grouped.raw_counts[2:5].tolist()
    assert len(selection.valid) == len(selection.sensor_time) == 3
    assert len(grouped.between(100.0, 200.0).time_s) == 0


@pytest.mark.parametrize("seed", range(12))
def test_random_losses_agree_with_the_frame_by_frame_reference(seed):
    """One board starts 20 cycles late. A clock step of 53 s in each cycle makes many of the 32-bit clocks wrap."""
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
    grouped, reference = group_by_poll_cycle(HAND, frames), group_frame_by_frame(frames, cycles)
    assert grouped.time_s.tolist() == reference.time_s.tolist()
    assert (grouped.raw_counts == reference.raw_counts).all()
    assert (grouped.valid == reference.valid).all()
    assert grouped.sensor_time == pytest.approx(reference.sensor_time)
