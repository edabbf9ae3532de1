"""Schema of the geometry part of a hand description, which is either complete or absent."""

from collections.abc import Mapping
from typing import Any

from taxel.hand.checks import check_identifier, check_numbers, check_table, check_type, check_unit, suggest_name
from taxel.hand.errors import Field, format_value

MAX_REACH_M = 10.0
"""Largest coordinate of a taxel or bracket, metres; a larger value indicates a wrong unit."""

_GEOMETRY: Mapping[str, type] = {"taxels": list}
_POSE_KEYS = ("link", "position_m", "quaternion_wxyz")


def check_geometry(document: Mapping[str, Any], top: Field) -> None:
    """Check `robot`, `[geometry.<kind>]` and the pose of each board, after all other checks.

    Args:
        document: the whole description.
        top: field of the whole file, for errors.

    Raises:
        HandDescriptionError: the first error.
    """
    if "robot" not in document:
        _check_absent(document, top)
        return
    check_identifier(document["robot"], top.key("robot"))
    if "geometry" not in document:
        top.key("geometry").fail("a table per kind", "nothing", "add [geometry.<kind>], or remove robot")
    if "layer_m" not in document["taxel"]:
        top.key("taxel").key("layer_m").fail(
            "a number", "nothing", "add the thickness of the dielectric over the electrodes"
        )
    geometry, kinds = document["geometry"], document["kinds"]
    for name in geometry:
        if name not in kinds:
            top.key("geometry").key(name).fail(
                "the name of a [kinds] table", format_value(name), suggest_name(name, kinds)
            )
    for name, kind in kinds.items():
        item_field = top.key("geometry").key(name)
        if name not in geometry:
            item_field.fail("a table", "nothing", f"add [geometry.{name}]")
        check_table(geometry[name], _GEOMETRY, item_field)
        _check_taxels(geometry[name]["taxels"], kind["taxels"], item_field.key("taxels"))
    for index, board in enumerate(document["boards"]):
        _check_pose(board, top.key("boards").item(index))


def _check_absent(document: Mapping[str, Any], top: Field) -> None:
    """Raise an error for geometry or poses in a description without a robot."""
    if "geometry" in document:
        top.key("robot").fail("the name of a robot", "nothing", "add robot, or remove [geometry]")
    for index, board in enumerate(document["boards"]):
        for key in _POSE_KEYS:
            if key in board:
                item_field = top.key("boards").item(index).key(key)
                item_field.fail(
                    "no pose without a robot", format_value(board[key]), "add robot and [geometry], or remove it"
                )


def _check_taxels(rows: list[Any], count: int, field: Field) -> None:
    """Check the rows of taxel positions and normals of one kind of board."""
    if len(rows) != count:
        field.fail(f"{count} rows, one per taxel in the order of the map", f"{len(rows)}", "write one row per taxel")
    for index, row in enumerate(rows):
        item_field = field.item(index)
        check_numbers(row, 6, item_field, "x, y, z, nx, ny, nz")
        _check_reach(row[:3], item_field)
        check_unit(row[3:], item_field, "a normal")


def _check_reach(position: list[float], field: Field) -> None:
    """Raise an error if a coordinate of a position is above `MAX_REACH_M` metres, for example in millimetres."""
    if any(abs(value) > MAX_REACH_M for value in position):
        field.fail(
            f"metres, at most {MAX_REACH_M:g} from the origin",
            format_value(max(position, key=abs)),
            "convert to metres",
        )


def _check_pose(board: Mapping[str, Any], field: Field) -> None:
    """Check link, position and quaternion of a board in a hand description; field: the board in the file."""
    for key in _POSE_KEYS:
        if key not in board:
            field.key(key).fail("the pose of the bracket on its link", "nothing", f"add {key}")
    check_identifier(board["link"], field.key("link"))
    check_numbers(board["position_m"], 3, field.key("position_m"), "x, y, z")
    _check_reach(board["position_m"], field.key("position_m"))
    check_type(board["quaternion_wxyz"], list, field.key("quaternion_wxyz"))
    check_numbers(board["quaternion_wxyz"], 4, field.key("quaternion_wxyz"), "w, x, y, z")
    check_unit(board["quaternion_wxyz"], field.key("quaternion_wxyz"), "a quaternion")
