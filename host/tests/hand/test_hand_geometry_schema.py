"""Every error in the geometry of a hand description is reported in one line."""

import copy
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taxel.hand import HandDescriptionError, load_hand
from taxel.hand.errors import HandGeometryError
from taxel.hand.schema import check_hand, parse_hand

VALID = """\
format = "taxel-hand"
version = 1
name = "bench"
description = "Two boards of one kind on a finger, one of another on the palm"
robot = "bench_robot"

[taxel]
pitch_m = 0.005
size_m = 0.003
layer_m = 0.001

[kinds.patch]
code = 1
tx = 2
rx = 2
taxels = 3
crossings = '''
##
.#
'''

[kinds.strip]
code = 2
tx = 1
rx = 2
taxels = 2
crossings = '##'

[[boards]]
name = "left"
kind = "patch"
address = 0x10
link = "finger"
position_m = [0.01, 0, 0.02]
quaternion_wxyz = [0.6, 0.8, 0, 0]

[[boards]]
name = "right"
kind = "patch"
address = 0x11
link = "finger"
position_m = [-0.01, 0, 0.02]
quaternion_wxyz = [1, 0, 0, 0]

[[boards]]
name = "edge"
kind = "strip"
address = 0x12
link = "palm"
position_m = [0, 0.03, 0]
quaternion_wxyz = [0, 1, 0, 0]

[geometry.patch]
taxels = [
    [0.0025, 0.0025, 0, 0, 0, 1],
    [0.0025, -0.0025, 0, 0, 0.6, 0.8],
    [-0.0025, -0.0025, 0, 0, 0, 1],
]

[geometry.strip]
taxels = [
    [0, 0.002, 0.001, 0, 1, 0],
    [0, -0.002, 0.001, 0, -1, 0],
]
"""

GEOMETRY = VALID[VALID.index("[geometry.patch]") :]
STRIP = VALID[VALID.index("[geometry.strip]") :]
ROBOT = 'robot = "bench_robot"\n'
ROW = "    [0.0025, 0.0025, 0, 0, 0, 1],\n"
LINK = 'link = "palm"\n'
PLACE = "position_m = [0, 0.03, 0]\n"
TURN = "quaternion_wxyz = [0, 1, 0, 0]\n"
LONG = "1" * 180

