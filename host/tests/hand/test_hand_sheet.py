"""The dielectric sheet of a board: squares over its taxels, a margin of bare squares round them, and their pieces."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from taxel.hand import BoardKind, Hand, load_hand
from taxel.hand.errors import HandGeometryError
from taxel.hand.geometry import Surface
from taxel.hand.sheet import Sheet, build_margin, build_sheet
from taxel.types import FloatArray

HAND = load_hand("allegro")
HANDS = [HAND, load_hand("flat8")]
KINDS = {board.kind.name: board.kind for board in HAND.boards}
FLAT = ("palm", "back_of_hand", "medial_front")
WRAPPED = ("proximal_front", "proximal_back", "medial_back")
DOME_RADIUS_M = 0.017
PITCH = 0.005


def margin(kind: BoardKind) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Centres, normals and distal directions of a kind's bare squares."""
    assert kind.surface is not None
    rows = build_margin(kind, kind.surface, PITCH)
    return rows[:, :3], rows[:, 3:6], rows[:, 6:]


def nearest_taxel_m(kind: BoardKind) -> FloatArray:
    assert kind.surface is not None
    return np.asarray(np.linalg.norm(margin(kind)[0][:, None] - kind.surface.position, axis=2).min(axis=1))


def places_beside(kind: BoardKind) -> set[tuple[int, int]]:
    """Crossings without a taxel, in the map or one step outside it, that have a taxel on one of four sides."""
    carries = np.pad(kind.crossings, 2)
    beside = np.zeros_like(carries)
    for axis, step in ((0, 1), (0, -1), (1, 1), (1, -1)):
        beside |= np.roll(carries, step, axis)
    return {(int(tx) - 2, int(rx) - 2) for tx, rx in zip(*np.nonzero(beside & ~carries), strict=True)}


def bent_kind(radius_tx: float, radius_rx: float, tx: int = 4, rx: int = 5) -> BoardKind:
    """A board bent about one axis with either radius (infinite: flat that way); TX 0 is distal (x), RX 0 left (y)."""
    along = PITCH * ((tx - 1) / 2 - np.repeat(np.arange(tx), rx))
    across = PITCH * ((rx - 1) / 2 - np.tile(np.arange(rx), tx))
    a, b = along / radius_tx, across / radius_rx
    zero = np.zeros(tx * rx)
    if np.isfinite(radius_tx):
        position = np.stack([radius_tx * np.sin(a), across, radius_tx * (np.cos(a) - 1.0)], axis=1)
        normal, distal = np.stack([np.sin(a), zero, np.cos(a)], axis=1), np.stack([np.cos(a), zero, -np.sin(a)], axis=1)
    else:
        position = np.stack([along, radius_rx * np.sin(b), radius_rx * (np.cos(b) - 1.0)], axis=1)
        normal, distal = np.stack([zero, np.sin(b), np.cos(b)], axis=1), np.tile([1.0, 0.0, 0.0], (tx * rx, 1))
    return BoardKind("bent", 1, np.ones((tx, rx), dtype=bool), Surface(position, normal, distal))


@pytest.mark.parametrize("hand", HANDS, ids=lambda hand: hand.name)
def test_the_taxels_come_first_in_the_hands_order(hand: Hand) -> None:
    sheet = build_sheet(hand)
    for name in ("position", "normal", "distal", "board_index"):
        np.testing.assert_array_equal(getattr(sheet, name)[: hand.n_taxels], getattr(hand, name))
    assert (sheet.name, sheet.boards, sheet.layer_m) == (hand.name, hand.boards, hand.layer_m)
    for index, board in enumerate(hand.boards):
        bare = int((sheet.board_index[hand.n_taxels :] == index).sum())
        assert bare == len(places_beside(board.kind)) > 0


@pytest.mark.parametrize("parts", [1, 2, 3])
def test_every_normal_and_direction_is_a_unit_vector_and_they_are_square_to_each_other(parts: int) -> None:
    sheet = build_sheet(HAND, parts)
    for vectors in (sheet.normal, sheet.distal):
        np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), 1.0, rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.sum(sheet.normal * sheet.distal, axis=1), 0.0, atol=1e-6)


