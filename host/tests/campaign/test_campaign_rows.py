"""Frames to rows: what a lost frame leaves, and counters that wrap or begin anew."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.campaign.rows import CLOCK_MODULUS_US, CYCLE_MODULUS, Rows, rows_of
from taxel.hand import load_hand
from taxel.stream import TaxelFrame

HAND = load_hand("allegro")
ADDRESSES = [board.address for board in HAND.boards]
PERIOD_S = 0.05


def frame(address: int, cycle: int, count: int | None = None, clock_us: int | None = None) -> TaxelFrame:
    """A frame of cycle number `cycle` before any wrap; every count of it is `count`."""
    size = HAND.board(address).kind.taxel_count
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


def of(rows: Rows, address: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(first taxel's counts, valid, clock) of a board."""
    where, column = HAND.slice_of(address), ADDRESSES.index(address)
    counts = rows.raw_counts[:, where]
    assert (counts == counts[:, :1]).all()
    return counts[:, 0], rows.valid[:, column], rows.sensor_time[:, column]


def slowly(frames: list[TaxelFrame], cycles: list[int]) -> Rows:
    """The same as `rows_of`, frame by frame; cycles: the true number of each frame's cycle."""
    present = sorted(set(cycles))
    rows = Rows(
        np.full(len(present), np.inf),
        np.zeros((len(present), HAND.n_taxels), np.uint16),
        np.zeros((len(present), len(ADDRESSES)), bool),
        np.zeros((len(present), len(ADDRESSES))),
    )
    for column, address in enumerate(ADDRESSES):
        own = {cycle: item for item, cycle in zip(frames, cycles, strict=True) if item.address == address}
        counts, clock, before = 0, 0.0, None
        for row, cycle in enumerate(present):
            if cycle in own:
                item = own[cycle]
                counts = int(item.raw_counts[0])
                step = 0 if before is None else (item.board_time_us - before) % CLOCK_MODULUS_US
                clock = item.board_time_us * 1e-6 if before is None else clock + step * 1e-6
                before = item.board_time_us
                rows.valid[row, column] = True
                rows.time_s[row] = min(rows.time_s[row], item.time_s)
            rows.raw_counts[row, HAND.slice_of(address)] = counts
            rows.sensor_time[row, column] = clock
    return rows


def test_no_frames_give_no_rows():
    rows = rows_of(HAND, [])
    assert rows.time_s.shape == (0,)
    assert rows.raw_counts.shape == (0, HAND.n_taxels)
    assert rows.valid.shape == rows.sensor_time.shape == (0, len(ADDRESSES))


def test_a_row_is_a_cycle_and_begins_with_its_first_scan():
    rows = rows_of(HAND, [frame(address, cycle) for cycle in range(3) for address in ADDRESSES])
    assert rows.valid.all()
    assert rows.time_s == pytest.approx(np.arange(3) * PERIOD_S + min(ADDRESSES) * 1e-5)
    for address in ADDRESSES:
        assert of(rows, address)[0].tolist() == [address, address + 1, address + 2]


def test_a_missing_board_repeats_its_last_counts_and_is_not_valid():
    here, there = ADDRESSES[:2]
    frames = [frame(here, cycle) for cycle in range(5)] + [frame(there, cycle, 500 + cycle) for cycle in (1, 3)]
    frames.sort(key=lambda item: item.time_s)
    counts, valid, clock = of(rows_of(HAND, frames), there)
    assert counts.tolist() == [0, 501, 501, 503, 503]
    assert valid.tolist() == [False, True, False, True, False]
    assert clock == pytest.approx([0.0, 0.05, 0.05, 0.15, 0.15])


def test_a_cycle_in_which_no_board_answered_is_no_row():
    rows = rows_of(HAND, [frame(ADDRESSES[0], cycle) for cycle in (0, 1, 4)])
    assert len(rows.time_s) == 3
    assert rows.valid[:, 0].all()
    assert not rows.valid[:, 1:].any()


