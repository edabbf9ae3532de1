"""Every error in a robot description is reported in one line that names the file and the field."""

import copy
import os
import tomllib
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taxel.hand import HandDescriptionError, robot_schema
from taxel.hand.errors import UnknownLinkError
from taxel.hand.robot import list_packaged_robots, load_robot
from taxel.hand.robot_schema import parse_robot

VALID = """\
format = "taxel-robot"
version = 1
name = "bench"
description = "A mast with an arm that turns and a hand on it"
root = "world"

[[joints]]
name = "grip"
type = "revolute"
parent = "arm"
child = "hand"
position_m = [0.3, 0, 0]
quaternion_wxyz = [0.6, 0.8, 0, 0]
axis = [0, 1, 0]
range_rad = [-0.5, 1.5]

[[joints]]
name = "mast"
type = "fixed"
parent = "world"
child = "mast"
position_m = [0, 0, 1.0]

[[joints]]
name = "turn"
type = "revolute"
parent = "mast"
child = "arm"
axis = [0, 0, 1]
range_rad = [-3.1, 3.1]

[[shapes]]
link = "arm"
type = "box"
half_size_m = [0.15, 0.02, 0.03]
position_m = [0.15, 0, 0]

[[shapes]]
link = "hand"
type = "capsule"
radius_m = 0.02
half_length_m = 0.05
"""

JOINTS = VALID[VALID.index("[[joints]]") : VALID.index("[[shapes]]")]
MANY = "".join(f'[[joints]]\nname = "j{i}"\ntype = "fixed"\nparent = "world"\nchild = "l{i}"\n' for i in range(257))

