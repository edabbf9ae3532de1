"""Geometry of the packaged skins: taxel positions on the brackets and bracket poses on the hand."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from taxel.hand import BoardKind, Hand, load_hand
from taxel.hand.geometry import Surface, build_surface
from taxel.hand.kinematics import build_kinematics

HAND = load_hand("allegro")
KINDS = {board.kind.name: board.kind for board in HAND.boards}
FLAT = ("palm", "back_of_hand", "medial_front")
WRAPPED = ("proximal_front", "proximal_back", "medial_back")
ROUNDING_M = 2e-6  # the files contain positions and normals with six decimals
TIP_RADIUS_M = 0.017  # 12 mm of dome and 5 mm of bracket
BRACKETS = Path(__file__).parents[3] / "tools" / "hand" / "brackets.py"


def get_surface(kind: str) -> Surface:
    """Return taxel positions and directions of a kind of board."""
    result = KINDS[kind].surface
    assert result is not None
    return result


def compute_distances(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the distances between all points, f64[n, n]; infinite on the diagonal."""
    result = np.linalg.norm(points[:, None] - points, axis=-1)
    np.fill_diagonal(result, np.inf)
    return np.asarray(result)


def find_pairs(kind: BoardKind, tx: int, rx: int) -> list[tuple[int, int]]:
    """Find pairs of taxels that are `tx` and `rx` lines apart."""
    index_of = {(int(t), int(r)): i for i, (t, r) in enumerate(zip(kind.tx, kind.rx, strict=True))}
    return [(i, index_of[t + tx, r + rx]) for (t, r), i in index_of.items() if (t + tx, r + rx) in index_of]


def compute_arc_length(sheet: Surface, first: int, second: int) -> float:
    """Compute the length of the arc between two taxels from the chord and the angle between the normals."""
    chord = float(np.linalg.norm(sheet.position[first] - sheet.position[second]))
    half_angle = 0.5 * np.arccos(np.clip(sheet.normal[first] @ sheet.normal[second], -1.0, 1.0))
    return chord if half_angle < 1e-6 else chord * float(half_angle / np.sin(half_angle))


def make_open_pose() -> NDArray[np.float64]:
    """Make joint angles of straight fingers, with the thumb at the lower limit of its first joint."""
    robot = build_kinematics(HAND).robot
    return np.clip(np.zeros(len(robot.joint_names)), robot.lower, robot.upper)


def test_every_taxel_has_a_position_and_orthogonal_directions() -> None:
    assert HAND.position.shape == HAND.normal.shape == HAND.distal.shape == (1073, 3)
    for name in ("normal", "distal"):
        np.testing.assert_allclose(np.linalg.norm(getattr(HAND, name), axis=1), 1.0, rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.sum(HAND.normal * HAND.distal, axis=1), 0.0, atol=1e-12)


def test_positions_are_in_the_order_of_all_other_arrays() -> None:
    for index, board in enumerate(HAND.boards):
        taxels = HAND.get_slice(board.address)
        np.testing.assert_array_equal(HAND.position[taxels], get_surface(board.kind.name).position)
        assert set(HAND.board_index[taxels].tolist()) == {index}
        assert set(HAND.sensor[taxels].tolist()) == {board.address}


def test_arrays_are_read_only() -> None:
    for array in (HAND.position, HAND.normal, HAND.distal, HAND.board_index, get_surface("palm").position):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


def test_every_taxel_is_within_60_mm_of_its_bracket_origin() -> None:
    assert np.linalg.norm(HAND.position, axis=1).max() < 0.060


@pytest.mark.parametrize("kind", KINDS)
def test_taxels_of_a_board_do_not_overlap(kind: str) -> None:
    assert compute_distances(get_surface(kind).position).min() > HAND.size_m


@pytest.mark.parametrize("kind", FLAT)
def test_a_flat_board_is_flat(kind: str) -> None:
    sheet = get_surface(kind)
    np.testing.assert_array_equal(sheet.normal, np.broadcast_to([0.0, 0.0, 1.0], sheet.normal.shape))
    np.testing.assert_array_equal(sheet.distal, np.broadcast_to([1.0, 0.0, 0.0], sheet.distal.shape))
    assert np.abs(sheet.position[:, 2]).max() == 0.0


