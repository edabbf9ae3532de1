"""Order of taxels, boards and bitmap bits, on which every array of the library depends."""

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from taxel.hand import Board, BoardKind, Hand, UnknownBoardError, load_hand

# TX 0: RX 1, 2;  TX 1: RX 0;  TX 2: RX 0, 2.
SMALL = np.array([[0, 1, 1], [1, 0, 0], [1, 0, 1]], dtype=bool)


def make_small_hand() -> Hand:
    """Make a hand of three boards with 1, 5 and 5 taxels, listed in another order than their addresses."""
    kind = BoardKind("small", 1, SMALL)
    single = BoardKind("single", 2, np.ones((1, 1), dtype=bool))
    boards = (Board("last", kind, 0x30), Board("first", single, 0x10), Board("middle", kind, 0x20))
    return Hand("small", "", 0.005, 0.003, boards)


def crossing_arrays() -> st.SearchStrategy[NDArray[np.bool_]]:
    shapes = st.tuples(st.integers(1, 16), st.integers(1, 16))
    return hnp.arrays(np.bool_, shapes).filter(lambda crossings: 1 <= crossings.sum() <= 240)


def test_taxels_of_a_board_are_in_row_major_order() -> None:
    kind = BoardKind("small", 1, SMALL)
    assert kind.tx.tolist() == [0, 0, 1, 2, 2]
    assert kind.rx.tolist() == [1, 2, 0, 0, 2]
    assert kind.tx.dtype == kind.rx.dtype == np.uint8
    assert kind.taxel_count == 5


def test_the_bitmap_has_bit_tx_times_rx_count_plus_rx_least_significant_first() -> None:
    # Bits 1, 2, 3, 6 and 8.
    assert BoardKind("small", 1, SMALL).crossing_bitmap() == bytes([0b0100_1110, 0b1]) + bytes(30)