# Text in VALID, its replacement, the field in the error, and a part of the error message.
INVALID_EDITS: dict[str, tuple[str, str, str, str]] = {
    "not TOML": ("version = 1", "version = = 1", "line 2, column 11", "expected valid TOML"),
    "another format": ('"taxel-robot"', '"taxel-hand"', "format", "expected 'taxel-robot', found 'taxel-hand'"),
    "no format": ('format = "taxel-robot"\n', "", "format", "expected 'taxel-robot'"),
    "another version": ("version = 1", "version = 2", "version", "expected 1, found 2"),
    "true for a version": ("version = 1", "version = true", "version", "expected 1, found true"),
    "no version": ("version = 1\n", "", "version", "expected 1"),
    "no name": ('name = "bench"\n', "", "name", "expected a string, found nothing; add name"),
    "no description": ('description = "A mast', '# = "A mast', "description", "add description"),
    "no root": ('root = "world"\n', "", "root", "add root"),
    "root not a string": ('root = "world"', "root = 1", "root", "expected a string, found 1"),
    "root no identifier": ('root = "world"', 'root = "the world"', "root", "found 'the world'; rename it"),
    "name no identifier": ('"bench"', '"../bench"', "name", "found '../bench'; rename it"),
    "unknown key at the top": ("root =", "links = 3\nroot =", "links", "an unknown key"),
    "no joints": (JOINTS, "", "joints", "expected a list, found nothing"),
    "an empty list of joints": (
        VALID[VALID.index("[[joints]]") :],
        "joints = []",
        "joints",
        "1 to 256 joints, found 0",
    ),
    "too many joints": (JOINTS, MANY, "joints", "1 to 256 joints, found 257"),
    "one [joints] table": (
        VALID[VALID.index("[[joints]]") :],
        "[joints]\n",
        "joints",
        "expected a list, found a table",
    ),
    "a joint that is no table": (VALID[VALID.index("[[joints]]") :], "joints = [3]", "joints[0]", "expected a table"),
    "unknown type": ('"fixed"', '"floating"', "joints[1].type", "'fixed' or 'revolute', found 'floating'"),
    "no type": ('type = "fixed"\n', "", "joints[1].type", "'fixed' or 'revolute', found None"),
    "type a list": ('"fixed"', '["fixed"]', "joints[1].type", "found a list"),
    "no joint name": ('name = "mast"\n', "", "joints[1].name", "add name"),
    "no parent": ('parent = "mast"\n', "", "joints[2].parent", "add parent"),
    "no child": ('child = "hand"\n', "", "joints[0].child", "add child"),
    "duplicate joint name": ('name = "mast"', 'name = "grip"', "joints[1].name", "a unique joint name, found 'grip'"),
    "joint name no identifier": ('name = "mast"', 'name = "2nd"', "joints[1].name", "found '2nd'; rename it"),
    "child no identifier": ('child = "hand"', 'child = ""', "joints[0].child", "found ''; rename it"),
    "unknown key of a joint": ("range_rad = [-0.5", "range = [-0.5", "joints[0].range", "did you mean range_rad?"),
    "an axis on a fixed joint": ("[0, 0, 1.0]", "[0, 0, 1.0]\naxis = [0, 0, 1]", "joints[1].axis", "an unknown key"),
    "missing axis": ("axis = [0, 1, 0]\n", "", "joints[0].axis", "expected a list, found nothing; add axis"),
    "axis zero": ("axis = [0, 1, 0]", "axis = [0, 0, 0]", "joints[0].axis", "an axis of length 1, found length 0"),
    "axis of length 2": ("axis = [0, 1, 0]", "axis = [0, 2, 0]", "joints[0].axis", "found length 2; normalise it"),
    "axis of two numbers": ("axis = [0, 1, 0]", "axis = [0, 1]", "joints[0].axis", "3 numbers (x, y, z), found 2"),
    "axis a letter": ("axis = [0, 1, 0]", 'axis = "y"', "joints[0].axis", "expected a list, found 'y'"),
    "axis not a number": ("axis = [0, 1, 0]", "axis = [0, nan, 0]", "joints[0].axis[1]", "finite number, found nan"),
    "axis of strings": ("axis = [0, 1, 0]", 'axis = [0, "1", 0]', "joints[0].axis[1]", "a number, found '1'"),
    "no range": ("range_rad = [-0.5, 1.5]\n", "", "joints[0].range_rad", "add range_rad"),
    "range reversed": ("[-0.5, 1.5]", "[1.5, -0.5]", "joints[0].range_rad", "the smaller angle first"),
    "range empty": ("[-0.5, 1.5]", "[0.5, 0.5]", "joints[0].range_rad", "lower below upper"),
    "range in degrees": (
        "[-3.1, 3.1]",
        "[-180, 180]",
        "joints[2].range_rad",
        "both between -100 and 100 rad, found -180 and 180; write both angles in radians",
    ),
    "range infinite": ("[-3.1, 3.1]", "[-inf, 3.1]", "joints[2].range_rad[0]", "finite number, found -inf"),
    "range of one number": ("[-3.1, 3.1]", "[3.1]", "joints[2].range_rad", "2 numbers (lower, upper), found 1"),
    "a true in a range": ("[-3.1, 3.1]", "[false, 3.1]", "joints[2].range_rad[0]", "a number, found false"),
    "a number too long to square": (
        "axis = [0, 1, 0]",
        f"axis = [0, {'1' * 180}, 0]",
        "joints[0].axis[1]",
        "an integer of 64 bits",
    ),
    "control code in the description": ("A mast", r"\u001b[2J", "description", "one printable line"),
    "position in millimetres": ("[0.3, 0, 0]", "[300, 0, 0]", "joints[0].position_m", "found 300; convert to metres"),
    "position of two numbers": ("[0.3, 0, 0]", "[0.3, 0]", "joints[0].position_m", "3 numbers (x, y, z), found 2"),
    "position not a number": ("[0.3, 0, 0]", "[nan, 0, 0]", "joints[0].position_m[0]", "found nan"),
    "quaternion not unit": ("[0.6, 0.8, 0, 0]", "[1, 1, 0, 0]", "joints[0].quaternion_wxyz", "found length 1.414"),
    "quaternion zero": ("[0.6, 0.8, 0, 0]", "[0, 0, 0, 0]", "joints[0].quaternion_wxyz", "found length 0"),
    "quaternion of three": ("[0.6, 0.8, 0, 0]", "[0, 0, 0]", "joints[0].quaternion_wxyz", "4 numbers (w, x, y, z)"),
    "unknown parent": ('parent = "mast"', 'parent = "mest"', "joints[2].parent", "'mest'; did you mean mast?"),
    "two parents": ('child = "mast"', 'child = "arm"', "joints[2].child", "a link moved by a single joint"),
    "child equals root": (
        'child = "mast"',
        'child = "world"',
        "joints[1].child",
        "a single joint, found 'world'",
    ),
    "a link that carries itself": (
        'parent = "mast"',
        'parent = "arm"',
        "joints[0].parent",
        "the joints form a closed loop",
    ),
    "a closed loop": (
        'parent = "mast"',
        'parent = "hand"',
        "joints[0].parent",
        "leads to the root 'world', found 'arm'",
    ),
    "unknown root": ('root = "world"', 'root = "floor"', "joints[1].parent", "a link of this robot, found 'world'"),
    "shapes a table": (VALID[VALID.index("[[shapes]]") :], "[shapes]\n", "shapes", "expected a list, found a table"),
    "shape on unknown link": ('link = "arm"', 'link = "arn"', "shapes[0].link", "'arn'; did you mean arm?"),
    "shape without a link": ('link = "arm"\n', "", "shapes[0].link", "add link"),
    "unknown shape": ('"capsule"', '"sphere"', "shapes[1].type", "'box' or 'capsule', found 'sphere'"),
    "shape without a type": ('type = "capsule"\n', "", "shapes[1].type", "'box' or 'capsule', found None"),
    "a radius for a box": ('"capsule"', '"box"', "shapes[1].radius_m", "an unknown key"),
    "negative size": (
        "half_size_m = [0.15,",
        "half_size_m = [-0.15,",
        "shapes[0]",
        "sizes above 0 m and below 10 m, found -0.15; write the size in metres, as a positive number",
    ),
    "size in millimetres": (
        "radius_m = 0.02",
        "radius_m = 20",
        "shapes[1]",
        "below 10 m, found 20; write the size in metres",
    ),
    "radius of infinity": ("radius_m = 0.02", "radius_m = inf", "shapes[1]", "found inf"),
    "radius zero": ("radius_m = 0.02", "radius_m = 0", "shapes[1]", "sizes above 0 m"),
    "radius not a number": ("radius_m = 0.02", "radius_m = nan", "shapes[1]", "sizes above 0 m"),
    "radius a string": ("radius_m = 0.02", 'radius_m = "20 mm"', "shapes[1].radius_m", "a number, found '20 mm'"),
    "box of two sizes": ("[0.15, 0.02, 0.03]", "[0.15, 0.02]", "shapes[0].half_size_m", "3 numbers (x, y, z), found 2"),
    "box infinite": ("[0.15, 0.02, 0.03]", "[0.15, inf, 0.03]", "shapes[0].half_size_m[1]", "found inf"),
    "shape in millimetres": ("[0.15, 0, 0]", "[150, 0, 0]", "shapes[0].position_m", "convert to metres"),
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
    st.sampled_from(["world", "mast", "arm", "hand", "grip", "fixed", "revolute", "box", "capsule"]),
)


