"""Schema of a calibration file; the first error is reported in one line.

Keys are declared in tables (``_TOP``, ``_ENTRY``, ``_POSE``). Invalid values are never corrected, and unknown keys are
never ignored.
"""

import datetime
import difflib
import math
import re
from collections.abc import Iterable, Mapping
from typing import Any

from taxel.grasp.calibration_errors import CalibrationError, CalibrationField
from taxel.hand.errors import HandDescriptionError, format_value
from taxel.hand.toml_text import parse_toml

__all__ = ["FORMAT", "KINDS", "VERSION", "check_coordinate", "check_name", "parse_calibration"]

FORMAT = "taxel-calibration"
VERSION = 1
KINDS: Mapping[str, str] = {"objects": "name", "brackets": "sensor"}
"""Lists of the file, and the key that names an entry of the list."""

MAX_COORDINATE_M = 20.0
"""Largest coordinate, metres; a larger value indicates a wrong unit."""
MAX_SIGMA_M = 0.1
"""Largest standard deviation, metres; a larger value indicates a wrong unit."""
UNIT_TOLERANCE = 1e-3
"""Tolerance of the length of a quaternion: allows rounding, and usually detects a wrong order of components."""
ROW = ("name", "x", "y", "z", "X", "Y", "Z")
"""Values of a point: its name, coordinates in the body frame, measured coordinates."""
MAX_TEXT = 200  # characters

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")

_Types = tuple[str, tuple[type, ...]]
_TEXT: _Types = ("a string", (str,))
_NUMBER: _Types = ("a number", (int, float))
_LIST: _Types = ("a list", (list,))
_TABLE: _Types = ("a table", (dict,))
_DATE: _Types = ("a date such as 2024-05-17, without quotes", (datetime.date,))  # a datetime is a date

_TOP: Mapping[str, _Types] = {"format": _TEXT, "version": ("an integer", (int,)), "objects": _LIST, "brackets": _LIST}
_ENTRY: Mapping[str, _Types] = {
    "pose": _TABLE,
    "points": _LIST,
    "weights": _LIST,
    "sigma_m": _NUMBER,
    "measured": _DATE,
    "instrument": _TEXT,
}
_POSE: Mapping[str, _Types] = {"position_m": _LIST, "quaternion_wxyz": _LIST}


def parse_calibration(data: bytes, file: str) -> dict[str, Any]:
    """Parse and check the bytes of a calibration file.

    Args:
        data: content of the file, UTF-8 TOML in lines of at most 200 bytes.
        file: file name, for errors.

    Returns:
        The document, with the lists ``objects`` and ``brackets`` present.

    Raises:
        CalibrationError: the first error.
    """
    try:
        document = parse_toml(data, file)
    except HandDescriptionError as error:
        remedy = error.remedy.replace("a hand description", "a calibration file")
        raise CalibrationError(error.file, error.field, error.expected, error.found, remedy) from None
    top = CalibrationField(file)
    _check_header(document, top)  # first, because a file of another version may have other keys
    _check_table(document, _TOP, top, required=())
    for kind, key in KINDS.items():
        names: dict[str, str] = {}
        for index, entry in enumerate(document.setdefault(kind, [])):
            _check_entry(entry, key, names, top.key(kind).item(index))
    if not (document["objects"] or document["brackets"]):
        top.fail("at least one object or bracket", "none", "add an [[objects]] or a [[brackets]] table")
    return document


def check_name(name: Any, owners: dict[str, str], field: CalibrationField) -> None:
    """Check that a name has only letters, digits, '_', '.' and '-' and is unique. Raises CalibrationError.

    owners: location of each name found before; the name is added.
    """
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        field.fail("a name of letters, digits, '_', '.' and '-' (64 at most)", format_value(name), "rename it")
    if name in owners:
        field.fail("a unique name", f"{name!r}, also in {owners[name]}", "rename or remove one of them")
    owners[name] = field.path


def check_coordinate(value: Any, field: CalibrationField) -> None:
    """Check that a value is a number of metres within `MAX_COORDINATE_M`. Raises CalibrationError."""
    _check_type(value, _NUMBER, field)
    if not abs(value) <= MAX_COORDINATE_M:  # also true for nan
        field.fail(
            f"metres, at most {MAX_COORDINATE_M:g}",
            format_value(value),
            "write the coordinate in metres, for example 0.125",
        )


def _check_header(document: dict[str, Any], top: CalibrationField) -> None:
    """Raise CalibrationError for a calibration file with a missing or different format or version.

    top: location of the file, for messages.
    """
    for key, expected in (("format", FORMAT), ("version", VERSION)):
        value = document.get(key)
        if value is None:
            text = f'"{expected}"' if isinstance(expected, str) else str(expected)
            top.key(key).fail(format_value(expected), "nothing", f"add {key} = {text} at the top of the file")
        # The type is compared too, since true == 1 and 1.0 == 1 in Python.
        if type(value) is not type(expected) or value != expected:
            top.key(key).fail(
                format_value(expected),
                format_value(value),
                "use a taxel release that reads this version, or convert it",
            )