@given(crossing_arrays())
def test_the_bitmap_contains_exactly_the_crossings_with_taxels(crossings: NDArray[np.bool_]) -> None:
    """Bit number tx * rx_count + rx, counted from the least significant bit of the first byte, is set for a taxel."""
    bitmap = BoardKind("any", 1, crossings).crossing_bitmap()
    tx_count, rx_count = crossings.shape
    assert len(bitmap) == 32
    for bit in range(256):
        on_board = bit < tx_count * rx_count
        assert (bitmap[bit // 8] >> (bit % 8) & 1) == (on_board and crossings[bit // rx_count, bit % rx_count])


@given(crossing_arrays())
def test_tx_and_rx_identify_each_taxel_once_and_in_order(crossings: NDArray[np.bool_]) -> None:
    kind = BoardKind("any", 1, crossings)
    crossing_lines = list(zip(kind.tx.tolist(), kind.rx.tolist(), strict=True))
    assert crossing_lines == sorted(set(crossing_lines))
    assert len(crossing_lines) == kind.taxel_count
    assert all(crossings[tx, rx] for tx, rx in crossing_lines)


@pytest.mark.parametrize("shape", [(33, 1), (1, 33), (0, 3), (3,), (2, 2, 2)])
def test_a_kind_has_1_to_32_tx_and_rx_lines(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match=r"1\.\.32"):
        BoardKind("any", 1, np.ones(shape, dtype=bool))


@pytest.mark.parametrize("crossings", [np.zeros((4, 4), dtype=bool), np.ones((16, 16), dtype=bool)])
def test_a_kind_has_1_to_240_taxels(crossings: NDArray[np.bool_]) -> None:
    with pytest.raises(ValueError, match=r"1\.\.240 taxels"):
        BoardKind("any", 1, crossings)


def test_boards_are_sorted_by_address() -> None:
    assert [board.name for board in make_small_hand().boards] == ["first", "middle", "last"]


def test_slices_are_contiguous_and_cover_the_taxel_axis() -> None:
    hand = load_hand("allegro")
    end = 0
    for board in hand.boards:
        board_taxels = hand.get_slice(board.address)
        assert board_taxels == slice(end, end + board.kind.taxel_count)
        end = board_taxels.stop
    assert end == hand.n_taxels


def test_the_taxel_table_is_in_the_order_of_the_slices() -> None:
    hand = load_hand("allegro")
    assert hand.sensor.shape == hand.tx.shape == hand.rx.shape == (1073,)
    assert hand.sensor.dtype == hand.tx.dtype == hand.rx.dtype == np.uint8
    for board in hand.boards:
        board_taxels = hand.get_slice(board.address)
        assert (hand.sensor[board_taxels] == board.address).all()
        assert np.array_equal(hand.tx[board_taxels], board.kind.tx)
        assert np.array_equal(hand.rx[board_taxels], board.kind.rx)


def test_split_gives_each_board_its_part_of_the_last_axis() -> None:
    hand = make_small_hand()
    counts = np.arange(2 * 11, dtype=np.uint16).reshape(2, 11)
    board_values = hand.split(counts)
    assert list(board_values) == [0x10, 0x20, 0x30]
    assert board_values[0x20].tolist() == [[1, 2, 3, 4, 5], [12, 13, 14, 15, 16]]
    assert board_values[0x30].dtype == np.uint16
    assert np.array_equal(np.concatenate(list(board_values.values()), axis=-1), counts)


@pytest.mark.parametrize("shape", [(), (10,), (11, 10)])
def test_split_rejects_another_number_of_taxels(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="expected an array with 11 taxels"):
        make_small_hand().split(np.zeros(shape))


def test_boards_are_found_by_address_and_by_name() -> None:
    hand = load_hand("allegro")
    assert hand.get_board(0x23) is hand.find_board("fingertip_index")


@pytest.mark.parametrize("function", [lambda hand: hand.get_board(0x77), lambda hand: hand.get_slice(0x77)])
def test_the_error_of_an_unknown_address_lists_the_addresses(function: object) -> None:
    assert callable(function)
    with pytest.raises(UnknownBoardError, match=r"^hand 'small' has no board 0x77; expected one of 0x10, 0x20, 0x30$"):
        function(make_small_hand())


def test_the_error_of_an_unknown_name_lists_the_names() -> None:
    with pytest.raises(UnknownBoardError, match="no board 'thumb'; expected one of first, middle, last"):
        make_small_hand().find_board("thumb")


def test_arrays_of_a_hand_are_read_only() -> None:
    hand = load_hand("flat8")
    for array in (hand.sensor, hand.tx, hand.rx, hand.boards[0].kind.crossings, hand.boards[0].kind.tx):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_a_later_change_of_the_crossings_array_does_not_change_the_kind() -> None:
    crossings = np.ones((2, 2), dtype=bool)
    kind = BoardKind("any", 1, crossings)
    crossings[0, 0] = False
    assert kind.taxel_count == 4
    assert kind.crossings.all()


@pytest.mark.parametrize(
    "boards",
    [
        (),
        (Board("a", BoardKind("k", 1, SMALL), 0x10), Board("b", BoardKind("k", 1, SMALL), 0x10)),
        (Board("a", BoardKind("k", 1, SMALL), 0x10), Board("a", BoardKind("k", 1, SMALL), 0x11)),
    ],
    ids=["no boards", "duplicate address", "duplicate name"],
)
def test_a_hand_requires_boards_with_unique_addresses_and_names(boards: tuple[Board, ...]) -> None:
    with pytest.raises(ValueError, match="expected at least one board and a unique"):
        Hand("any", "", 0.005, 0.003, boards)


def test_hands_with_equal_descriptions_are_equal() -> None:
    assert load_hand("allegro") == load_hand("allegro")
    assert hash(load_hand("allegro")) == hash(load_hand("allegro"))
    assert load_hand("allegro") != load_hand("flat8")
    assert BoardKind("any", 1, SMALL) != BoardKind("any", 1, ~SMALL)


def test_a_hand_and_its_errors_can_be_pickled() -> None:
    hand = load_hand("allegro")
    assert pickle.loads(pickle.dumps(hand)) == hand
    error = UnknownBoardError("small", "0x77", ["0x10"])
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


def test_a_kind_with_more_than_16_lines_has_no_register_bitmap() -> None:
    with pytest.raises(ValueError, match="supports 16 TX and 16 RX lines, this kind has 1 and 25"):
        BoardKind("any", 1, np.ones((1, 25), dtype=bool)).crossing_bitmap()
