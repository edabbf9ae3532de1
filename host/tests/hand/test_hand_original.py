"""The description of the original hand against the extracted figures, and its layouts and sheets."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from taxel.hand import BoardKind, load_hand
from taxel.hand.sheet import build_sheet

TOOLS = Path(__file__).parents[3] / "tools" / "hand"
HAND = load_hand("original")
COMPLETE = load_hand("original_complete")
KINDS = {board.kind.name: board.kind for board in COMPLETE.boards}


def run_tool(name: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a program of tools/hand."""
    return subprocess.run([sys.executable, TOOLS / name, *arguments], capture_output=True, text=True, check=False)


def test_the_descriptions_are_those_that_the_tool_writes() -> None:
    result = run_tool("original_hand.py", "--check")
    assert (result.returncode, result.stdout, result.stderr) == (0, "", "")


def test_centres_brackets_and_recorded_positions_agree_with_the_extracted_figures() -> None:
    result = run_tool("compare_original.py")
    assert result.returncode == 0, result.stdout + result.stderr
    compared_quantities = result.stdout.splitlines()
    assert len(compared_quantities) == 15


def test_the_fitted_hand_has_17_boards_and_1037_taxels_and_the_complete_hand_22_and_1324() -> None:
    assert (len(HAND.boards), HAND.n_taxels) == (17, 1037)
    assert (len(COMPLETE.boards), COMPLETE.n_taxels) == (22, 1324)
    assert [board.address for board in COMPLETE.boards] == list(range(0x08, 0x1E))
    thumb = {board.address for board in COMPLETE.boards if board.name.endswith("thumb")}
    assert {board.address for board in HAND.boards} == set(range(0x08, 0x1E)) - thumb


def test_the_first_generation_has_22_boards_of_one_tx_line() -> None:
    hand = load_hand("first_generation")
    assert (len(hand.boards), hand.n_taxels) == (22, 224)
    assert {board.kind.tx_count for board in hand.boards} == {1}
    assert sorted({board.kind.rx_count for board in hand.boards}) == [6, 14, 15, 20, 25]


@pytest.mark.parametrize(
    ("name", "lines"),
    [
        ("back_of_hand", (11, 12)),
        ("fingertip", (13, 9)),
        ("medial_back", (8, 8)),
        ("medial_front", (8, 4)),
        ("proximal_back", (11, 11)),
        ("proximal_front", (10, 11)),
    ],
)
def test_the_assumed_lines_have_the_numbers_of_the_thesis(name: str, lines: tuple[int, int]) -> None:
    assert (KINDS[name].tx_count, KINDS[name].rx_count) == lines


@pytest.mark.parametrize("kind", KINDS.values(), ids=list(KINDS))
def test_neighbours_in_the_layout_are_neighbours_on_the_board(kind: BoardKind) -> None:
    assert kind.surface is not None
    index_of = {place: i for i, place in enumerate(zip(kind.row.tolist(), kind.column.tolist(), strict=True))}
    for (row, column), index in index_of.items():
        for neighbour in (index_of.get((row + 1, column)), index_of.get((row, column + 1))):
            if neighbour is not None:
                distance = np.linalg.norm(kind.surface.position[neighbour] - kind.surface.position[index])
                assert 0.0035 < distance < 0.011  # m; the neighbours of the boards are 3.7 to 10.5 mm apart


@pytest.mark.parametrize("kind", KINDS.values(), ids=list(KINDS))
def test_row_0_is_distal_and_column_0_is_left(kind: BoardKind) -> None:
    assert kind.surface is not None
    to_left = np.cross(kind.surface.normal, kind.surface.distal)
    index_of = {place: i for i, place in enumerate(zip(kind.row.tolist(), kind.column.tolist(), strict=True))}
    down, across = [], []
    for (row, column), index in index_of.items():
        for place, steps, axis in (
            ((row + 1, column), down, kind.surface.distal),
            ((row, column + 1), across, to_left),
        ):
            if place in index_of:
                step = kind.surface.position[index_of[place]] - kind.surface.position[index]
                steps.append(float(step @ axis[index]))
    assert np.median(down) < 0
    assert np.median(across) < 0


def test_the_squares_of_a_fitted_board_do_not_overlap() -> None:
    """Squares in nearly the same plane overlap if they are nearer than 90 % of half the sum of their sides."""
    for kind in {board.kind.name: board.kind for board in HAND.boards}.values():
        assert kind.surface is not None
        position, size = kind.surface.position, kind.surface.size
        for index in range(kind.taxel_count):
            offsets = position - position[index]
            facing = kind.surface.normal @ kind.surface.normal[index] > 0.99
            to_left = np.cross(kind.surface.normal[index], kind.surface.distal[index])
            along, across = np.abs(offsets @ kind.surface.distal[index]), np.abs(offsets @ to_left)
            overlaps = (along < 0.9 * 0.5 * (size[:, 0] + size[index, 0])) & (
                across < 0.9 * 0.5 * (size[:, 1] + size[index, 1])
            )
            overlaps &= facing & (np.abs(offsets @ kind.surface.normal[index]) < 0.002)
            assert np.flatnonzero(overlaps).tolist() == [index], kind.name


def test_the_sheet_covers_taxels_strips_and_margin() -> None:
    sheet = build_sheet(HAND)
    assert sheet.n_taxels > HAND.n_taxels
    np.testing.assert_allclose(np.sum(sheet.normal * sheet.distal, axis=1), 0.0, atol=2e-3)
    assert sheet.size.min() > 2e-4  # sides of the squares, metres
    assert sheet.size.max() < 0.012
    # A division of each square into 3 x 3 pieces keeps the total area.
    divided = build_sheet(HAND, 3)
    np.testing.assert_allclose(divided.area_share.sum(), sheet.area_share.sum(), rtol=1e-12)