@pytest.mark.parametrize("kind", FLAT)
def test_the_margin_of_a_flat_board_is_one_pitch_beyond_and_carries_the_grid_on(kind: str) -> None:
    sheet = KINDS[kind].surface
    assert sheet is not None
    position, normal, distal = margin(KINDS[kind])
    np.testing.assert_allclose(nearest_taxel_m(KINDS[kind]), PITCH, atol=2e-6)
    np.testing.assert_allclose(normal, np.tile(sheet.normal[0], (len(normal), 1)), atol=1e-9)
    np.testing.assert_allclose(distal, np.tile(sheet.distal[0], (len(distal), 1)), atol=1e-9)
    steps = (position - sheet.position[0]) / PITCH
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-3)


@pytest.mark.parametrize("kind", FLAT)
def test_no_bare_square_lies_where_a_taxel_or_another_one_is(kind: str) -> None:
    sheet = KINDS[kind].surface
    assert sheet is not None
    centres = np.concatenate([sheet.position, margin(KINDS[kind])[0]])
    apart = np.linalg.norm(centres[:, None] - centres, axis=2) + np.eye(len(centres))
    assert apart.min() == pytest.approx(PITCH, abs=2e-6)


@pytest.mark.parametrize("kind", [*WRAPPED, "fingertip"])
def test_the_margin_of_a_bent_board_is_about_one_pitch_beyond(kind: str) -> None:
    """Chords of the arc, and means where two neighbours carry a square on differently."""
    found = nearest_taxel_m(KINDS[kind])
    assert 0.6 * PITCH < found.min() <= found.max() < 1.3 * PITCH
    assert np.median(found) == pytest.approx(PITCH, rel=0.05)


@pytest.mark.parametrize("radii", [(0.02, np.inf), (np.inf, 0.012), (-0.03, np.inf)], ids=str)
def test_a_margin_goes_on_round_the_cylinder_that_its_board_lies_on(radii: tuple[float, float]) -> None:
    kind = bent_kind(*radii)
    position, normal, distal = margin(kind)
    bent = 0 if np.isfinite(radii[0]) else 1
    radius = radii[bent]
    assert len(position) == 2 * (4 + 5)
    # From the cylinder's axis outwards, and the arc to the next taxel is one pitch.
    np.testing.assert_allclose(position[:, [bent, 2]], radius * normal[:, [bent, 2]] - [0.0, radius], atol=2e-4)
    np.testing.assert_allclose(normal[:, 1 - bent], 0.0, atol=1e-9)
    angles = np.arctan2(normal[:, bent], normal[:, 2])
    half = PITCH * ((4 - 1) / 2, (5 - 1) / 2)[bent]
    beyond = np.abs(angles * radius) > half + 0.5 * PITCH
    assert beyond.sum() == 2 * (5, 4)[bent]
    np.testing.assert_allclose(np.abs(angles * radius)[beyond], half + PITCH, rtol=0.02)
    forward = np.stack([np.cos(angles), 0 * angles, -np.sin(angles)], axis=1) if bent == 0 else [[1.0, 0.0, 0.0]]
    np.testing.assert_allclose(distal, np.broadcast_to(forward, distal.shape), atol=0.02)


def test_the_margin_beyond_a_fingertips_dome_goes_on_round_it() -> None:
    """TX 0 is the nail's side of the dome, whose centre is the bracket's origin; before it comes one bare square."""
    kind = KINDS["fingertip"]
    assert kind.surface is not None
    position, normal, _ = margin(kind)
    first = sorted(places_beside(kind)).index((-1, 4))
    assert np.linalg.norm(position[first]) == pytest.approx(DOME_RADIUS_M, rel=0.01)
    assert normal[first] @ position[first] / np.linalg.norm(position[first]) == pytest.approx(1.0, abs=1e-3)
    angles = np.unwrap([np.arctan2(n[2], n[0]) for n in (normal[first], *(kind.surface.normal[kind.rx == 4][:2]))])
    steps = [abs(b - a) * DOME_RADIUS_M for a, b in pairwise(angles)]
    np.testing.assert_allclose(steps, PITCH, rtol=0.02)