@pytest.mark.parametrize("kind", [*FLAT, *WRAPPED])
def test_tx_decreases_to_the_distal_end_and_rx_to_the_left(kind: str) -> None:
    sheet = get_surface(kind)
    assert all(
        sheet.position[taxel, 0] > sheet.position[neighbour, 0] for taxel, neighbour in find_pairs(KINDS[kind], 1, 0)
    )
    lateral = [sheet.position[taxel] - sheet.position[neighbour] for taxel, neighbour in find_pairs(KINDS[kind], 0, 1)]
    normals = [sheet.normal[taxel] + sheet.normal[neighbour] for taxel, neighbour in find_pairs(KINDS[kind], 0, 1)]
    # A step to the left (y) times the normal (z) points in the distal direction (x) everywhere, also on the flanks. The
    # einsum selects the x component of each cross product.
    np.testing.assert_array_less(0.0, np.einsum("ij,ij->i", np.cross(lateral, normals), np.eye(3)[[0] * len(lateral)]))


@pytest.mark.parametrize("kind", WRAPPED)
def test_the_normals_of_a_wrapped_board_reach_a_right_angle_on_both_flanks(kind: str) -> None:
    sheet = get_surface(kind)
    np.testing.assert_array_equal(sheet.distal, np.broadcast_to([1.0, 0.0, 0.0], sheet.distal.shape))
    angle = np.degrees(np.arctan2(sheet.normal[:, 1], sheet.normal[:, 2]))
    assert (angle.min(), angle.max()) == (-90.0, 90.0)
    assert np.count_nonzero(angle == 0.0) > 0.4 * len(angle)
    assert (sheet.position[np.abs(angle) == 90.0, 2] < 0).all()  # on the flanks, towards the opposite board
    assert np.ptp(sheet.position[:, 1]) < 0.032  # width of the link, its brackets and 0.5 mm


@pytest.mark.parametrize("kind", KINDS)
def test_neighbours_on_a_line_are_one_pitch_apart_where_the_sheet_is_flat(kind: str) -> None:
    sheet = get_surface(kind)
    for taxel, neighbour in [*find_pairs(KINDS[kind], 1, 0), *find_pairs(KINDS[kind], 0, 1)]:
        if sheet.normal[taxel] @ sheet.normal[neighbour] > 1 - 1e-9:
            distance = np.linalg.norm(sheet.position[taxel] - sheet.position[neighbour])
            assert distance == pytest.approx(HAND.pitch_m, abs=ROUNDING_M)


def test_a_fingertip_is_a_dome_on_a_cylinder() -> None:
    sheet = get_surface("fingertip")
    # TX 0 to 6 are on the dome, whose centre is the origin; the axis of the cylinder is x.
    is_on_dome = KINDS["fingertip"].tx < 7
    np.testing.assert_allclose(
        sheet.position[is_on_dome], TIP_RADIUS_M * sheet.normal[is_on_dome], rtol=0, atol=ROUNDING_M
    )
    cylinder = sheet.position[~is_on_dome]
    assert (cylinder[:, 0] < 0).all()
    np.testing.assert_allclose(cylinder[:, 1:], TIP_RADIUS_M * sheet.normal[~is_on_dome, 1:], rtol=0, atol=ROUNDING_M)
    np.testing.assert_array_equal(sheet.normal[~is_on_dome, 0], 0.0)


def test_taxels_on_the_middle_line_of_a_fingertip_are_one_pitch_apart_from_nail_to_apex() -> None:
    kind, sheet = KINDS["fingertip"], get_surface("fingertip")
    middle_line = np.flatnonzero(kind.rx == 4)
    lengths = [
        compute_arc_length(sheet, taxel, neighbour)
        for taxel, neighbour in find_pairs(kind, 1, 0)
        if {taxel, neighbour} <= set(middle_line)
    ]
    assert len(lengths) == len(middle_line) - 1
    np.testing.assert_allclose(lengths, HAND.pitch_m, rtol=0, atol=ROUNDING_M)
    nail, rows = sheet.normal[middle_line[0]], sheet.normal[middle_line]
    assert nail[2] < -0.3  # the normal at the nail faces the back of the finger
    assert rows[:, 0].max() > 0.99  # the normal at the apex points along the finger
    # The last taxel lies on the straight part, where the normal is z.
    assert rows[-1, 2] == 1.0


def test_taxels_across_a_fingertip_are_one_pitch_apart() -> None:
    kind, sheet = KINDS["fingertip"], get_surface("fingertip")
    lengths = [compute_arc_length(sheet, taxel, neighbour) for taxel, neighbour in find_pairs(kind, 0, 1)]
    np.testing.assert_allclose(lengths, HAND.pitch_m, rtol=0, atol=ROUNDING_M)


