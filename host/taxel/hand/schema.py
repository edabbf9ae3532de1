"""Schema of a hand description file; the first error is reported in one line.

Keys are declared in tables (``_HAND``, ``_TAXEL``, ``_KIND``, ``_BOARD``); a new key needs a row there, and a check
below if its type is not sufficient. Invalid values are never corrected, and unknown keys are never ignored.
"""

from collections.abc import Mapping
from typing import Any, NotRequired, TypedDict, cast

from taxel.hand.checks import check_description, check_identifier, check_range, check_table, suggest_name
from taxel.hand.crossings import check_crossings
from taxel.hand.errors import Field, HandDescriptionError, format_address, format_value
from taxel.hand.geometry_schema import check_geometry
from taxel.hand.toml_text import parse_toml
from taxel.hand.wiring_schema import WiringTable, check_wiring
from taxel_protocol.limits import ADDRESS_MAX, ADDRESS_MIN, TAXELS_MAX

__all__ = ["FORMAT", "VERSION", "HandDescriptionError", "HandDocument", "check_hand", "parse_hand"]

FORMAT = "taxel-hand"
VERSION = 1

MAX_CODE = 255
"""Largest kind code, which is one byte; 0 means a blank board."""
DESCRIBED_LINES_MAX = 32
"""Largest number of TX or RX lines in a description. The project's own firmware supports fewer (`LINES_MAX`); boards
with more lines are read with the original protocol.
"""
MAX_LENGTH_M = 1.0
"""Upper limit of taxel lengths, metres; a larger value indicates a wrong unit."""

_HAND: Mapping[str, type] = {
    "format": str,
    "version": int,
    "name": str,
    "description": str,
    "taxel": dict,
    "kinds": dict,
    "boards": list,
}
_HAND_OPTIONAL: Mapping[str, type] = {"robot": str, "geometry": dict, "wiring": dict}
_TAXEL: Mapping[str, type] = {"pitch_m": float, "size_m": float}
_TAXEL_OPTIONAL: Mapping[str, type] = {"layer_m": float}
_KIND: Mapping[str, type] = {"code": int, "tx": int, "rx": int, "taxels": int, "crossings": str}
_BOARD: Mapping[str, type] = {"name": str, "kind": str, "address": int}
_BOARD_OPTIONAL: Mapping[str, type] = {"branch": str, "link": str, "position_m": list, "quaternion_wxyz": list}


class TaxelFields(TypedDict):
    """``[taxel]``: dimensions of every taxel of the hand, metres."""

    pitch_m: float
    size_m: float
    layer_m: NotRequired[float]


class KindTable(TypedDict):
    """``[kinds.<name>]``: a design of a board."""

    code: int
    tx: int
    rx: int
    taxels: int
    crossings: str


class BoardTable(TypedDict):
    """``[[boards]]``: a board on the bus."""

    name: str
    kind: str
    address: int
    branch: NotRequired[str]
    link: NotRequired[str]
    position_m: NotRequired[list[float]]
    quaternion_wxyz: NotRequired[list[float]]


class GeometryTable(TypedDict):
    """``[geometry.<kind>]``, bracket frame, metres.

    taxels: a row per taxel: x, y, z, nx, ny, nz, and optionally the distal direction and the two sides of its square.
    margin: rows of the same 11 numbers, rectangles of sheet without an electrode. layout: row and column of each taxel
    on the unrolled sheet.
    """

    taxels: list[list[float]]
    margin: NotRequired[list[list[float]]]
    layout: NotRequired[str]


class HandDocument(TypedDict):
    """Checked hand description with the structure of the file."""

    format: str
    version: int
    name: str
    description: str
    taxel: TaxelFields
    kinds: dict[str, KindTable]
    boards: list[BoardTable]
    robot: NotRequired[str]
    geometry: NotRequired[dict[str, GeometryTable]]
    wiring: NotRequired[WiringTable]


def parse_hand(data: bytes, file: str) -> HandDocument:
    """Parse and check the bytes of a description file.

    Args:
        data: content of the file, UTF-8 TOML.
        file: file name, for errors.

    Raises:
        HandDescriptionError: too large, not UTF-8, not TOML, or an error found by check_hand.
    """
    return check_hand(parse_toml(data, file), file)


def check_hand(document: dict[str, Any], file: str) -> HandDocument:
    """Check a parsed description against the schema.

    Args:
        document: parsed TOML document.
        file: file name, for errors.

    Returns:
        The same document with its static type.

    Raises:
        HandDescriptionError: the first error.
    """
    top = Field(file)
    _check_header(document, top)  # first, because a file of another version may have other keys
    check_table(document, _HAND, top, _HAND_OPTIONAL)
    check_identifier(document["name"], top.key("name"))
    check_description(document["description"], top.key("description"))
    _check_taxel(document["taxel"], top.key("taxel"))
    _check_kinds(document["kinds"], top.key("kinds"))
    _check_boards(document["boards"], document["kinds"], top.key("boards"))
    check_geometry(document, top)
    check_wiring(document, top)
    return cast(HandDocument, document)


