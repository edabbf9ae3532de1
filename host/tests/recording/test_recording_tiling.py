"""The panel's cells lie on different taxels of several boards, and counts come back as values."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel.hand import Board, Hand, load_hand
from taxel.recording import RecordingError, Tiling, load_recording
from taxel.recording.tiling import REST_COUNTS

ALLEGRO = load_hand("allegro")


def flat_hand(boards):
    flat8 = load_hand("flat8")
    kind = flat8.boards[0].kind
    return replace(flat8, boards=tuple(Board(f"board_{i}", kind, 0x20 + i) for i in range(boards)))


@pytest.mark.parametrize("hand", [ALLEGRO, flat_hand(12)], ids=["allegro", "12 x flat8"])
def test_every_cell_has_a_taxel_of_its_own_on_at_least_four_boards(hand: Hand):
    tiling = Tiling.of(hand)
    assert len(set(tiling.taxel_of_cell.tolist())) == 27 * 15
    assert len(set(hand.sensor[tiling.taxel_of_cell].tolist())) >= 4


def test_the_same_hand_gives_the_same_tiling():
    assert np.array_equal(Tiling.of(ALLEGRO).taxel_of_cell, Tiling.of(load_hand("allegro")).taxel_of_cell)


@pytest.mark.parametrize("hand", [ALLEGRO, flat_hand(12)], ids=["allegro", "12 x flat8"])
def test_neighbours_within_a_tile_are_neighbours_on_a_board(hand: Hand):
    tiling = Tiling.of(hand)
    taxel = tiling.taxel_of_cell.reshape(27, 15)
    rows, columns = tiling.tile_shape
    for top in range(0, 27, rows):
        for left in range(0, 15, columns):
            tile = taxel[top : top + rows, left : left + columns]
            assert len(set(hand.sensor[tile].flat)) == 1
            assert (np.diff(hand.tx[tile].astype(int), axis=0) == 1).all()
            assert (np.diff(hand.rx[tile].astype(int), axis=1) == 1).all()


@pytest.mark.parametrize("boards", [1, 3, 6])
def test_a_hand_that_is_too_small_is_refused(boards):
    with pytest.raises(RecordingError, match=r"'flat8' is too small.*expected 405 taxels.*found"):
        Tiling.of(flat_hand(boards))


def test_touch_lowers_the_count_and_taxels_without_a_cell_rest():
    tiling = Tiling.of(ALLEGRO)
    values = np.zeros((1, 27, 15), np.int16)
    values[0, 3, 4] = 200
    counts = tiling.to_counts(values)
    assert counts.dtype == np.uint16
    assert counts[0, tiling.taxel_of_cell[3 * 15 + 4]] == REST_COUNTS - 200
    assert (np.delete(counts[0], tiling.taxel_of_cell[3 * 15 + 4]) == REST_COUNTS).all()


def test_counts_are_clipped_to_16_bits():
    tiling = Tiling.of(ALLEGRO)
    values = np.full((1, 27, 15), 200, np.int16)
    assert tiling.to_counts(values, rest=100)[0, tiling.taxel_of_cell].tolist() == [0] * 405
    assert tiling.to_counts(-values, rest=65_500)[0, tiling.taxel_of_cell].tolist() == [65_535] * 405


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_values_come_back_from_counts(seed):
    values = np.random.default_rng(seed).integers(-300, 300, (3, 27, 15))
    tiling = Tiling.of(ALLEGRO)
    assert np.array_equal(tiling.from_counts(tiling.to_counts(values)), values)


def test_a_whole_recording_comes_back_from_counts():
    values = load_recording("P2_index_right").values
    tiling = Tiling.of(ALLEGRO)
    assert np.array_equal(tiling.from_counts(tiling.to_counts(values)), values)


def test_shapes_that_do_not_fit_are_refused():
    tiling = Tiling.of(ALLEGRO)
    with pytest.raises(ValueError, match="values: expected integers"):
        tiling.to_counts(np.zeros((2, 15, 27), np.int16))
    with pytest.raises(ValueError, match="counts: expected"):
        tiling.from_counts(np.zeros((2, 405), np.uint16))
    with pytest.raises(ValueError, match="rest: expected"):
        tiling.to_counts(np.zeros((2, 27, 15), np.int16), rest=-1)
    with pytest.raises(ValueError, match="different taxels"):
        Tiling(1073, np.zeros(405, np.int64), (9, 5))