def _check_table(table: Any, keys: Mapping[str, _Types], field: CalibrationField, required: Iterable[str]) -> None:
    """Raise CalibrationError for unknown keys, missing keys and values of another type in a table of the file.

    keys: permitted types by key. field: location of the table. required: keys that must be present.
    """
    _check_type(table, _TABLE, field)
    for key, value in table.items():
        if key not in keys:
            near = difflib.get_close_matches(key[:64], keys, n=1)  # truncated because the comparison is quadratic
            remedy = f"did you mean {near[0]}?" if near else f"known keys: {', '.join(keys)}"
            field.key(key).fail("a known key", "an unknown key", remedy)
        _check_type(value, keys[key], field.key(key))
    for key in required:
        if key not in table:
            field.key(key).fail(keys[key][0], "nothing", f"add {key}")


def _check_type(value: Any, types: _Types, field: CalibrationField) -> None:
    """Raise CalibrationError for a value of another type. types: name of the type for the message, then the type."""
    if isinstance(value, bool) or not isinstance(value, types[1]):
        field.fail(types[0], format_value(value), "change its type")


def _check_entry(entry: Any, key: str, names: dict[str, str], field: CalibrationField) -> None:
    """Check an object or a bracket of a calibration file. Raises CalibrationError.

    key: the key of its name. names: locations of the names found before. field: location of the entry.
    """
    _check_table(entry, {key: _TEXT, **_ENTRY}, field, required=(key,))
    check_name(entry[key], names, field.key(key))
    if ("pose" in entry) == ("points" in entry):
        field.fail("either pose or points", "both" if "pose" in entry else "neither", "keep one of them")
    for key in ("weights", "sigma_m"):
        if key in entry and "points" not in entry:
            field.key(key).fail("an entry with points", "an entry with a pose", f"remove {key}, or add the points")
    if "instrument" in entry:
        _check_text(entry["instrument"], field.key("instrument"))
    if "pose" in entry:
        _check_pose(entry["pose"], field.key("pose"))
    else:
        _check_rows(entry["points"], field.key("points"))
        _check_weights(entry, field.key("weights"))
    if not 0 < entry.get("sigma_m", MAX_SIGMA_M) <= MAX_SIGMA_M:
        remedy = "write the standard deviation in metres, for example 25e-6"
        field.key("sigma_m").fail(f"metres, above 0, at most {MAX_SIGMA_M:g}", format_value(entry["sigma_m"]), remedy)


def _check_text(text: str, field: CalibrationField) -> None:
    """Raise CalibrationError for a text with several lines, or with more than `MAX_TEXT` characters."""
    if not text.isprintable() or len(text) > MAX_TEXT:
        field.fail(f"one printable line of at most {MAX_TEXT} characters", format_value(text), "shorten it")


def _check_pose(pose: Any, field: CalibrationField) -> None:
    """Check position and quaternion of a pose in a calibration file. Raises CalibrationError."""
    _check_table(pose, _POSE, field, required=_POSE)
    for key, size in (("position_m", 3), ("quaternion_wxyz", 4)):
        if len(pose[key]) != size:
            field.key(key).fail(f"{size} numbers", str(len(pose[key])), "correct the list")
    for index, value in enumerate(pose["position_m"]):
        check_coordinate(value, field.key("position_m").item(index))
    length = math.hypot(*pose["quaternion_wxyz"])
    if not abs(length - 1) <= UNIT_TOLERANCE:  # the length is not a number if a component is none
        field.key("quaternion_wxyz").fail("a quaternion of length 1", f"{length:.6g}", "normalise the quaternion")


def _check_rows(rows: list[Any], field: CalibrationField) -> None:
    """Check the measured points of an entry: name, body coordinates and measured coordinates in each row.

    field: location of the points. Raises CalibrationError.
    """
    names: dict[str, str] = {}
    for index, row in enumerate(rows):
        row_field = field.item(index)
        _check_type(row, _LIST, row_field)
        if len(row) != len(ROW):
            row_field.fail(
                f"[{', '.join(ROW)}]",
                f"{len(row)} values",
                "write the coordinates in the body frame, then the measured coordinates",
            )
        check_name(row[0], names, row_field)
        for column, value in enumerate(row[1:], start=1):
            check_coordinate(value, row_field.item(column))


def _check_weights(entry: Mapping[str, Any], field: CalibrationField) -> None:
    """Check that each measured point of an entry has a weight above 0. Raises CalibrationError."""
    weights = entry.get("weights", [1] * len(entry["points"]))
    if len(weights) != len(entry["points"]):
        field.fail(f"{len(entry['points'])} weights, one per point", str(len(weights)), "correct the list")
    for index, weight in enumerate(weights):
        _check_type(weight, _NUMBER, field.item(index))
        if not 0 < weight < math.inf:
            field.item(index).fail("a finite number above 0", format_value(weight), "remove the point to ignore it")
