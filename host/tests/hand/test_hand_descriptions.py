"""The packaged hands are what they say they are."""

from __future__ import annotations

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


def allegro_kinds() -> dict[str, BoardKind]:
    return {board.kind.name: board.kind for board in load_hand("allegro").boards}


def is_connected(crossings: NDArray[np.bool_]) -> bool:
    """Whether every taxel can be reached from every other through neighbours on the same TX or RX line."""
    left = {(int(tx), int(rx)) for tx, rx in np.argwhere(crossings)}
    edge = [left.pop()]
    while edge:
        tx, rx = edge.pop()
        near = left & {(tx - 1, rx), (tx + 1, rx), (tx, rx - 1), (tx, rx + 1)}
        left -= near
        edge += near
    return not left


def test_three_hands_are_packaged() -> None:
    assert list_packaged_hands() == ["allegro", "flat8", "rig4"]


@pytest.mark.parametrize("name", ["allegro", "flat8", "rig4"])
def test_a_packaged_hand_bears_its_own_name(name: str) -> None:
    assert load_hand(name).name == name


def test_the_allegro_kinds_have_the_numbers_of_the_thesis() -> None:
    measured = {name: (kind.taxel_count, kind.rx_count, kind.tx_count) for name, kind in allegro_kinds().items()}
    assert measured == TABLE_2_1


def test_the_allegro_kind_codes_are_one_to_seven() -> None:
    assert sorted(kind.code for kind in allegro_kinds().values()) == [1, 2, 3, 4, 5, 6, 7]


def test_the_allegro_hand_has_17_boards_and_1073_taxels() -> None:
    hand = load_hand("allegro")
    assert len(hand.boards) == 17
    assert hand.n_taxels == 1073


def test_the_allegro_boards_are_at_their_addresses() -> None:
    assert {b.address: (b.name, b.kind.name) for b in load_hand("allegro").boards} == BOARDS


def test_the_allegro_taxels_are_3_mm_wide_and_5_mm_apart() -> None:
    hand = load_hand("allegro")
    assert (hand.pitch_m, hand.size_m) == (0.005, 0.003)


@pytest.mark.parametrize("kind", TABLE_2_1)
def test_every_line_carries_a_taxel(kind: str) -> None:
    crossings = allegro_kinds()[kind].crossings
    assert crossings.any(axis=0).all()
    assert crossings.any(axis=1).all()


@pytest.mark.parametrize("kind", TABLE_2_1)
def test_a_board_is_one_connected_sheet(kind: str) -> None:
    assert is_connected(allegro_kinds()[kind].crossings)


@pytest.mark.parametrize("kind", ["back_of_hand", "fingertip", "medial_back", "proximal_back", "proximal_front"])
def test_kinds_shared_by_fingers_or_centred_on_the_hand_are_symmetric(kind: str) -> None:
    crossings = allegro_kinds()[kind].crossings
    assert np.array_equal(crossings, crossings[:, ::-1])


def test_the_palm_is_cut_most_on_the_thumb_side() -> None:
    unused = ~allegro_kinds()["palm"].crossings
    assert unused[:, 6:].sum() > unused[:, :5].sum()


def test_proximal_wings_of_front_and_back_interlock() -> None:
    """Both wrap the flanks of one link, so at one height along it only one of them may reach round."""
    kinds = allegro_kinds()
    heights = {}
    for name in ("proximal_front", "proximal_back"):
        rows = kinds[name].tx_count
        along = (np.arange(rows) - (rows - 1) / 2) * 5.0  # mm, from the middle of the link
        heights[name] = along[kinds[name].crossings.sum(axis=1) == 11]
    distance = np.abs(heights["proximal_front"][:, None] - heights["proximal_back"][None, :])
    assert distance.min() >= 5.0


def test_flat8_is_one_full_8_by_8_board() -> None:
    hand = load_hand("flat8")
    (board,) = hand.boards
    assert (board.name, board.address, board.kind.name, board.kind.code) == ("flat8", 0x40, "flat8", 8)
    assert board.kind.crossings.shape == (8, 8)
    assert hand.n_taxels == 64
    assert board.kind.crossings.all()
