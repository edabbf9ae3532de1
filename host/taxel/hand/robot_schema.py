"""Schema of a robot description file; the first error is reported in one line."""

from collections.abc import Mapping
from typing import Any

from taxel.hand.checks import (
    check_description,
    check_identifier,
    check_numbers,
    check_table,
    check_type,
    check_unit,
    suggest_name,
)
from taxel.hand.errors import Field, format_value
from taxel.hand.toml_text import parse_toml

FORMAT = "taxel-robot"
VERSION = 1
MAX_JOINTS = 256
MAX_REACH_M = 10.0
"""Largest length of a link, metres; a larger value indicates a wrong unit."""
MAX_ANGLE_RAD = 100.0
"""Largest joint angle, radians; a larger value indicates a wrong unit."""

_ROBOT: Mapping[str, type] = {
    "format": str,
    "version": int,
    "name": str,
    "description": str,
    "root": str,
    "joints": list,
}
_ROBOT_OPTIONAL: Mapping[str, type] = {"shapes": list}
_FIXED: Mapping[str, type] = {"name": str, "type": str, "parent": str, "child": str}
_REVOLUTE: Mapping[str, type] = {**_FIXED, "axis": list, "range_rad": list}
_ORIGIN: Mapping[str, type] = {"position_m": list, "quaternion_wxyz": list}
_SHAPES: Mapping[str, Mapping[str, type]] = {
    "box": {"link": str, "type": str, "half_size_m": list},
    "capsule": {"link": str, "type": str, "radius_m": float, "half_length_m": float},
}


def parse_robot(data: bytes, file: str) -> dict[str, Any]:
    """Parse and check the bytes of a robot description.

    Args:
        data: content of the file, UTF-8 TOML.
        file: file name, for errors.

    Raises:
        HandDescriptionError: the first error.
    """
    document = parse_toml(data, file)
    top = Field(file)
    for key, expected in (("format", FORMAT), ("version", VERSION)):
        if document.get(key) != expected or isinstance(document[key], bool):
            top.key(key).fail(
                format_value(expected), format_value(document.get(key)), "use a robot description of this version"
            )
    check_table(document, _ROBOT, top, _ROBOT_OPTIONAL)
    check_identifier(document["name"], top.key("name"))
    check_identifier(document["root"], top.key("root"))
    check_description(document["description"], top.key("description"))
    if not 0 < len(document["joints"]) <= MAX_JOINTS:
        top.key("joints").fail(f"1 to {MAX_JOINTS} joints", str(len(document["joints"])), "describe the robot's joints")
    _check_joints(document, top.key("joints"))
    for index, shape in enumerate(document.get("shapes", [])):
        _check_shape(shape, document, top.key("shapes").item(index))
    return document


def _check_joints(document: Mapping[str, Any], field: Field) -> None:
    """Check the joints of a robot description: unique names, one parent for each link, and a tree below the root.

    Raises HandDescriptionError for the first error; field: position of the list in the file.
    """
    parents: dict[str, str] = {}
    names: set[str] = set()
    for index, joint in enumerate(document["joints"]):
        item_field = field.item(index)
        _check_joint(joint, item_field)
        if joint["name"] in names:
            item_field.key("name").fail("a unique joint name", format_value(joint["name"]), "rename one of them")
        if joint["child"] in parents or joint["child"] == document["root"]:
            item_field.key("child").fail(
                "a link moved by a single joint", format_value(joint["child"]), "remove one of the joints"
            )
        names.add(joint["name"])
        parents[joint["child"]] = joint["parent"]
    links = [document["root"], *parents]
    for index, joint in enumerate(document["joints"]):
        if joint["parent"] not in links:
            item_field = field.item(index).key("parent")
            item_field.fail("a link of this robot", format_value(joint["parent"]), suggest_name(joint["parent"], links))
    for index, joint in enumerate(document["joints"]):
        _check_leads_to_root(joint["parent"], parents, document["root"], field.item(index).key("parent"))


