"""Scans combine the frames of all boards of a poll cycle; a board without a frame is marked invalid. Baselines."""

import itertools

import numpy as np
import pytest

import taxel
from taxel.errors import TaxelError
from taxel.hand import Hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link import EmulatorLink, write_stimulus
from taxel.skin import Skin


@pytest.fixture(scope="module")
def constant_stimulus(tmp_path_factory, allegro, known_counts):
    """Path of a stimulus in which every taxel always has its known count."""
    path = tmp_path_factory.mktemp("stimulus") / "steady.stm"
    write_stimulus(path, [0.0], [known_counts(allegro)], "counts")
    return path


def open_emulated_skin(hand, stimulus=None, duration_s=4.0, world_hand=None, **settings):
    """Open a skin of `hand` on an emulator of `world_hand` (None: the same hand). settings: of the emulated world."""
    world = format_world(world_hand or hand, WorldSettings(**settings))
    return Skin(EmulatorLink(world, stimulus, fast=True, duration_s=duration_s), hand)


def test_a_scan_contains_every_board_of_one_poll_cycle(allegro, known_counts, constant_stimulus):
    with open_emulated_skin(allegro, constant_stimulus) as skin:
        scans = list(skin.scans())
    assert len(scans) > 50
    assert [scan.cycle for scan in scans] == list(range(scans[0].cycle, scans[0].cycle + len(scans)))
    for scan in scans[:-1]:  # the end of the emulation may truncate the last scan
        assert scan.raw_counts.shape == scan.valid.shape == (allegro.n_taxels,)
        assert (scan.raw_counts.dtype, scan.valid.dtype) == (np.uint16, np.bool_)
        assert scan.valid.all()
        assert np.array_equal(scan.raw_counts, known_counts(allegro))
    times_s = [scan.time_s for scan in scans]
    assert times_s == sorted(times_s)


def test_consecutive_scans_have_consecutive_cycles(allegro):
    with open_emulated_skin(allegro) as skin:
        scan = next(skin.scans())
        assert skin.losses.frames_received > 0
        second = next(skin.scans())
        assert second.cycle == scan.cycle + 1


def test_every_scan_of_a_skin_with_one_board_is_valid(flat8):
    with taxel.open("emulator:?speed=max&duration_s=1", "flat8") as skin:
        scans = list(skin.scans())
    assert len(scans) > 30
    assert all(scan.valid.all() for scan in scans)
    assert all(a.cycle < b.cycle for a, b in itertools.pairwise(scans))


def test_a_missing_board_is_invalid_with_counts_of_0_in_every_scan(tmp_path, allegro, known_counts):
    missing_board = allegro.boards[5]
    connected_hand = Hand(
        "part", "", 0.005, 0.003, tuple(board for board in allegro.boards if board is not missing_board)
    )
    is_missing = np.zeros(allegro.n_taxels, dtype=bool)
    is_missing[allegro.get_slice(missing_board.address)] = True
    write_stimulus(tmp_path / "a.stm", [0.0], [known_counts(allegro)[~is_missing]], "counts")
    with open_emulated_skin(allegro, tmp_path / "a.stm", world_hand=connected_hand) as skin:
        assert skin.missing_boards == [missing_board.name]
        scans = list(skin.scans())
    assert len(scans) > 50
    for scan in scans[:-1]:
        assert np.array_equal(scan.valid, ~is_missing)
        assert np.array_equal(scan.raw_counts, np.where(is_missing, 0, known_counts(allegro)))


def test_an_unplugged_board_is_invalid_until_it_streams_again(allegro, known_counts, constant_stimulus):
    faults = ("2.0 unplug 0x22", "3.0 plug 0x22")
    with open_emulated_skin(allegro, constant_stimulus, 5.0, faults=faults) as skin:
        scans = list(skin.scans())
    unplugged_taxels = allegro.get_slice(0x22)
    assert [scan.cycle for scan in scans] == list(range(scans[0].cycle, scans[0].cycle + len(scans)))
    for scan in scans[:-1]:
        valid_of_other_boards = np.delete(scan.valid, np.r_[unplugged_taxels])
        assert valid_of_other_boards.all()
        assert scan.valid[unplugged_taxels].all() or not scan.valid[unplugged_taxels].any()
        assert np.array_equal(scan.raw_counts, np.where(scan.valid, known_counts(allegro), 0))
    is_valid = [bool(scan.valid[unplugged_taxels].all()) for scan in scans[:-1]]
    states = [state for state, _ in itertools.groupby(is_valid)]
    assert states == [True, False, True]
    assert 10 < is_valid.count(False) < 40  # scans of about a second


def test_scans_can_be_read_by_several_iterators_in_turn(allegro, known_counts, constant_stimulus):
    with open_emulated_skin(allegro, constant_stimulus) as skin:
        parts = [list(itertools.islice(skin.scans(), 7)) for _ in range(4)]
    cycles = [scan.cycle for part in parts for scan in part]
    assert cycles == list(range(cycles[0], cycles[0] + 28))
    assert all(scan.valid.all() for part in parts for scan in part)


def test_the_baseline_of_constant_counts_equals_the_counts_and_reports_progress(
    allegro, known_counts, constant_stimulus
):
    progress = []
    with open_emulated_skin(allegro, constant_stimulus, 8.0) as skin:
        result = skin.take_baseline(samples=50, progress=progress.append)
    assert np.array_equal(result.mean, known_counts(allegro))
    assert progress == sorted(progress)
    assert progress[-1] == 1.0


def test_the_baseline_of_a_missing_board_is_nan(allegro):
    missing_board = allegro.boards[0]
    connected_hand = Hand("part", "", 0.005, 0.003, allegro.boards[1:])
    with open_emulated_skin(allegro, None, 15.0, world_hand=connected_hand) as skin:
        result = skin.take_baseline(samples=50)
    missing_taxels = allegro.get_slice(missing_board.address)
    assert np.isnan(result.mean[missing_taxels]).all()
    assert np.isfinite(np.delete(result.mean, np.r_[missing_taxels])).all()


def test_a_stream_that_ends_before_the_baseline_is_complete_gives_one_error_line(flat8):
    with (
        open_emulated_skin(flat8, duration_s=0.5) as skin,  # fewer than 1000 scans
        pytest.raises(TaxelError, match="a baseline needs 1000") as caught,
    ):
        skin.take_baseline(samples=1000)
    assert "\n" not in str(caught.value)
