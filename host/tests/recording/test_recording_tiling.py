"""Assignment of the 27 x 15 panel positions to taxels, and conversion of panel values to raw counts."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel.hand import Board, Hand, load_hand
from taxel.recording import RecordingError, Tiling, load_recording
from taxel.recording.tiling import UNTOUCHED_COUNTS

ALLEGRO = load_hand("allegro")


def make_flat_hand(boards):
    """Make a hand of several boards of 8 x 8 taxels."""
    flat8 = load_hand("flat8")
    kind = flat8.boards[0].kind
    return replace(flat8, boards=tuple(Board(f"board_{i}", kind, 0x20 + i) for i in range(boards)))


def to_panel_values(tiling, counts):
    """Convert raw counts [T frames, n_taxels] into panel values [T, 27, 15]."""
    return (UNTOUCHED_COUNTS - counts[:, tiling.taxel_of_cell].astype(int)).reshape(-1, 27, 15)


@pytest.mark.parametrize("hand", [ALLEGRO, make_flat_hand(12)], ids=["allegro", "12 x flat8"])
def test_panel_positions_have_different_taxels_on_at_least_four_boards(hand: Hand):
    tiling = Tiling.for_hand(hand)
    assert len(set(tiling.taxel_of_cell.tolist())) == 27 * 15
    assert len(set(hand.sensor[tiling.taxel_of_cell].tolist())) >= 4


def test_tiling_of_a_hand_is_deterministic():
    assert np.array_equal(Tiling.for_hand(ALLEGRO).taxel_of_cell, Tiling.for_hand(load_hand("allegro")).taxel_of_cell)


@pytest.mark.parametrize("hand", [ALLEGRO, make_flat_hand(12)], ids=["allegro", "12 x flat8"])
def test_neighbours_within_a_tile_are_neighbours_on_a_board(hand: Hand):
    tiling = Tiling.for_hand(hand)
    taxel = tiling.taxel_of_cell.reshape(27, 15)
    rows, columns = tiling.tile_shape
    for top_row in range(0, 27, rows):
        for left_column in range(0, 15, columns):
            tile = taxel[top_row : top_row + rows, left_column : left_column + columns]
            assert len(set(hand.sensor[tile].flat)) == 1
            assert (np.diff(hand.tx[tile].astype(int), axis=0) == 1).all()
            assert (np.diff(hand.rx[tile].astype(int), axis=1) == 1).all()


@pytest.mark.parametrize("boards", [1, 3, 6])
def test_hand_that_is_too_small_is_refused(boards):
    with pytest.raises(RecordingError, match=r"'flat8' is too small.*expected 405 taxels.*found"):
        Tiling.for_hand(make_flat_hand(boards))


def test_touch_lowers_the_count_of_its_taxel_only():
    tiling = Tiling.for_hand(ALLEGRO)
    values = np.zeros((1, 27, 15), np.int16)
    values[0, 3, 4] = 200
    counts = tiling.to_counts(values)
    assert counts.dtype == np.uint16
    assert counts[0, tiling.taxel_of_cell[3 * 15 + 4]] == UNTOUCHED_COUNTS - 200
    assert (np.delete(counts[0], tiling.taxel_of_cell[3 * 15 + 4]) == UNTOUCHED_COUNTS).all()


def test_counts_are_clipped_to_16_bits():
    tiling = Tiling.for_hand(ALLEGRO)
    values = np.full((1, 27, 15), 200, np.int16)
    assert tiling.to_counts(values, untouched=100)[0, tiling.taxel_of_cell].tolist() == [0] * 405
    assert tiling.to_counts(-values, untouched=65_500)[0, tiling.taxel_of_cell].tolist() == [65_535] * 405


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_counts_contain_the_panel_values(seed):
    values = np.random.default_rng(seed).integers(-300, 300, (3, 27, 15))
    tiling = Tiling.for_hand(ALLEGRO)
    assert np.array_equal(to_panel_values(tiling, tiling.to_counts(values)), values)


def test_counts_contain_the_values_of_a_whole_recording():
    values = load_recording("P2_index_right").values
    tiling = Tiling.for_hand(ALLEGRO)
    assert np.array_equal(to_panel_values(tiling, tiling.to_counts(values)), values)


def test_invalid_shapes_and_counts_are_refused():
    tiling = Tiling.for_hand(ALLEGRO)
    with pytest.raises(ValueError, match="values: expected integers"):
        tiling.to_counts(np.zeros((2, 15, 27), np.int16))
    with pytest.raises(ValueError, match="untouched: expected"):
        tiling.to_counts(np.zeros((2, 27, 15), np.int16), untouched=-1)


def test_a_tiling_that_assigns_one_taxel_to_several_panel_positions_is_refused():
    with pytest.raises(ValueError, match="different taxels"):
        Tiling(ALLEGRO.n_taxels, taxel_of_cell=np.zeros(27 * 15, np.int64), tile_shape=(9, 5))