# Text in VALID, its replacement, the field in the error, and a part of the error message.
INVALID_EDITS: dict[str, tuple[str, str, str, str]] = {
    "geometry without a robot": (ROBOT, "", "robot", "the name of a robot, found nothing; add robot"),
    "robot without geometry": (GEOMETRY, "", "geometry", "add [geometry.<kind>], or remove robot"),
    "robot no string": (ROBOT, "robot = 3\n", "robot", "expected a string, found 3"),
    "robot a path": (ROBOT, 'robot = "../arm.toml"\n', "robot", "found '../arm.toml'; rename it"),
    "geometry a number": (GEOMETRY, "", "geometry", "a table per kind, found nothing"),
    "no layer": ("layer_m = 0.001\n", "", "taxel.layer_m", "expected a number, found nothing; add the thickness"),
    "layer negative": ("layer_m = 0.001", "layer_m = -0.001", "taxel.layer_m", "metres, above 0"),
    "layer zero": ("layer_m = 0.001", "layer_m = 0", "taxel.layer_m", "metres, above 0"),
    "layer in millimetres": ("layer_m = 0.001", "layer_m = 1", "taxel.layer_m", "write the length in metres"),
    "layer not a number": ("layer_m = 0.001", "layer_m = nan", "taxel.layer_m", "found nan"),
    "layer a string": ("layer_m = 0.001", 'layer_m = "1 mm"', "taxel.layer_m", "expected a number, found '1 mm'"),
    "missing geometry of a kind": (
        STRIP,
        "",
        "geometry.strip",
        "expected a table, found nothing; add [geometry.strip]",
    ),
    "unknown kind": ("[geometry.strip]", "[geometry.stripe]", "geometry.stripe", "did you mean strip?"),
    "a kind that is a number": (
        GEOMETRY,
        "[geometry]\nstrip = 1\n" + GEOMETRY.replace(STRIP, ""),
        "geometry.strip",
        "expected a table, found 1",
    ),
    "geometry without taxels": (
        "taxels = [\n    [0, 0.002",
        "rows = [\n    [0, 0.002",
        "geometry.strip.rows",
        "known names: layout, margin, taxels",
    ),
    "unknown key of a geometry": (
        STRIP,
        STRIP + "unit = 1\n",
        "geometry.strip.unit",
        "a known key, found an unknown key",
    ),
    "taxels a number": (STRIP, "[geometry.strip]\ntaxels = 2\n", "geometry.strip.taxels", "expected a list, found 2"),
    "taxels a table": (STRIP, "[geometry.strip.taxels]\n", "geometry.strip.taxels", "expected a list, found a table"),
    "a row too few": (ROW, "", "geometry.patch.taxels", "3 rows, one per taxel in the order of the map, found 2"),
    "a row too many": (
        ROW,
        ROW + ROW,
        "geometry.patch.taxels",
        "3 rows, one per taxel in the order of the map, found 4",
    ),
    "no rows": (STRIP, "[geometry.strip]\ntaxels = []\n", "geometry.strip.taxels", "expected 2 rows"),
    "a row of 5 numbers": (
        "0, 0.6, 0.8]",
        "0, 1]",
        "geometry.patch.taxels[1]",
        "6 numbers (x, y, z, nx, ny, nz), found 5",
    ),
    "a row of 7 numbers": ("0, 0.6, 0.8]", "0, 0, 0, 1]", "geometry.patch.taxels[1]", "found 7; write all numbers"),
    "a row that is a number": (ROW, "    1,\n", "geometry.patch.taxels[0]", "expected a list, found 1"),
    "a row that is a string": (ROW, "    '1 2 3 0 0 1',\n", "geometry.patch.taxels[0]", "expected a list"),
    "a coordinate not a number": (
        "[0, 0.002,",
        "[nan, 0.002,",
        "geometry.strip.taxels[0][0]",
        "a finite number, found nan",
    ),
    "a coordinate infinite": ("[0, 0.002,", "[0, -inf,", "geometry.strip.taxels[0][1]", "a finite number, found -inf"),
    "a coordinate a string": ("[0, 0.002,", "[0, '2 mm',", "geometry.strip.taxels[0][1]", "a number, found '2 mm'"),
    "a coordinate true": ("[0, 0.002,", "[0, true,", "geometry.strip.taxels[0][1]", "a number, found true"),
    "a coordinate in millimetres": ("[0, 0.002,", "[0, 20,", "geometry.strip.taxels[0]", "found 20; convert to metres"),
    "a coordinate below zero in millimetres": (
        "[0, -0.002,",
        "[0, -20,",
        "geometry.strip.taxels[1]",
        "found -20; convert to metres",
    ),
    "a normal of length 2": (
        "0.001, 0, 1, 0]",
        "0.001, 0, 2, 0]",
        "geometry.strip.taxels[0]",
        "found length 2; normalise it",
    ),
    "a normal of length 0": ("0.001, 0, 1, 0]", "0.001, 0, 0, 0]", "geometry.strip.taxels[0]", "a normal of length 1"),
    "a normal not a number": ("0.001, 0, 1, 0]", "0.001, 0, nan, 0]", "geometry.strip.taxels[0][4]", "found nan"),
    "a normal too long to square": (
        "0.001, 0, 1, 0]",
        f"0.001, 0,\n{LONG}, 0]",
        "geometry.strip.taxels[0][4]",
        "an integer of 64 bits",
    ),
    "a board without a link": (
        LINK,
        "",
        "boards[2].link",
        "the pose of the bracket on its link, found nothing; add link",
    ),
    "a board without a position": (PLACE, "", "boards[2].position_m", "found nothing; add position_m"),
    "a board without a quaternion": (TURN, "", "boards[2].quaternion_wxyz", "found nothing; add quaternion_wxyz"),
    "link no string": (LINK, "link = 3\n", "boards[2].link", "expected a string, found 3"),
    "link no identifier": (LINK, 'link = "the palm"\n', "boards[2].link", "found 'the palm'; rename it"),
    "link empty": (LINK, 'link = ""\n', "boards[2].link", "found ''; rename it"),
    "position of two numbers": (PLACE, "position_m = [0, 0]\n", "boards[2].position_m", "3 numbers (x, y, z), found 2"),
    "position in millimetres": (
        PLACE,
        "position_m = [0, 30, 0]\n",
        "boards[2].position_m",
        "found 30; convert to metres",
    ),
    "position not a number": (PLACE, "position_m = [0, nan, 0]\n", "boards[2].position_m[1]", "found nan"),
    "position a number": (PLACE, "position_m = 0.03\n", "boards[2].position_m", "expected a list, found 0.03"),
    "quaternion not unit": (TURN, "quaternion_wxyz = [1, 1, 0, 0]\n", "boards[2].quaternion_wxyz", "length 1.414"),
    "quaternion zero": (TURN, "quaternion_wxyz = [0, 0, 0, 0]\n", "boards[2].quaternion_wxyz", "found length 0"),
    "quaternion of three": (
        TURN,
        "quaternion_wxyz = [0, 0, 1]\n",
        "boards[2].quaternion_wxyz",
        "4 numbers (w, x, y, z)",
    ),
    "quaternion infinite": (TURN, "quaternion_wxyz = [inf, 0, 0, 0]\n", "boards[2].quaternion_wxyz[0]", "found inf"),
    "quaternion a string": (TURN, "quaternion_wxyz = 'x'\n", "boards[2].quaternion_wxyz", "expected a list, found 'x'"),
    "unknown key of a pose": (TURN, TURN + "rpy = [0, 0, 0]\n", "boards[2].rpy", "a known key, found an unknown key"),
    "a misspelt position": (
        "position_m = [0, 0.03",
        "positon_m = [0, 0.03",
        "boards[2].positon_m",
        "did you mean position_m?",
    ),
}

