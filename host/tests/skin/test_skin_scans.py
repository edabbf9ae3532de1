"""Scans are the whole skin, cycle by cycle; a board that did not answer is not valid there."""

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
def steady(tmp_path_factory, allegro, known_counts):
    path = tmp_path_factory.mktemp("stimulus") / "steady.stm"
    write_stimulus(path, [0.0], [known_counts(allegro)], "counts")
    return path


def open_with(hand, stimulus=None, duration_s=4.0, world_hand=None, **settings):
    world = format_world(world_hand or hand, WorldSettings(**settings))
    return Skin(EmulatorLink(world, stimulus, fast=True, duration_s=duration_s), hand)


def test_a_scan_is_every_board_of_one_cycle(allegro, known_counts, steady):
    with open_with(allegro, steady) as skin:
        scans = list(skin.scans())
    assert len(scans) > 50
    assert [scan.cycle for scan in scans] == list(range(scans[0].cycle, scans[0].cycle + len(scans)))
    for scan in scans[:-1]:  # the end may cut the last one
        assert scan.raw_counts.shape == scan.valid.shape == (allegro.n_taxels,)
        assert (scan.raw_counts.dtype, scan.valid.dtype) == (np.uint16, np.bool_)
        assert scan.valid.all()
        assert np.array_equal(scan.raw_counts, known_counts(allegro))
    times = [scan.time_s for scan in scans]
    assert times == sorted(times)


def test_a_complete_scan_does_not_wait_for_the_next_cycle(allegro):
    with open_with(allegro) as skin:
        scan = next(skin.scans())
        if scan.valid.all():
            assert skin.losses.frames_received > 0
        second = next(skin.scans())
        assert second.cycle == scan.cycle + 1


def test_a_scan_of_a_skin_with_one_board_is_a_frame(flat8):
    with taxel.open("emulator:?speed=max&duration_s=1", "flat8") as skin:
        scans = list(skin.scans())
    assert len(scans) > 30
    assert all(scan.valid.all() for scan in scans)
    assert all(a.cycle < b.cycle for a, b in itertools.pairwise(scans))


def test_a_missing_board_is_never_valid_and_its_counts_are_0(tmp_path, allegro, known_counts):
    gone = allegro.boards[5]
    there = Hand("part", "", 0.005, 0.003, tuple(board for board in allegro.boards if board is not gone))
    where = np.zeros(allegro.n_taxels, dtype=bool)
    where[allegro.get_slice(gone.address)] = True
    write_stimulus(tmp_path / "a.stm", [0.0], [known_counts(allegro)[~where]], "counts")
    with open_with(allegro, tmp_path / "a.stm", world_hand=there) as skin:
        assert skin.missing_boards == [gone.name]
        scans = list(skin.scans())
    assert len(scans) > 50
    for scan in scans[:-1]:
        assert np.array_equal(scan.valid, ~where)
        assert np.array_equal(scan.raw_counts, np.where(where, 0, known_counts(allegro)))


def test_a_board_that_is_unplugged_is_not_valid_until_it_is_back(allegro, known_counts, steady):
    faults = ("2.0 unplug 0x22", "3.0 plug 0x22")
    with open_with(allegro, steady, 5.0, faults=faults) as skin:
        scans = list(skin.scans())
    own = allegro.get_slice(0x22)
    assert [scan.cycle for scan in scans] == list(range(scans[0].cycle, scans[0].cycle + len(scans)))
    for scan in scans[:-1]:
        others = np.delete(scan.valid, np.r_[own])
        assert others.all()
        assert scan.valid[own].all() or not scan.valid[own].any()
        assert np.array_equal(scan.raw_counts, np.where(scan.valid, known_counts(allegro), 0))
    valid = [bool(scan.valid[own].all()) for scan in scans[:-1]]
    runs = [key for key, _ in itertools.groupby(valid)]
    assert runs == [True, False, True]
    assert 10 < valid.count(False) < 40


def test_scans_may_be_read_in_parts(allegro, known_counts, steady):
    with open_with(allegro, steady) as skin:
        parts = [list(itertools.islice(skin.scans(), 7)) for _ in range(4)]
    cycles = [scan.cycle for part in parts for scan in part]
    assert cycles == list(range(cycles[0], cycles[0] + 28))
    assert all(scan.valid.all() for part in parts for scan in part)


def test_a_baseline_of_steady_counts_is_those_counts(allegro, known_counts, steady):
    told = []
    with open_with(allegro, steady, 8.0) as skin:
        result = skin.take_baseline(samples=50, progress=told.append)
    assert np.array_equal(result.mean, known_counts(allegro))
    assert told == sorted(told)
    assert told[-1] == 1.0


def test_a_baseline_has_no_number_for_a_board_that_does_not_answer(allegro):
    gone = allegro.boards[0]
    there = Hand("part", "", 0.005, 0.003, allegro.boards[1:])
    with open_with(allegro, None, 15.0, world_hand=there) as skin:
        result = skin.take_baseline(samples=50)
    own = allegro.get_slice(gone.address)
    assert np.isnan(result.mean[own]).all()
    assert np.isfinite(np.delete(result.mean, np.r_[own])).all()


def test_a_stream_that_ends_too_early_gives_no_baseline(flat8):
    with open_with(flat8, None, 0.5) as skin, pytest.raises(TaxelError, match="a baseline needs 1000") as caught:
        skin.take_baseline(samples=1000)
    assert "\n" not in str(caught.value)