def test_cycles_wrap():
    first = CYCLE_MODULUS - 2
    frames = [frame(address, cycle) for cycle in range(first, first + 5) for address in ADDRESSES]
    rows = rows_of(HAND, frames)
    assert rows.valid.all()
    assert np.diff(rows.time_s) == pytest.approx([PERIOD_S] * 4)


def test_a_board_that_is_first_heard_after_the_wrap_belongs_there():
    here, late = ADDRESSES[3], ADDRESSES[0]
    first = CYCLE_MODULUS - 2
    frames = [frame(here, cycle) for cycle in range(first, first + 6)]
    frames += [frame(late, cycle) for cycle in range(first + 3, first + 6)]
    _, valid, _ = of(rows_of(HAND, sorted(frames, key=lambda item: item.time_s)), late)
    assert valid.tolist() == [False] * 3 + [True] * 3


def test_boards_that_are_never_heard_together_keep_their_order():
    first, then = ADDRESSES[:2]
    begin = CYCLE_MODULUS - 100
    cycles = [*range(begin, begin + 5), *range(begin + 200, begin + 205)]
    frames = [frame(first, cycle) for cycle in cycles[:5]] + [frame(then, cycle) for cycle in cycles[5:]]
    rows = rows_of(HAND, frames)
    assert of(rows, first)[1].tolist() == [True] * 5 + [False] * 5
    assert of(rows, then)[1].tolist() == [False] * 5 + [True] * 5
    assert (np.diff(rows.time_s) > 0).all()


def test_a_hub_that_starts_anew_overwrites_no_row():
    address = ADDRESSES[0]
    frames = [frame(address, cycle) for cycle in range(1000, 1005)]
    frames += [frame(address, cycle)._replace(cycle=cycle - 1005) for cycle in range(1005, 1010)]
    rows = rows_of(HAND, frames)
    assert of(rows, address)[0].tolist() == [item.raw_counts[0] for item in frames]


def test_a_board_clock_wraps_and_one_that_starts_anew_goes_back():
    address = ADDRESSES[2]
    clocks = [CLOCK_MODULUS_US - 50_000, CLOCK_MODULUS_US, CLOCK_MODULUS_US + 50_000]
    _, _, clock = of(rows_of(HAND, [frame(address, k, 1, clock) for k, clock in enumerate(clocks)]), address)
    assert clock == pytest.approx(np.array(clocks) * 1e-6)
    _, _, clock = of(rows_of(HAND, [frame(address, k, 1, us) for k, us in enumerate([9_000_000, 40_000])]), address)
    assert clock == pytest.approx([9.0, 0.04])


def test_rows_between_two_times():
    rows = rows_of(HAND, [frame(ADDRESSES[0], cycle) for cycle in range(10)])
    part = rows.between(rows.time_s[2], rows.time_s[5])
    assert part.time_s.tolist() == rows.time_s[2:5].tolist()
    assert part.raw_counts.tolist() == rows.raw_counts[2:5].tolist()
    assert len(part.valid) == len(part.sensor_time) == 3
    assert len(rows.between(100.0, 200.0).time_s) == 0


@pytest.mark.parametrize("seed", range(12))
def test_random_losses_give_what_a_slow_reference_gives(seed):
    rng = np.random.default_rng(seed)
    print(f"seed {seed}")
    begin, clocks = int(rng.integers(0, 2 * CYCLE_MODULUS)), rng.integers(0, CLOCK_MODULUS_US, len(ADDRESSES))
    lost = rng.uniform(0.0, 1.0, len(ADDRESSES))
    frames, cycles = [], []
    for cycle in range(begin, begin + 40):
        for column, address in enumerate(ADDRESSES):
            if rng.random() >= lost[column] and not (column == 5 and cycle < begin + 20):
                clock = int(clocks[column]) + (cycle - begin) * 53_000_000
                frames.append(frame(address, cycle, int(rng.integers(0, 65536)), clock))
                cycles.append(cycle)
    found, wanted = rows_of(HAND, frames), slowly(frames, cycles)
    assert found.time_s.tolist() == wanted.time_s.tolist()
    assert (found.raw_counts == wanted.raw_counts).all()
    assert (found.valid == wanted.valid).all()
    assert found.sensor_time == pytest.approx(wanted.sensor_time)