ODD_VALUES: st.SearchStrategy[Any] = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(10**100), 10**100),
    st.floats(),
    st.text(max_size=80),
    st.builds(list),
    st.builds(dict),
    st.lists(st.floats() | st.integers() | st.text(max_size=3), max_size=7),
    st.builds(lambda: [[[]]]),
    st.sampled_from(["patch", "strip", "left", "right", "finger", "palm", "##"]),
)


def assert_one_line(error: HandDescriptionError, file: str, field: str) -> None:
    """Check that an error is one line with file, field, expected and found content, and remedy."""
    line = str(error)
    assert line.isprintable()
    assert line.startswith(f"{file}: {field}: expected ")
    assert ", found " in line
    assert "; " in line
    assert (error.file, error.field) == (file, field)


def load_error(text: str) -> HandDescriptionError:
    """Return the error that parsing a hand description raises."""
    with pytest.raises(HandDescriptionError) as caught:
        parse_hand(text.encode(), "bench.toml")
    return caught.value


def list_entries(value: Any) -> list[tuple[Any, Any]]:
    """List every table or list of a document with each of its keys or indices."""
    keys = list(value) if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    entries = [(value, key) for key in keys]
    for key in keys:
        entries += list_entries(value[key])
    return entries


def remove_geometry() -> str:
    """Return the valid description without robot, geometry and poses of boards."""
    text = VALID.replace(GEOMETRY, "").replace(ROBOT, "")
    return "".join(
        line
        for line in text.splitlines(keepends=True)
        if not line.startswith(("link", "position_m", "quaternion_wxyz"))
    )