def _check_header(document: dict[str, Any], top: Field) -> None:
    """Check the keys format and version of a hand description; raise HandDescriptionError."""
    for key, expected in (("format", FORMAT), ("version", VERSION)):
        if key not in document:
            top.key(key).fail(
                format_value(expected), "nothing", f"add {key} = {_format_toml(expected)} at the top of the file"
            )
        # The type is compared too, since true == 1 and 1.0 == 1 in Python.
        if type(document[key]) is not type(expected) or document[key] != expected:
            top.key(key).fail(
                format_value(expected),
                format_value(document[key]),
                "use a taxel release that reads this version, or convert the file",
            )


def _format_toml(value: str | int) -> str:
    """Format a string or an integer as a value in TOML."""
    return f'"{value}"' if isinstance(value, str) else str(value)


def _check_taxel(taxel: Any, field: Field) -> None:
    """Check the lengths (metres) in the table [taxel] of a hand description; raise HandDescriptionError."""
    check_table(taxel, _TAXEL, field, _TAXEL_OPTIONAL)
    for key in taxel:
        if not 0 < taxel[key] < MAX_LENGTH_M:  # also false for nan and inf
            field.key(key).fail(
                f"metres, above 0 and below {MAX_LENGTH_M:g}",
                format_value(taxel[key]),
                "write the length in metres, for example 0.005",
            )
    if taxel["size_m"] > taxel["pitch_m"]:
        field.key("size_m").fail(
            f"at most the pitch ({taxel['pitch_m']} m)",
            format_value(taxel["size_m"]),
            "taxels would overlap; correct the pitch or the size",
        )


def _check_kinds(kinds: Mapping[str, Any], field: Field) -> None:
    """Check the tables [kinds.<name>]: names, unique codes, line counts and crossings; raise HandDescriptionError."""
    names_by_code: dict[int, str] = {}
    for name, kind in kinds.items():
        item_field = field.key(name)
        check_identifier(name, item_field)
        check_table(kind, _KIND, item_field)
        code = kind["code"]
        check_range(code, 1, MAX_CODE, "a kind code (0 is a blank board)", item_field.key("code"))
        if code in names_by_code:
            item_field.key("code").fail(
                "a unique code",
                f"{code}, also used by {names_by_code[code]}",
                "choose an unused code",
            )
        names_by_code[code] = name
        check_range(kind["tx"], 1, DESCRIBED_LINES_MAX, "a number of TX lines", item_field.key("tx"))
        check_range(kind["rx"], 1, DESCRIBED_LINES_MAX, "a number of RX lines", item_field.key("rx"))
        check_range(kind["taxels"], 1, TAXELS_MAX, "a number of taxels", item_field.key("taxels"))
        check_crossings(kind["crossings"], kind["tx"], kind["rx"], kind["taxels"], item_field.key("crossings"))


def _check_boards(boards: list[Any], kinds: Mapping[str, Any], field: Field) -> None:
    """Check the tables [[boards]]: kinds, and unique names and addresses; raise HandDescriptionError."""
    if not boards:
        field.fail("at least one board", "none", "add a [[boards]] table")
    owners: dict[str, dict[Any, str]] = {"name": {}, "address": {}}
    for index, board in enumerate(boards):
        item_field = field.item(index)
        check_table(board, _BOARD, item_field, _BOARD_OPTIONAL)
        check_identifier(board["name"], item_field.key("name"))
        if "branch" in board:
            check_identifier(board["branch"], item_field.key("branch"))
        if board["kind"] not in kinds:
            item_field.key("kind").fail(
                "the name of a [kinds] table", format_value(board["kind"]), suggest_name(board["kind"], kinds)
            )
        if not ADDRESS_MIN <= board["address"] <= ADDRESS_MAX:
            item_field.key("address").fail(
                f"a 7-bit I2C address from {format_address(ADDRESS_MIN)} to {format_address(ADDRESS_MAX)}",
                format_address(board["address"]),
                "choose an unused address in this range (without the read/write bit)",
            )
        for key, owner in owners.items():
            if board[key] in owner:
                value = format_address(board[key]) if key == "address" else format_value(board[key])
                item_field.key(key).fail(
                    f"a unique board {key}",
                    f"{value}, also in {owner[board[key]]}",
                    f"choose an unused {key} for one of them",
                )
            owner[board[key]] = item_field.path
