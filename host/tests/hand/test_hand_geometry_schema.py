"""Every mistake in the part of a hand description that places its taxels is refused with one line."""

from __future__ import annotations

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

GOOD = """\
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

GEOMETRY = GOOD[GOOD.index("[geometry.patch]") :]
STRIP = GOOD[GOOD.index("[geometry.strip]") :]
ROBOT = 'robot = "bench_robot"\n'
ROW = "    [0.0025, 0.0025, 0, 0, 0, 1],\n"
LINK = 'link = "palm"\n'
PLACE = "position_m = [0, 0.03, 0]\n"
TURN = "quaternion_wxyz = [0, 1, 0, 0]\n"
LONG = "1" * 180

# What is replaced in GOOD, by what; the field that the error names; a piece of the error.
MISTAKES: dict[str, tuple[str, str, str, str]] = {
    "geometry without a robot": (ROBOT, "", "robot", "the name of a robot, found nothing; add robot"),
    "robot without geometry": (GEOMETRY, "", "geometry", "add [geometry.<kind>], or remove robot"),
    "robot no string": (ROBOT, "robot = 3\n", "robot", "expected a string, found 3"),
    "robot a path": (ROBOT, 'robot = "../arm.toml"\n', "robot", "found '../arm.toml'; rename it"),
    "geometry a number": (GEOMETRY, "", "geometry", "a table for each kind, found nothing"),
    "no layer": ("layer_m = 0.001\n", "", "taxel.layer_m", "expected a number, found nothing; add the layer's"),
    "layer negative": ("layer_m = 0.001", "layer_m = -0.001", "taxel.layer_m", "metres, above 0"),
    "layer zero": ("layer_m = 0.001", "layer_m = 0", "taxel.layer_m", "metres, above 0"),
    "layer in millimetres": ("layer_m = 0.001", "layer_m = 1", "taxel.layer_m", "give the length in metres"),
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
        "known are taxels",
    ),
    "unknown key of a geometry": (
        STRIP,
        STRIP + "unit = 1\n",
        "geometry.strip.unit",
        "a known key, found an unknown one",
    ),
    "taxels a number": (STRIP, "[geometry.strip]\ntaxels = 2\n", "geometry.strip.taxels", "expected a list, found 2"),
    "taxels a table": (STRIP, "[geometry.strip.taxels]\n", "geometry.strip.taxels", "expected a list, found a table"),
    "a row too few": (ROW, "", "geometry.patch.taxels", "3 rows, one a taxel in the map's order, found 2"),
    "a row too many": (ROW, ROW + ROW, "geometry.patch.taxels", "3 rows, one a taxel in the map's order, found 4"),
    "no rows": (STRIP, "[geometry.strip]\ntaxels = []\n", "geometry.strip.taxels", "expected 2 rows"),
    "a row of 5 numbers": (
        "0, 0.6, 0.8]",
        "0, 1]",
        "geometry.patch.taxels[1]",
        "6 numbers (x, y, z, nx, ny, nz), found 5",
    ),
    "a row of 7 numbers": ("0, 0.6, 0.8]", "0, 0, 0, 1]", "geometry.patch.taxels[1]", "found 7; give each of them"),
    "a row that is a number": (ROW, "    1,\n", "geometry.patch.taxels[0]", "expected a list, found 1"),
    "a row that is a string": (ROW, "    '1 2 3 0 0 1',\n", "geometry.patch.taxels[0]", "expected a list"),
    "a place not a number": ("[0, 0.002,", "[nan, 0.002,", "geometry.strip.taxels[0][0]", "a finite number, found nan"),
    "a place infinite": ("[0, 0.002,", "[0, -inf,", "geometry.strip.taxels[0][1]", "a finite number, found -inf"),
    "a place a string": ("[0, 0.002,", "[0, '2 mm',", "geometry.strip.taxels[0][1]", "a number, found '2 mm'"),
    "a place true": ("[0, 0.002,", "[0, true,", "geometry.strip.taxels[0][1]", "a number, found true"),
    "a place in millimetres": ("[0, 0.002,", "[0, 20,", "geometry.strip.taxels[0]", "found 20; give metres"),
    "a place below zero in millimetres": (
        "[0, -0.002,",
        "[0, -20,",
        "geometry.strip.taxels[1]",
        "found -20; give metres",
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
        "geometry.strip.taxels[0]",
        "a normal",
    ),
    "a board without a link": (LINK, "", "boards[2].link", "the bracket's place on its link, found nothing; add link"),
    "a board without a position": (PLACE, "", "boards[2].position_m", "found nothing; add position_m"),
    "a board without a quaternion": (TURN, "", "boards[2].quaternion_wxyz", "found nothing; add quaternion_wxyz"),
    "link no string": (LINK, "link = 3\n", "boards[2].link", "expected a string, found 3"),
    "link no identifier": (LINK, 'link = "the palm"\n', "boards[2].link", "found 'the palm'; rename it"),
    "link empty": (LINK, 'link = ""\n', "boards[2].link", "found ''; rename it"),
    "position of two numbers": (PLACE, "position_m = [0, 0]\n", "boards[2].position_m", "3 numbers (x, y, z), found 2"),
    "position in millimetres": (PLACE, "position_m = [0, 30, 0]\n", "boards[2].position_m", "found 30; give metres"),
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
    "unknown key of a place": (TURN, TURN + "rpy = [0, 0, 0]\n", "boards[2].rpy", "a known key, found an unknown one"),
    "a misspelt place": (
        "position_m = [0, 0.03",
        "positon_m = [0, 0.03",
        "boards[2].positon_m",
        "did you mean position_m?",
    ),
}

ODD: st.SearchStrategy[Any] = st.one_of(
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
    line = str(error)
    assert line.isprintable()
    assert line.startswith(f"{file}: {field}: expected ")
    assert ", found " in line
    assert "; " in line
    assert (error.file, error.field) == (file, field)


def refusal(text: str) -> HandDescriptionError:
    with pytest.raises(HandDescriptionError) as caught:
        parse_hand(text.encode(), "bench.toml")
    return caught.value


def places(value: Any) -> list[tuple[Any, Any]]:
    """Every table or list of a document with each of its keys or indices."""
    keys = list(value) if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    found = [(value, key) for key in keys]
    for key in keys:
        found += places(value[key])
    return found


def without_geometry() -> str:
    text = GOOD.replace(GEOMETRY, "").replace(ROBOT, "")
    return "".join(
        line
        for line in text.splitlines(keepends=True)
        if not line.startswith(("link", "position_m", "quaternion_wxyz"))
    )


def test_the_base_that_mistakes_are_made_in_is_good(tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_text(GOOD)
    hand = load_hand(path)
    assert (hand.robot, hand.layer_m) == ("bench_robot", 0.001)
    assert [board.link for board in hand.boards] == ["finger", "finger", "palm"]
    np.testing.assert_array_equal(hand.position[:3], hand.position[3:6])
    np.testing.assert_allclose(hand.position[6:], [[0, 0.002, 0.001], [0, -0.002, 0.001]])
    np.testing.assert_allclose(hand.normal[1], [0, 0.6, 0.8])
    place = hand.boards[0].pose
    assert place is not None
    np.testing.assert_allclose(place[:3, 3], [0.01, 0, 0.02])
    # A turn about x by twice the angle whose cosine is 0.6.
    np.testing.assert_allclose(place[:3, :3], [[1, 0, 0], [0, -0.28, -0.96], [0, 0.96, -0.28]], atol=1e-15)


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_refused_with_one_line(mistake: str) -> None:
    old, new, field, piece = MISTAKES[mistake]
    assert old in GOOD
    error = refusal(GOOD.replace(old, new, 1))
    assert_one_line(error, "bench.toml", field)
    assert piece in str(error)


@pytest.mark.parametrize("key", ["link", "position_m", "quaternion_wxyz"])
def test_a_place_without_a_robot_is_refused(key: str) -> None:
    value = {"link": '"palm"', "position_m": "[0, 0, 0]", "quaternion_wxyz": "[1, 0, 0, 0]"}[key]
    error = refusal(without_geometry() + f"{key} = {value}\n")
    assert_one_line(error, "bench.toml", f"boards[2].{key}")
    assert "no place without a robot" in str(error)


def test_a_hand_without_geometry_loads_and_says_so_when_asked_for_positions(tmp_path: Path) -> None:
    path = tmp_path / "bare.toml"
    path.write_text(without_geometry())
    hand = load_hand(path)
    assert hand.robot is None
    assert [board.link for board in hand.boards] == [None] * 3
    for name in ("position", "normal", "distal"):
        with pytest.raises(
            HandGeometryError, match="hand 'bench': its description gives no taxel positions; add robot"
        ):
            getattr(hand, name)


def test_a_layer_may_be_given_without_geometry(tmp_path: Path) -> None:
    path = tmp_path / "bare.toml"
    path.write_text(without_geometry())
    assert load_hand(path).layer_m == 0.001


def test_a_normal_written_rounded_is_normalised(tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_text(GOOD.replace("0, 0.6, 0.8]", "0, 0.707, 0.707]"))
    normal = load_hand(path).normal[1]
    np.testing.assert_allclose(normal, [0, 0.5**0.5, 0.5**0.5], rtol=1e-15)


@given(data=st.data())
def test_a_changed_value_anywhere_is_read_or_refused_with_one_line(data: st.DataObject) -> None:
    document = copy.deepcopy(tomllib.loads(GOOD))
    for _ in range(data.draw(st.integers(1, 3))):
        if not places(document):
            break
        holder, key = data.draw(st.sampled_from(places(document)))
        if data.draw(st.booleans()):
            del holder[key]
        else:
            holder[key] = data.draw(ODD)
    try:
        check_hand(document, "any.toml")
    except HandDescriptionError as error:
        line = str(error)
    else:
        line = "any.toml: "
    assert line.isprintable()
    assert line.startswith("any.toml: ")


@given(
    place=st.integers(GOOD.index("[[boards]]"), len(GOOD)),
    removed=st.integers(0, 12),
    put=st.text(st.sampled_from("\"'#.=[]{},\n 0123456789abex-_\\\ré"), max_size=6),
)
def test_an_edit_of_a_good_file_is_read_or_refused_with_one_line(place: int, removed: int, put: str) -> None:
    edited = GOOD[:place] + put + GOOD[place + removed :]
    try:
        parse_hand(edited.encode(), "any.toml")
    except HandDescriptionError as error:
        line = str(error)
    else:
        line = "any.toml: "
    assert line.isprintable()
    assert line.startswith("any.toml: ")
