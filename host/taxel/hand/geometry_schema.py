"""Schema of the geometry part of a hand description, which is either complete or absent."""

from collections.abc import Mapping
from typing import Any

from taxel.hand.checks import check_identifier, check_numbers, check_table, check_type, check_unit, suggest_name
from taxel.hand.crossings import check_layout
from taxel.hand.errors import Field, format_value
from taxel.hand.geometry import SQUARE_NUMBERS

MAX_REACH_M = 10.0
"""Largest coordinate of a taxel or bracket, metres; a larger value indicates a wrong unit."""

PERPENDICULAR_TOLERANCE = 1e-3
"""Largest cosine between a normal and a distal direction, which are rounded in the file."""
MAX_SIDE_M = 0.1
"""Largest side of a square of the sheet, metres; a larger value indicates a wrong unit."""

_GEOMETRY: Mapping[str, type] = {"taxels": list}
_GEOMETRY_OPTIONAL: Mapping[str, type] = {"margin": list, "layout": str}
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
        check_table(geometry[name], _GEOMETRY, item_field, _GEOMETRY_OPTIONAL)
        _check_taxels(geometry[name]["taxels"], kind["taxels"], item_field.key("taxels"))
        for index, row in enumerate(geometry[name].get("margin", [])):
            _check_square(row, item_field.key("margin").item(index))
        if "layout" in geometry[name]:
            check_layout(geometry[name]["layout"], kind["taxels"], item_field.key("layout"))
    for index, board in enumerate(document["boards"]):
        _check_pose(board, top.key("boards").item(index))


def _check_absent(document: Mapping[str, Any], top: Field) -> None:
    """Raise HandDescriptionError if a description without a robot contains geometry or the pose of a board."""
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
    """Check the table of taxels of one kind of board: `count` rows of 6 numbers, or of 11 (see `_check_square`).

    Raises HandDescriptionError for the first error; field: position of the table in the file.
    """
    if len(rows) != count:
        field.fail(f"{count} rows, one per taxel in the order of the map", f"{len(rows)}", "write one row per taxel")
    has_squares = bool(rows) and isinstance(rows[0], list) and len(rows[0]) == SQUARE_NUMBERS
    for index, row in enumerate(rows):
        item_field = field.item(index)
        if has_squares:
            _check_square(row, item_field)
            continue
        check_numbers(row, 6, item_field, "x, y, z, nx, ny, nz")
        _check_reach(row[:3], item_field)
        check_unit(row[3:], item_field, "a normal")


def _check_square(row: Any, field: Field) -> None:
    """Check the 11 numbers of a square: position, normal, distal direction and two sides.

    Raises HandDescriptionError for the first error.
    """
    check_numbers(row, SQUARE_NUMBERS, field, "x, y, z, nx, ny, nz, dx, dy, dz, two sides")
    _check_reach(row[:3], field)
    check_unit(row[3:6], field, "a normal")
    check_unit(row[6:9], field, "a distal direction")
    if abs(sum(n * d for n, d in zip(row[3:6], row[6:9], strict=True))) > PERPENDICULAR_TOLERANCE:
        field.fail("a distal direction perpendicular to the normal", format_value(row[6:9]), "correct the direction")
    if not all(0 < side <= MAX_SIDE_M for side in row[9:]):
        field.fail(f"sides above 0 and at most {MAX_SIDE_M:g} m", format_value(row[9:]), "write the sides in metres")


def _check_reach(position: list[float], field: Field) -> None:
    """Raise HandDescriptionError if a coordinate is beyond `MAX_REACH_M` metres, for example given in millimetres."""
    if any(abs(value) > MAX_REACH_M for value in position):
        field.fail(
            f"metres, at most {MAX_REACH_M:g} from the origin",
            format_value(max(position, key=abs)),
            "convert to metres",
        )


def _check_pose(board: Mapping[str, Any], field: Field) -> None:
    """Check link, position and quaternion of a board in a hand description; raise HandDescriptionError.

    field: position of the board in the file.
    """
    for key in _POSE_KEYS:
        if key not in board:
            field.key(key).fail("the pose of the bracket on its link", "nothing", f"add {key}")
    check_identifier(board["link"], field.key("link"))
    check_numbers(board["position_m"], 3, field.key("position_m"), "x, y, z")
    _check_reach(board["position_m"], field.key("position_m"))
    check_type(board["quaternion_wxyz"], list, field.key("quaternion_wxyz"))
    check_numbers(board["quaternion_wxyz"], 4, field.key("quaternion_wxyz"), "w, x, y, z")
    check_unit(board["quaternion_wxyz"], field.key("quaternion_wxyz"), "a quaternion")