def load_error(path: Path | str) -> HandDescriptionError:
    """Return the error that loading a robot description raises."""
    with pytest.raises(HandDescriptionError) as caught:
        load_robot(path)
    return caught.value


def read_error_message(data: bytes) -> str | None:
    """Return the message of the error that parsing a robot description raises; None if there is no error."""
    try:
        parse_robot(data, "any.toml")
    except HandDescriptionError as error:
        return str(error)
    return None


def assert_one_line(error: HandDescriptionError, file: str, field: str) -> None:
    """Check that an error is one line with file, field, expected and found content, and remedy."""
    line = str(error)
    assert line.isprintable()
    assert line.startswith(f"{file}: {field}: expected ")
    assert ", found " in line
    assert "; " in line
    assert (error.file, error.field) == (file, field)


def list_entries(value: Any) -> list[tuple[Any, Any]]:
    """List every table or list of a document with each of its keys or indices."""
    keys = list(value) if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    entries = [(value, key) for key in keys]
    for key in keys:
        entries += list_entries(value[key])
    return entries


def test_the_unmodified_description_is_valid(tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_text(VALID)
    robot = load_robot(path)
    assert robot.link_names == ("world", "mast", "arm", "hand")  # parents first, independent of the order in the file
    assert robot.joint_names == ("turn", "grip")
    assert robot.lower.tolist() == [-3.1, -0.5]
    assert robot.upper.tolist() == [3.1, 1.5]
    assert [(shape.link_name, shape.type, shape.size) for shape in robot.shapes] == [
        ("arm", "box", (0.15, 0.02, 0.03)),
        ("hand", "capsule", (0.02, 0.05)),
    ]
    origins = {joint.child: joint.origin for joint in robot.joints}
    np.testing.assert_allclose(origins["hand"][:3, 3], [0.3, 0.0, 0.0])
    np.testing.assert_array_equal(origins["arm"], np.eye(4))


@pytest.mark.parametrize("edit", INVALID_EDITS)
def test_an_invalid_description_raises_a_one_line_error(edit: str, tmp_path: Path) -> None:
    old, new, field, message = INVALID_EDITS[edit]
    assert old in VALID
    path = tmp_path / "bench.toml"
    path.write_text(VALID.replace(old, new, 1))
    error = load_error(path)
    assert_one_line(error, str(path), field)
    assert message in str(error)


def test_a_rounded_axis_is_normalised(tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_text(VALID.replace("axis = [0, 1, 0]", "axis = [0.577, 0.577, 0.577]"))
    axis = {joint.child: joint.axis for joint in load_robot(path).joints}["hand"]
    assert axis is not None
    np.testing.assert_allclose(axis, np.full(3, 3**-0.5), rtol=1e-15)


def test_the_packaged_robots_are_the_plate_and_two_workstations() -> None:
    assert list_packaged_robots() == ["plate", "ur5e_allegro", "ur5e_original"]
    assert len(load_robot("ur5e_allegro").joint_names) == 22
    assert load_robot("plate").joint_names == ("hinge",)


def test_the_error_of_a_missing_file_lists_the_packaged_names() -> None:
    error = load_error("ur5")
    assert_one_line(error, "ur5", "file")
    assert "the packaged robots are plate, ur5e_allegro" in str(error)


@pytest.mark.parametrize("name", ["", "two\nlines", "nul\0byte", "a" * 5000])
def test_an_impossible_file_name_raises_a_one_line_error(name: str) -> None:
    error = load_error(name)
    assert str(error).isprintable()
    assert error.field == "file"


def test_a_directory_is_rejected(tmp_path: Path) -> None:
    assert_one_line(load_error(tmp_path), str(tmp_path), "file")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_pipe_is_rejected_without_waiting(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.toml"
    os.mkfifo(pipe)
    assert_one_line(load_error(pipe), str(pipe), "file")


def test_the_error_of_an_unknown_link_lists_the_links() -> None:
    robot = load_robot("plate")
    for function in (robot.get_link_index, robot.get_subtree):
        with pytest.raises(UnknownLinkError, match=r"robot 'plate' has no link 'hand'; expected one of .*plate$"):
            function("hand")


def test_a_chain_of_256_joints_is_read() -> None:
    text = VALID[: VALID.index("[[joints]]")]
    links = ["world", *(f"l{i}" for i in range(256))]
    for index, (parent, child) in enumerate(pairwise(links)):
        text += f'[[joints]]\nname = "j{index}"\ntype = "fixed"\nparent = "{parent}"\nchild = "{child}"\n'
    assert len(parse_robot(text.encode(), "chain.toml")["joints"]) == 256


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
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(robot_schema, "parse_toml", lambda data, file: document)
        line = read_error_message(b"")
    assert line is None or (line.isprintable() and line.startswith("any.toml: "))


@given(
    position=st.integers(0, len(VALID)),
    removed=st.integers(0, 12),
    inserted=st.text(st.sampled_from("\"'#.=[]{}\n 0123456789abx-_\\\r\u2028é"), max_size=6),
)
def test_a_random_edit_is_accepted_or_raises_a_one_line_error(position: int, removed: int, inserted: str) -> None:
    edited = VALID[:position] + inserted + VALID[position + removed :]
    line = read_error_message(edited.encode())
    assert line is None or (line.isprintable() and line.startswith("any.toml: "))
