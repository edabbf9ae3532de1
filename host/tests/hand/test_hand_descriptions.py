"""The packaged hands agree with the thesis and with their documentation."""

import numpy as np
import pytest
from numpy.typing import NDArray

from taxel.hand import BoardKind, list_packaged_hands, load_hand

# Thesis, Table 2.1: taxels, RX lines, TX lines.
TABLE_2_1 = {
    "back_of_hand": (118, 12, 11),
    "fingertip": (66, 9, 13),
    "medial_back": (30, 8, 8),
    "medial_front": (27, 4, 8),
    "palm": (121, 11, 13),
    "proximal_back": (78, 11, 11),
    "proximal_front": (65, 11, 10),
}

BOARDS = {
    0x20: ("palm", "palm"),
    0x21: ("back_of_hand", "back_of_hand"),
    0x22: ("fingertip_thumb", "fingertip"),
    0x23: ("fingertip_index", "fingertip"),
    0x24: ("fingertip_middle", "fingertip"),
    0x25: ("fingertip_pinkie", "fingertip"),
    0x26: ("proximal_front_index", "proximal_front"),
    0x27: ("proximal_front_middle", "proximal_front"),
    0x28: ("proximal_front_pinkie", "proximal_front"),
    0x29: ("proximal_back_index", "proximal_back"),
    0x2A: ("proximal_back_middle", "proximal_back"),
    0x2B: ("proximal_back_pinkie", "proximal_back"),
    0x2C: ("medial_front_index", "medial_front"),
    0x2D: ("medial_front_middle", "medial_front"),
    0x2E: ("medial_front_pinkie", "medial_front"),
    0x2F: ("medial_back_index", "medial_back"),
    0x30: ("medial_back_middle", "medial_back"),
}


WIDE_ROW_TAXELS = 11
"""Taxels of a row that reaches around the flanks of a proximal link."""


def load_allegro_kinds() -> dict[str, BoardKind]:
    return {board.kind.name: board.kind for board in load_hand("allegro").boards}


def is_connected(crossings: NDArray[np.bool_]) -> bool:
    """Return whether all taxels are connected through neighbours on the same TX or RX line."""
    remaining = {(int(tx), int(rx)) for tx, rx in np.argwhere(crossings)}
    pending = [remaining.pop()]
    while pending:
        tx, rx = pending.pop()
        neighbours = remaining & {(tx - 1, rx), (tx + 1, rx), (tx, rx - 1), (tx, rx + 1)}
        remaining -= neighbours
        pending += neighbours
    return not remaining


def test_original_assumed_and_test_hands_are_packaged() -> None:
    assert list_packaged_hands() == ["allegro", "first_generation", "flat8", "original", "original_complete", "rig4"]


@pytest.mark.parametrize("name", ["allegro", "first_generation", "flat8", "original", "original_complete", "rig4"])
def test_the_name_of_a_packaged_hand_equals_its_file_name(name: str) -> None:
    assert load_hand(name).name == name


def test_the_allegro_kinds_agree_with_table_2_1_of_the_thesis() -> None:
    described = {name: (kind.taxel_count, kind.rx_count, kind.tx_count) for name, kind in load_allegro_kinds().items()}
    assert described == TABLE_2_1


def test_the_allegro_kind_codes_are_one_to_seven() -> None:
    assert sorted(kind.code for kind in load_allegro_kinds().values()) == [1, 2, 3, 4, 5, 6, 7]


def test_the_allegro_hand_has_17_boards_and_1073_taxels() -> None:
    hand = load_hand("allegro")
    assert len(hand.boards) == 17
    assert hand.n_taxels == 1073


def test_the_allegro_boards_have_the_documented_addresses() -> None:
    assert {b.address: (b.name, b.kind.name) for b in load_hand("allegro").boards} == BOARDS


def test_the_allegro_taxels_are_3_mm_wide_and_5_mm_apart() -> None:
    hand = load_hand("allegro")
    assert (hand.pitch_m, hand.size_m) == (0.005, 0.003)


@pytest.mark.parametrize("kind", TABLE_2_1)
def test_every_tx_and_rx_line_of_the_allegro_boards_has_a_taxel(kind: str) -> None:
    crossings = load_allegro_kinds()[kind].crossings
    assert crossings.any(axis=0).all()
    assert crossings.any(axis=1).all()


@pytest.mark.parametrize("kind", TABLE_2_1)
def test_the_taxels_of_a_board_are_connected(kind: str) -> None:
    assert is_connected(load_allegro_kinds()[kind].crossings)


@pytest.mark.parametrize("kind", ["back_of_hand", "fingertip", "medial_back", "proximal_back", "proximal_front"])
def test_kinds_shared_by_fingers_or_centred_on_the_hand_are_symmetric(kind: str) -> None:
    crossings = load_allegro_kinds()[kind].crossings
    assert np.array_equal(crossings, crossings[:, ::-1])


def test_the_palm_has_most_unused_crossings_on_the_thumb_side() -> None:
    unused = ~load_allegro_kinds()["palm"].crossings
    assert unused[:, 6:].sum() > unused[:, :5].sum()


def test_proximal_front_and_back_boards_do_not_overlap_on_the_flanks() -> None:
    """Both boards wrap around the same link, so only one of them may be wide at each height."""
    kinds = load_allegro_kinds()
    wide_row_heights_mm = {}
    for name in ("proximal_front", "proximal_back"):
        rows = kinds[name].tx_count
        along = (np.arange(rows) - (rows - 1) / 2) * 5.0  # mm, from the middle of the link
        wide_row_heights_mm[name] = along[kinds[name].crossings.sum(axis=1) == WIDE_ROW_TAXELS]
    distance = np.abs(wide_row_heights_mm["proximal_front"][:, None] - wide_row_heights_mm["proximal_back"][None, :])
    assert distance.min() >= 5.0


def test_flat8_is_a_board_of_8_by_8_taxels() -> None:
    hand = load_hand("flat8")
    (board,) = hand.boards
    assert (board.name, board.address, board.kind.name, board.kind.code) == ("flat8", 0x40, "flat8", 8)
    assert board.kind.crossings.shape == (8, 8)
    assert hand.n_taxels == 64
    assert board.kind.crossings.all()
