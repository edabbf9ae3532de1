"""A capture as arrays a board: what the skin delivers frame by frame, and what is active after the baseline."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link import run_emulator, write_stimulus
from taxel.recording import activity_of, read_boards
from taxel.signal import Activation, compute_baseline
from taxel.skin import open_skin
from taxel.stream.start_script import START_S, write_start_script

SAMPLES = 20
CLOCKS_S = 1.6
PRESSED = 5


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    folder = tmp_path_factory.mktemp("capture")
    hand = load_hand("allegro")
    forces = np.zeros((3, hand.n_taxels))
    forces[2, PRESSED] = 2.0
    write_stimulus(folder / "press.stm", [0.0, 2.5, 2.6], forces)
    write_start_script(folder / "start.bin")
    path = folder / "capture.bin"
    run_emulator(format_world(hand, WorldSettings(scl_hz=1e6)), path, 3.0, folder / "start.bin", folder / "press.stm")
    return path


def whole(path):
    boards = {}
    for piece in read_boards(path):
        for address, frames in piece.items():
            boards[address] = boards[address].then(frames) if address in boards else frames
    return boards


def test_arrays_say_what_the_skin_says_frame_by_frame(capture):
    wanted = {}
    with open_skin(f"file:{capture}") as skin:
        for frame in skin:
            wanted.setdefault(frame.address, []).append(frame)
    boards = whole(capture)
    assert sorted(boards) == sorted(wanted)
    for address, frames in boards.items():
        assert frames.raw_counts.tolist() == [frame.raw_counts.tolist() for frame in wanted[address]]
        assert frames.sequence.tolist() == [frame.sequence for frame in wanted[address]]
        assert frames.cycle.tolist() == [frame.cycle for frame in wanted[address]]
        # The line between the clocks is drawn anew with every piece that comes: the earlier ones knew less of it, and
        # before a board's clock was read for the first time (17 boards take turns), only when its frames came.
        apart = np.abs(frames.time_s - [frame.time_s for frame in wanted[address]])
        assert apart.max() < 0.05
        assert apart[frames.time_s > START_S + CLOCKS_S].max() < 1e-3


def test_after_its_baseline_a_board_says_what_is_active(capture):
    board = load_hand("allegro").boards[0]
    raw = whole(capture)[board.address].raw_counts
    pieces = [piece[board.address] for piece in activity_of(capture, SAMPLES)]
    active = np.concatenate([piece.activation.active for piece in pieces])
    baseline = compute_baseline(raw[:SAMPLES], samples=SAMPLES)
    assert np.array_equal(pieces[0].baseline.mean, baseline.mean)
    assert np.array_equal(active, Activation(baseline.mean)(raw[SAMPLES:]).active)
    assert np.flatnonzero(active.any(axis=0)).tolist() == [PRESSED]
    assert active[-1, PRESSED]
    assert not active[0].any()


def test_a_board_with_too_few_frames_says_nothing(capture):
    assert list(activity_of(capture, 10_000)) == []