def test_the_unmodified_description_is_valid(tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_text(VALID)
    hand = load_hand(path)
    assert (hand.robot, hand.layer_m) == ("bench_robot", 0.001)
    assert [board.link_name for board in hand.boards] == ["finger", "finger", "palm"]
    np.testing.assert_array_equal(hand.position[:3], hand.position[3:6])
    np.testing.assert_allclose(hand.position[6:], [[0, 0.002, 0.001], [0, -0.002, 0.001]])
    np.testing.assert_allclose(hand.normal[1], [0, 0.6, 0.8])
    pose = hand.boards[0].pose
    assert pose is not None
    np.testing.assert_allclose(pose[:3, 3], [0.01, 0, 0.02])
    # A rotation about x by twice the angle whose cosine is 0.6.
    np.testing.assert_allclose(pose[:3, :3], [[1, 0, 0], [0, -0.28, -0.96], [0, 0.96, -0.28]], atol=1e-15)


@pytest.mark.parametrize("edit", INVALID_EDITS)
def test_an_invalid_description_raises_a_one_line_error(edit: str) -> None:
    old, new, field, message = INVALID_EDITS[edit]
    assert old in VALID
    error = load_error(VALID.replace(old, new, 1))
    assert_one_line(error, "bench.toml", field)
    assert message in str(error)


@pytest.mark.parametrize("key", ["link", "position_m", "quaternion_wxyz"])
def test_a_pose_without_a_robot_is_rejected(key: str) -> None:
    value = {"link": '"palm"', "position_m": "[0, 0, 0]", "quaternion_wxyz": "[1, 0, 0, 0]"}[key]
    error = load_error(remove_geometry() + f"{key} = {value}\n")
    assert_one_line(error, "bench.toml", f"boards[2].{key}")
    assert "no pose without a robot" in str(error)


def test_a_hand_without_geometry_raises_when_positions_are_requested(tmp_path: Path) -> None:
    path = tmp_path / "bare.toml"
    path.write_text(remove_geometry())
    hand = load_hand(path)
    assert hand.robot is None
    assert [board.link_name for board in hand.boards] == [None] * 3
    for name in ("position", "normal", "distal"):
        with pytest.raises(
            HandGeometryError, match="hand 'bench': the description contains no taxel positions; add robot"
        ):
            getattr(hand, name)


def test_the_layer_thickness_is_valid_without_geometry(tmp_path: Path) -> None:
    path = tmp_path / "bare.toml"
    path.write_text(remove_geometry())
    assert load_hand(path).layer_m == 0.001


def test_a_rounded_normal_is_normalised(tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_text(VALID.replace("0, 0.6, 0.8]", "0, 0.707, 0.707]"))
    normal = load_hand(path).normal[1]
    np.testing.assert_allclose(normal, [0, 0.5**0.5, 0.5**0.5], rtol=1e-15)


@given(data=st.data())
def test_a_random_value_is_accepted_or_raises_a_one_line_error(data: st.DataObject) -> None:
    document = copy.deepcopy(tomllib.loads(VALID))
    for _ in range(data.draw(st.integers(1, 3))):
        if not list_entries(document):
            break
        holder, key = data.draw(st.sampled_from(list_entries(document)))
        if data.draw(st.booleans()):
            del holder[key]
        else:
            holder[key] = data.draw(ODD_VALUES)
    try:
        check_hand(document, "any.toml")
    except HandDescriptionError as error:
        line = str(error)
    else:
        line = "any.toml: "
    assert line.isprintable()
    assert line.startswith("any.toml: ")


@given(
    position=st.integers(VALID.index("[[boards]]"), len(VALID)),
    removed=st.integers(0, 12),
    inserted=st.text(st.sampled_from("\"'#.=[]{},\n 0123456789abex-_\\\ré"), max_size=6),
)
def test_a_random_edit_is_accepted_or_raises_a_one_line_error(position: int, removed: int, inserted: str) -> None:
    edited = VALID[:position] + inserted + VALID[position + removed :]
    try:
        parse_hand(edited.encode(), "any.toml")
    except HandDescriptionError as error:
        line = str(error)
    else:
        line = "any.toml: "
    assert line.isprintable()
    assert line.startswith("any.toml: ")