def _check_joint(joint: Any, item_field: Field) -> None:
    """Check the keys, types and numbers of one joint; raise HandDescriptionError for the first error."""
    check_type(joint, dict, item_field)
    kind = joint.get("type")
    if kind not in ("fixed", "revolute"):
        item_field.key("type").fail("'fixed' or 'revolute'", format_value(kind), "correct it")
    check_table(joint, _REVOLUTE if kind == "revolute" else _FIXED, item_field, _ORIGIN)
    for key in ("name", "parent", "child"):
        check_identifier(joint[key], item_field.key(key))
    _check_origin(joint, item_field)
    if kind == "revolute":
        check_numbers(joint["axis"], 3, item_field.key("axis"), "x, y, z")
        check_unit(joint["axis"], item_field.key("axis"), "an axis")
        check_numbers(joint["range_rad"], 2, item_field.key("range_rad"), "lower, upper")
        lower, upper = joint["range_rad"]
        if not -MAX_ANGLE_RAD < lower < upper < MAX_ANGLE_RAD:
            item_field.key("range_rad").fail(
                f"lower below upper, both between -{MAX_ANGLE_RAD:g} and {MAX_ANGLE_RAD:g} rad",
                f"{lower:g} and {upper:g}",
                "write both angles in radians, the smaller angle first",
            )


def _check_leads_to_root(link: str, parents: Mapping[str, str], root: str, field: Field) -> None:
    """Raise HandDescriptionError if the chain of parents of a link does not end at the root link.

    parents: parent link by child link. field: position in the file, for the error.
    """
    start = link
    for _ in range(len(parents) + 1):
        if link == root:
            return
        link = parents[link]
    field.fail(
        f"a link that leads to the root {root!r}",
        format_value(start),
        "the joints form a closed loop; remove one of them",
    )


def _check_origin(table: Mapping[str, Any], field: Field) -> None:
    """Check the optional position and quaternion of a joint or shape; raise HandDescriptionError."""
    if "position_m" in table:
        item_field = field.key("position_m")
        check_numbers(table["position_m"], 3, item_field, "x, y, z")
        if any(abs(value) > MAX_REACH_M for value in table["position_m"]):
            item_field.fail(
                f"metres, at most {MAX_REACH_M:g}", format_value(max(table["position_m"], key=abs)), "convert to metres"
            )
    if "quaternion_wxyz" in table:
        check_numbers(table["quaternion_wxyz"], 4, field.key("quaternion_wxyz"), "w, x, y, z")
        check_unit(table["quaternion_wxyz"], field.key("quaternion_wxyz"), "a quaternion")


def _check_shape(shape: Any, document: Mapping[str, Any], item_field: Field) -> None:
    """Check the keys, types and sizes of one collision shape; raise HandDescriptionError for the first error.

    shape: table of the file, with sizes in metres. document: the whole description, which contains the links.
    item_field: position of the shape in the file, for the error.
    """
    check_type(shape, dict, item_field)
    kind = shape.get("type")
    if not isinstance(kind, str) or kind not in _SHAPES:
        item_field.key("type").fail("'box' or 'capsule'", format_value(kind), "correct it")
    check_table(shape, _SHAPES[kind], item_field, _ORIGIN)
    _check_origin(shape, item_field)
    links = [document["root"], *(joint["child"] for joint in document["joints"])]
    if shape["link"] not in links:
        item_field.key("link").fail(
            "a link of this robot", format_value(shape["link"]), suggest_name(shape["link"], links)
        )
    if kind == "box":
        check_numbers(shape["half_size_m"], 3, item_field.key("half_size_m"), "x, y, z")
    sizes = shape["half_size_m"] if kind == "box" else [shape["radius_m"], shape["half_length_m"]]
    for size in sizes:
        if not 0 < size < MAX_REACH_M:  # also false for nan and inf
            item_field.fail(
                f"sizes above 0 m and below {MAX_REACH_M:g} m",
                format_value(size),
                "write the size in metres, as a positive number",
            )
