"""Dielectric sheet of a board: squares over its taxels, a margin around them, and the pieces of squares."""

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
PITCH_M = 0.005


def get_margin(kind: BoardKind) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return centres, normals and distal directions of the margin of a kind."""
    assert kind.surface is not None
    rows = build_margin(kind, kind.surface, PITCH_M)
    return rows[:, :3], rows[:, 3:6], rows[:, 6:9]


def compute_taxel_distances_m(kind: BoardKind) -> FloatArray:
    """Compute the distance from each margin square to its nearest taxel, f64[m], metres."""
    assert kind.surface is not None
    return np.asarray(np.linalg.norm(get_margin(kind)[0][:, None] - kind.surface.position, axis=2).min(axis=1))


def find_margin_crossings(kind: BoardKind) -> set[tuple[int, int]]:
    """Find the crossings without a taxel, up to one step outside the map, that have a taxel as neighbour."""
    has_taxel = np.pad(kind.crossings, 2)
    has_neighbour = np.zeros_like(has_taxel)
    for axis, step in ((0, 1), (0, -1), (1, 1), (1, -1)):
        has_neighbour |= np.roll(has_taxel, step, axis)
    return {(int(tx) - 2, int(rx) - 2) for tx, rx in zip(*np.nonzero(has_neighbour & ~has_taxel), strict=True)}


def make_bent_kind(radius_tx: float, radius_rx: float, tx: int = 4, rx: int = 5) -> BoardKind:
    """Make a board bent about one axis; a radius of infinity is flat. TX 0 is distal (x), RX 0 left (y)."""
    along = PITCH_M * ((tx - 1) / 2 - np.repeat(np.arange(tx), rx))
    across = PITCH_M * ((rx - 1) / 2 - np.tile(np.arange(rx), tx))
    along_angle, across_angle = along / radius_tx, across / radius_rx
    zero = np.zeros(tx * rx)
    if np.isfinite(radius_tx):
        position = np.stack([radius_tx * np.sin(along_angle), across, radius_tx * (np.cos(along_angle) - 1.0)], axis=1)
        normal, distal = (
            np.stack([np.sin(along_angle), zero, np.cos(along_angle)], axis=1),
            np.stack([np.cos(along_angle), zero, -np.sin(along_angle)], axis=1),
        )
    else:
        position = np.stack([along, radius_rx * np.sin(across_angle), radius_rx * (np.cos(across_angle) - 1.0)], axis=1)
        normal, distal = (
            np.stack([zero, np.sin(across_angle), np.cos(across_angle)], axis=1),
            np.tile([1.0, 0.0, 0.0], (tx * rx, 1)),
        )
    return BoardKind("bent", 1, np.ones((tx, rx), dtype=bool), Surface(position, normal, distal))


@pytest.mark.parametrize("hand", HANDS, ids=lambda hand: hand.name)
def test_the_first_squares_are_the_taxels_in_the_order_of_the_hand(hand: Hand) -> None:
    sheet = build_sheet(hand)
    for name in ("position", "normal", "distal", "board_index"):
        np.testing.assert_array_equal(getattr(sheet, name)[: hand.n_taxels], getattr(hand, name))
    assert (sheet.name, sheet.boards, sheet.layer_m) == (hand.name, hand.boards, hand.layer_m)
    for index, board in enumerate(hand.boards):
        margin_count = int((sheet.board_index[hand.n_taxels :] == index).sum())
        assert margin_count == len(find_margin_crossings(board.kind)) > 0


@pytest.mark.parametrize("parts", [1, 2, 3])
def test_normals_and_distal_directions_are_orthogonal_unit_vectors(parts: int) -> None:
    sheet = build_sheet(HAND, parts)
    for vectors in (sheet.normal, sheet.distal):
        np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), 1.0, rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.sum(sheet.normal * sheet.distal, axis=1), 0.0, atol=1e-6)


@pytest.mark.parametrize("kind", FLAT)
def test_the_margin_of_a_flat_board_continues_the_grid_by_one_pitch(kind: str) -> None:
    sheet = KINDS[kind].surface
    assert sheet is not None
    position, normal, distal = get_margin(KINDS[kind])
    np.testing.assert_allclose(compute_taxel_distances_m(KINDS[kind]), PITCH_M, atol=2e-6)
    np.testing.assert_allclose(normal, np.tile(sheet.normal[0], (len(normal), 1)), atol=1e-9)
    np.testing.assert_allclose(distal, np.tile(sheet.distal[0], (len(distal), 1)), atol=1e-9)
    steps = (position - sheet.position[0]) / PITCH_M
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-3)


@pytest.mark.parametrize("kind", FLAT)
def test_squares_of_the_margin_do_not_overlap_other_squares(kind: str) -> None:
    sheet = KINDS[kind].surface
    assert sheet is not None
    centres = np.concatenate([sheet.position, get_margin(KINDS[kind])[0]])
    distance = np.linalg.norm(centres[:, None] - centres, axis=2) + np.eye(len(centres))
    assert distance.min() == pytest.approx(PITCH_M, abs=2e-6)


@pytest.mark.parametrize("kind", [*WRAPPED, "fingertip"])
def test_the_margin_of_a_bent_board_is_about_one_pitch_away(kind: str) -> None:
    """A distance is the chord of an arc, so it differs from the pitch. Where two neighbours extrapolate a square of the
    margin to different places, the square lies at their mean.
    """
    distance = compute_taxel_distances_m(KINDS[kind])
    assert 0.6 * PITCH_M < distance.min() <= distance.max() < 1.3 * PITCH_M
    assert np.median(distance) == pytest.approx(PITCH_M, rel=0.05)


@pytest.mark.parametrize("radii", [(0.02, np.inf), (np.inf, 0.012), (-0.03, np.inf)], ids=str)
def test_the_margin_of_a_cylindrical_board_continues_the_cylinder(radii: tuple[float, float]) -> None:
    kind = make_bent_kind(*radii)
    position, normal, distal = get_margin(kind)
    axis = 0 if np.isfinite(radii[0]) else 1
    radius = radii[axis]
    # A board of 4 x 5 taxels has a margin of one square at both ends of each of its 4 + 5 lines.
    assert len(position) == 2 * (4 + 5)
    # Normals point away from the axis of the cylinder, and the arc to the next taxel is one pitch.
    np.testing.assert_allclose(position[:, [axis, 2]], radius * normal[:, [axis, 2]] - [0.0, radius], atol=2e-4)
    np.testing.assert_allclose(normal[:, 1 - axis], 0.0, atol=1e-9)
    angles = np.arctan2(normal[:, axis], normal[:, 2])
    half_length = PITCH_M * ((4 - 1) / 2, (5 - 1) / 2)[axis]
    is_outside = np.abs(angles * radius) > half_length + 0.5 * PITCH_M
    assert is_outside.sum() == 2 * (5, 4)[axis]
    np.testing.assert_allclose(np.abs(angles * radius)[is_outside], half_length + PITCH_M, rtol=0.02)
    forward = np.stack([np.cos(angles), 0 * angles, -np.sin(angles)], axis=1) if axis == 0 else [[1.0, 0.0, 0.0]]
    np.testing.assert_allclose(distal, np.broadcast_to(forward, distal.shape), atol=0.02)


def test_the_margin_beyond_the_dome_of_a_fingertip_continues_the_dome() -> None:
    """TX 0 is on the nail side of the dome, whose centre is the bracket origin; a margin square precedes it."""
    kind = KINDS["fingertip"]
    assert kind.surface is not None
    position, normal, _ = get_margin(kind)
    margin_index = sorted(find_margin_crossings(kind)).index((-1, 4))
    assert np.linalg.norm(position[margin_index]) == pytest.approx(DOME_RADIUS_M, rel=0.01)
    assert normal[margin_index] @ position[margin_index] / np.linalg.norm(position[margin_index]) == pytest.approx(
        1.0, abs=1e-3
    )
    angles = np.unwrap(
        [np.arctan2(n[2], n[0]) for n in (normal[margin_index], *(kind.surface.normal[kind.rx == 4][:2]))]
    )
    steps = [abs(next_angle - angle) * DOME_RADIUS_M for angle, next_angle in pairwise(angles)]
    np.testing.assert_allclose(steps, PITCH_M, rtol=0.02)


def test_a_board_of_one_taxel_has_a_margin_of_four_squares() -> None:
    unit_vector = np.eye(3)[:1]
    kind = BoardKind("single", 1, np.ones((1, 1), dtype=bool), Surface(0 * unit_vector, np.eye(3)[2:], unit_vector))
    position, normal, distal = get_margin(kind)
    assert {tuple(np.round(centre / PITCH_M).astype(int).tolist()) for centre in position} == {
        (1, 0, 0),
        (-1, 0, 0),
        (0, 1, 0),
        (0, -1, 0),
    }
    np.testing.assert_array_equal(normal, np.tile([0.0, 0.0, 1.0], (4, 1)))
    np.testing.assert_array_equal(distal, np.tile([1.0, 0.0, 0.0], (4, 1)))


@pytest.mark.parametrize("parts", [2, 3, 4])
def test_pieces_divide_a_flat_square_evenly_and_keep_its_centre(parts: int) -> None:
    undivided, divided = build_sheet(HAND), build_sheet(HAND, parts)
    assert divided.n_taxels == parts**2 * undivided.n_taxels
    np.testing.assert_array_equal(divided.board_index, np.repeat(undivided.board_index, parts**2))
    is_flat = np.isin([board.kind.name for board in HAND.boards], FLAT)[undivided.board_index]
    square = {name: getattr(undivided, name)[is_flat] for name in ("position", "normal", "distal")}
    piece = {name: getattr(divided, name).reshape(undivided.n_taxels, parts**2, 3)[is_flat] for name in square}
    np.testing.assert_allclose(piece["position"].mean(axis=1), square["position"], atol=1e-9)
    offset = piece["position"] - square["position"][:, None]
    # Distances of the pieces' centres from the centre of the square, along one side.
    expected = HAND.pitch_m * ((np.arange(parts) + 0.5) / parts - 0.5)
    for side in (square["distal"], np.cross(square["normal"], square["distal"])):
        along = np.sort(np.einsum("npi,ni->np", offset, side), axis=1)
        np.testing.assert_allclose(along, np.broadcast_to(np.repeat(expected, parts), along.shape), atol=1e-8)
    np.testing.assert_allclose(np.einsum("npi,ni->np", offset, square["normal"]), 0.0, atol=1e-8)
    assert len(np.unique(np.round(offset[0], 7), axis=0)) == parts**2
    for name in ("normal", "distal"):
        np.testing.assert_allclose(piece[name], np.repeat(square[name][:, None], parts**2, axis=1), atol=1e-6)


@pytest.mark.parametrize("radii", [(0.012, np.inf), (np.inf, 0.012)], ids=["along", "across"])
def test_pieces_of_a_bent_board_lie_on_its_cylinder_and_face_outwards(radii: tuple[float, float]) -> None:
    parts, radius = 4, 0.012
    kind = make_bent_kind(*radii)
    board = type(HAND.boards[0])("bent", kind, 8, None, np.eye(4))
    divided = build_sheet(Hand("bent", "a bent board", PITCH_M, 0.003, (board,)), parts)
    board_squares = slice(0, kind.crossings.sum() * parts**2)
    axis = 0 if np.isfinite(radii[0]) else 1
    radial = divided.position[board_squares] + radius * np.array([0.0, 0.0, 1.0])
    radial[:, 1 - axis] = 0.0
    height = np.linalg.norm(radial, axis=1)
    flat_radius = np.hypot(radius, 1.5 * PITCH_M / parts)  # radius of an outer piece in the plane of its square
    assert np.abs(height - radius).max() < 0.05 * (flat_radius - radius)
    cosine = np.sum(divided.normal[board_squares] * radial, axis=1) / height
    assert cosine.min() > np.cos(0.01)


def test_one_part_is_the_undivided_square() -> None:
    sheet = build_sheet(HAND, 1)
    assert isinstance(sheet, Sheet)
    np.testing.assert_allclose(sheet.position[: HAND.n_taxels], HAND.position, rtol=0, atol=1e-15)


def test_a_hand_without_positions_has_no_sheet() -> None:
    board = HAND.boards[0]
    kind = BoardKind(board.kind.name, board.kind.code, board.kind.crossings)
    hand = Hand("bare", "no geometry", PITCH_M, 0.003, (type(board)(board.name, kind, board.address),))
    with pytest.raises(HandGeometryError):
        build_sheet(hand)
