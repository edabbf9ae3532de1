"""The part of a hand description that says where the taxels are; it is there as a whole or not at all."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from taxel.hand.checks import check_identifier, check_numbers, check_table, check_type, check_unit, suggest_name
from taxel.hand.errors import Field, format_value

MAX_REACH_M = 10.0  # no taxel is ten metres from its link: a larger figure is a mistake of unit

_GEOMETRY: Mapping[str, type] = {"taxels": list}
_PLACE = ("link", "position_m", "quaternion_wxyz")


def check_geometry(document: Mapping[str, Any], top: Field) -> None:
    """Check `robot`, `[geometry.<kind>]` and each board's place, after everything else has been checked.

    Args:
        document: the whole description.
        top: its file, for errors.

    Raises:
        HandDescriptionError: the first mistake found.
    """
    if "robot" not in document:
        _check_absent(document, top)
        return
    check_identifier(document["robot"], top.key("robot"))
    if "geometry" not in document:
        top.key("geometry").fail("a table for each kind", "nothing", "add [geometry.<kind>], or remove robot")
    if "layer_m" not in document["taxel"]:
        top.key("taxel").key("layer_m").fail("a number", "nothing", "add the layer's thickness over the electrode")
    geometry, kinds = document["geometry"], document["kinds"]
    for name in geometry:
        if name not in kinds:
            top.key("geometry").key(name).fail(
                "the name of a [kinds] table", format_value(name), suggest_name(name, kinds)
            )
    for name, kind in kinds.items():
        here = top.key("geometry").key(name)
        if name not in geometry:
            here.fail("a table", "nothing", f"add [geometry.{name}]")
        check_table(geometry[name], _GEOMETRY, here)
        _check_taxels(geometry[name]["taxels"], kind["taxels"], here.key("taxels"))
    for index, board in enumerate(document["boards"]):
        _check_place(board, top.key("boards").item(index))


def _check_absent(document: Mapping[str, Any], top: Field) -> None:
    if "geometry" in document:
        top.key("robot").fail("the name of a robot", "nothing", "add robot, or remove [geometry]")
    for index, board in enumerate(document["boards"]):
        for key in _PLACE:
            if key in board:
                here = top.key("boards").item(index).key(key)
                here.fail(
                    "no place without a robot", format_value(board[key]), "add robot and [geometry], or remove it"
                )


def _check_taxels(rows: list[Any], count: int, field: Field) -> None:
    if len(rows) != count:
        field.fail(f"{count} rows, one a taxel in the map's order", f"{len(rows)}", "give each taxel one row")
    for index, row in enumerate(rows):
        here = field.item(index)
        check_numbers(row, 6, here, "x, y, z, nx, ny, nz")
        _check_reach(row[:3], here)
        check_unit(row[3:], here, "a normal")


def _check_reach(position: list[float], field: Field) -> None:
    if any(abs(value) > MAX_REACH_M for value in position):
        field.fail(
            f"metres, at most {MAX_REACH_M:g} from the origin", format_value(max(position, key=abs)), "give metres"
        )


def _check_place(board: Mapping[str, Any], field: Field) -> None:
    for key in _PLACE:
        if key not in board:
            field.key(key).fail("the bracket's place on its link", "nothing", f"add {key}")
    check_identifier(board["link"], field.key("link"))
    check_numbers(board["position_m"], 3, field.key("position_m"), "x, y, z")
    _check_reach(board["position_m"], field.key("position_m"))
    check_type(board["quaternion_wxyz"], list, field.key("quaternion_wxyz"))
    check_numbers(board["quaternion_wxyz"], 4, field.key("quaternion_wxyz"), "w, x, y, z")
    check_unit(board["quaternion_wxyz"], field.key("quaternion_wxyz"), "a quaternion")
