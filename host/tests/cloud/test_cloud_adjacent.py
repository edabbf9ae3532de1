"""Contact propagation to adjacent taxels of boards with any pitch."""

import numpy as np
import pytest

from taxel.cloud.propagation import Propagation
from taxel.hand import Hand, load_hand
from taxel.recording.grasp_tables import TaxelTable


def make_table(hand: Hand) -> TaxelTable:
    """Make the taxel table of a hand."""
    size = np.full(hand.n_taxels, hand.size_m)
    return TaxelTable(hand.sensor, hand.tx, hand.rx, hand.position, hand.normal, size)


def test_adjacent_taxels_on_a_5_mm_grid_are_the_four_neighbours() -> None:
    table = make_table(load_hand("flat8"))
    adjacent = Propagation().find_neighbours(table).toarray()
    assert np.array_equal(adjacent, Propagation(reach_m=0.0055).find_neighbours(table).toarray())


@pytest.mark.parametrize("name", ["palm", "back_of_hand", "fingertip_index", "proximal_front_index"])
def test_more_than_nine_in_ten_adjacent_taxels_of_the_original_hand_are_layout_neighbours_and_vice_versa(
    name: str,
) -> None:
    hand = load_hand("original")
    board = hand.find_board(name)
    taxels = hand.get_slice(board.address)
    adjacent = Propagation().find_neighbours(make_table(hand)).toarray()[taxels, taxels]
    steps = np.abs(np.subtract.outer(board.kind.row, board.kind.row)) + np.abs(
        np.subtract.outer(board.kind.column, board.kind.column)
    )
    in_layout = steps == 1
    assert adjacent[in_layout].mean() > 0.9  # a few neighbours in the layout lie on two sides of a bend or a step
    assert in_layout[adjacent > 0].mean() > 0.9


def test_adjacent_taxels_of_the_palm_are_less_than_9_5_mm_apart_although_its_board_has_gaps() -> None:
    """Nearest taxels of the palm are 4.3 to 5.3 mm apart; 9.5 mm is less than twice the larger distance."""
    hand = load_hand("original")
    board = hand.find_board("palm")
    adjacent = Propagation().find_neighbours(make_table(hand)).toarray()
    taxels = hand.get_slice(board.address)
    distance = np.linalg.norm(hand.position[taxels][:, None] - hand.position[taxels], axis=2)
    assert distance[adjacent[taxels, taxels] > 0].max() < 0.0095
