"""The boards of a capture as arrays, compared with the frames of the skin, and their activation."""

import numpy as np
import pytest

from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link import run_emulator, write_stimulus
from taxel.recording import read_activity, read_boards
from taxel.signal import Activation, compute_baseline
from taxel.skin import open_skin
from taxel.stream.start_script import START_S, write_start_script

SAMPLES = 20
"""Frames of a baseline."""
CLOCK_READING_S = 1.6
"""Time in which the hub reads the clocks of all 17 boards once."""
TOUCHED_TAXEL = 5


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """A capture of 3 s; a force acts on one taxel from 2.5 s."""
    folder = tmp_path_factory.mktemp("capture")
    hand = load_hand("original")
    forces = np.zeros((3, hand.n_taxels))
    forces[2, TOUCHED_TAXEL] = 2.0
    write_stimulus(folder / "press.stm", [0.0, 2.5, 2.6], forces)
    write_start_script(folder / "start.bin")
    path = folder / "capture.bin"
    run_emulator(format_world(hand, WorldSettings()), path, 3.0, folder / "start.bin", folder / "press.stm")
    return path


def read_all_boards(path):
    """Read all frames of each board of a capture: dict from address to frames."""
    boards = {}
    for block in read_boards(path):
        for address, frames in block.items():
            boards[address] = boards[address].concatenate(frames) if address in boards else frames
    return boards


def test_arrays_equal_the_frames_of_the_skin(capture):
    expected = {}
    with open_skin(f"file:{capture}") as skin:
        for frame in skin:
            expected.setdefault(frame.address, []).append(frame)
    boards = read_all_boards(capture)
    assert sorted(boards) == sorted(expected)
    for address, frames in boards.items():
        assert frames.raw_counts.tolist() == [frame.raw_counts.tolist() for frame in expected[address]]
        assert frames.sequence.tolist() == [frame.sequence for frame in expected[address]]
        assert frames.cycle.tolist() == [frame.cycle for frame in expected[address]]
        # The clock map is fitted again with every block, so that early times differ. Before the first reading of a
        # board's clock (the 17 boards take turns), only the arrival times are available.
        difference_s = np.abs(frames.time_s - [frame.time_s for frame in expected[address]])
        assert difference_s.max() < 0.05
        assert difference_s[frames.time_s > START_S + CLOCK_READING_S].max() < 1e-3


def test_activity_starts_after_the_baseline_of_a_board(capture):
    board = load_hand("original").boards[0]
    raw = read_all_boards(capture)[board.address].raw_counts
    blocks = [block[board.address] for block in read_activity(capture, SAMPLES)]
    active = np.concatenate([block.activation.active for block in blocks])
    baseline = compute_baseline(raw[:SAMPLES], samples=SAMPLES)
    assert np.array_equal(blocks[0].baseline.mean, baseline.mean)
    assert np.array_equal(active, Activation(baseline.mean)(raw[SAMPLES:]).active)
    assert np.flatnonzero(active.any(axis=0)).tolist() == [TOUCHED_TAXEL]
    assert active[-1, TOUCHED_TAXEL]
    assert not active[0].any()


def test_board_with_too_few_frames_has_no_activity(capture):
    assert list(read_activity(capture, 10_000)) == []