def test_boards_do_not_touch_each_other_on_the_open_hand() -> None:
    positions = build_kinematics(HAND).compute_taxel_positions(make_open_pose())
    separation = compute_distances(positions)
    separation[HAND.board_index[:, None] == HAND.board_index] = np.inf
    closest = np.unravel_index(np.argmin(separation), separation.shape)
    assert separation[closest] > 0.002, [HAND.boards[HAND.board_index[index]].name for index in closest]


def test_front_boards_face_out_of_the_palm_and_back_boards_away_from_it() -> None:
    kinematics = build_kinematics(HAND)
    palm = kinematics.compute_link_poses(make_open_pose())[kinematics.robot.get_link_index("palm")]
    for board, pose in zip(HAND.boards, kinematics.compute_sensor_poses(make_open_pose()), strict=True):
        if board.name.endswith("thumb"):
            continue
        outward = float(palm[:3, 0] @ pose[:3, 2])
        is_back_board = "back" in board.name
        assert outward == pytest.approx(-1.0 if is_back_board else 1.0, abs=0.01), board.name
        assert float(palm[:3, 2] @ pose[:3, 0]) > 0.99, board.name  # distal is towards the fingertips


def test_the_link_of_a_board_agrees_with_its_name() -> None:
    fingers = {"index": "ff", "middle": "mf", "pinkie": "rf", "thumb": "th"}
    for board in HAND.boards:
        board_part, _, finger = board.name.rpartition("_")
        if finger in fingers:
            link = "distal" if board_part == "fingertip" else board_part.split("_")[0]
            assert board.link_name == f"{fingers[finger]}_{link}"


def test_flat8_lies_on_the_plate() -> None:
    hand = load_hand("flat8")
    assert (hand.robot, hand.boards[0].link_name, hand.n_taxels) == ("plate", "plate", 64)
    np.testing.assert_array_equal(hand.normal, np.broadcast_to([0.0, 0.0, 1.0], (64, 3)))
    assert np.ptp(hand.position, axis=0) == pytest.approx([0.035, 0.035, 0.0])  # 7 pitches of 5 mm
    np.testing.assert_allclose(hand.position.mean(axis=0), 0.0, atol=1e-15)


@pytest.mark.parametrize("hand", [HAND, load_hand("flat8")], ids=lambda hand: hand.name)
def test_the_dielectric_is_2_mm_thick(hand: Hand) -> None:
    assert hand.layer_m == 0.002
    assert hand.layer_m < hand.pitch_m


def test_the_descriptions_agree_with_the_brackets_tool() -> None:
    result = subprocess.run(
        [sys.executable, str(BRACKETS), "--check"], capture_output=True, text=True, timeout=60, check=False
    )
    assert (result.returncode, result.stdout) == (0, "")


def test_a_surface_normalises_its_vectors() -> None:
    sheet = Surface(np.zeros((1, 3)), np.array([[0.0, 0.0, 3.0]]), np.array([[2.0, 0.0, 0.0]]))
    np.testing.assert_array_equal(sheet.normal, [[0.0, 0.0, 1.0]])
    np.testing.assert_array_equal(sheet.distal, [[1.0, 0.0, 0.0]])


def test_a_surface_with_wrong_shapes_or_a_zero_normal_is_rejected() -> None:
    unit_vector = np.eye(3)[:1]
    with pytest.raises(ValueError, match=r"normal: expected \[count, 3\]"):
        Surface(unit_vector, np.ones((2, 3)), unit_vector)
    with pytest.raises(ValueError, match="normal: expected vectors longer than 0"):
        Surface(unit_vector, np.zeros((1, 3)), unit_vector)


def test_equal_surfaces_are_equal_and_have_equal_hashes() -> None:
    first, second = load_hand("flat8"), load_hand("flat8")
    assert first == second
    assert hash(first.boards[0].kind) == hash(second.boards[0].kind)
    sheet = first.boards[0].kind.surface
    assert sheet is not None
    assert sheet != Surface(sheet.position + 0.001, sheet.normal, sheet.distal)


@pytest.mark.parametrize("normal", [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
def test_a_single_taxel_has_a_distal_direction(normal: list[float]) -> None:
    """A single taxel has no neighbour in its column, from which the distal direction follows otherwise."""
    rows = np.array([[0.0, 0.0, 0.0, *normal]])
    line = np.zeros(1, dtype=np.uint8)
    sheet = build_surface(rows, row=line, column=line, pitch_m=0.005)
    assert np.linalg.norm(sheet.distal) == pytest.approx(1.0)
    assert sheet.distal[0] @ sheet.normal[0] == pytest.approx(0.0)