def test_a_board_of_one_taxel_has_four_bare_neighbours() -> None:
    one = np.eye(3)[:1]
    kind = BoardKind("one", 1, np.ones((1, 1), dtype=bool), Surface(0 * one, np.eye(3)[2:], one))
    position, normal, distal = margin(kind)
    assert {tuple(np.round(place / PITCH).astype(int).tolist()) for place in position} == {
        (1, 0, 0),
        (-1, 0, 0),
        (0, 1, 0),
        (0, -1, 0),
    }
    np.testing.assert_array_equal(normal, np.tile([0.0, 0.0, 1.0], (4, 1)))
    np.testing.assert_array_equal(distal, np.tile([1.0, 0.0, 0.0], (4, 1)))


@pytest.mark.parametrize("parts", [2, 3, 4])
def test_pieces_share_a_flat_squares_area_evenly_and_keep_its_centre(parts: int) -> None:
    whole, cut = build_sheet(HAND), build_sheet(HAND, parts)
    assert cut.n_taxels == parts**2 * whole.n_taxels
    np.testing.assert_array_equal(cut.board_index, np.repeat(whole.board_index, parts**2))
    flat = np.isin([board.kind.name for board in HAND.boards], FLAT)[whole.board_index]
    square = {name: getattr(whole, name)[flat] for name in ("position", "normal", "distal")}
    piece = {name: getattr(cut, name).reshape(whole.n_taxels, parts**2, 3)[flat] for name in square}
    np.testing.assert_allclose(piece["position"].mean(axis=1), square["position"], atol=1e-9)
    away = piece["position"] - square["position"][:, None]
    wanted = HAND.pitch_m * ((np.arange(parts) + 0.5) / parts - 0.5)
    for side in (square["distal"], np.cross(square["normal"], square["distal"])):
        along = np.sort(np.einsum("npi,ni->np", away, side), axis=1)
        np.testing.assert_allclose(along, np.broadcast_to(np.repeat(wanted, parts), along.shape), atol=1e-8)
    np.testing.assert_allclose(np.einsum("npi,ni->np", away, square["normal"]), 0.0, atol=1e-8)
    assert len(np.unique(np.round(away[0], 7), axis=0)) == parts**2
    for name in ("normal", "distal"):
        np.testing.assert_allclose(piece[name], np.repeat(square[name][:, None], parts**2, axis=1), atol=1e-6)


@pytest.mark.parametrize("radii", [(0.012, np.inf), (np.inf, 0.012)], ids=["along", "across"])
def test_pieces_of_a_bent_board_lie_on_its_cylinder_and_face_outward(radii: tuple[float, float]) -> None:
    parts, radius = 4, 0.012
    kind = bent_kind(*radii)
    board = type(HAND.boards[0])("bent", kind, 8, None, np.eye(4))
    cut = build_sheet(Hand("bent", "a bent board", PITCH, 0.003, (board,)), parts)
    own = slice(0, kind.crossings.sum() * parts**2)
    axis = 0 if np.isfinite(radii[0]) else 1
    away = cut.position[own] + radius * np.array([0.0, 0.0, 1.0])
    away[:, 1 - axis] = 0.0
    height = np.linalg.norm(away, axis=1)
    flat = np.hypot(radius, 1.5 * PITCH / parts)  # an outer piece that stayed in its square's plane
    assert np.abs(height - radius).max() < 0.05 * (flat - radius)
    lean = np.sum(cut.normal[own] * away, axis=1) / height
    assert lean.min() > np.cos(0.01)


def test_one_part_is_the_square_itself() -> None:
    sheet = build_sheet(HAND, 1)
    assert isinstance(sheet, Sheet)
    np.testing.assert_allclose(sheet.position[: HAND.n_taxels], HAND.position, rtol=0, atol=1e-15)


def test_a_hand_without_positions_has_no_sheet() -> None:
    board = HAND.boards[0]
    kind = BoardKind(board.kind.name, board.kind.code, board.kind.crossings)
    bare = Hand("bare", "no geometry", PITCH, 0.003, (type(board)(board.name, kind, board.address),))
    with pytest.raises(HandGeometryError):
        build_sheet(bare)
