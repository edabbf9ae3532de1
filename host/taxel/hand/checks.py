"""Checks shared by all description files: keys, types, names and ranges; each failure is a one-line error."""

import difflib
import math
import re
import sys
from collections.abc import Iterable, Mapping
from typing import Any

from taxel.hand.errors import Field, format_value

UNIT_TOLERANCE = 1e-3
"""Tolerance of the length of unit vectors, since files contain rounded numbers."""

MAX_DESCRIPTION = 200  # characters

_IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")

_TYPES: Mapping[type, str] = {
    str: "a string",
    int: "an integer",
    float: "a number",
    dict: "a table",
    list: "a list",
}


def check_table(table: Any, keys: Mapping[str, type], field: Field, optional: Mapping[str, type] | None = None) -> None:
    """Raise HandDescriptionError unless a table has exactly these keys with values of these types.

    keys, optional: type by key; keys in `optional` may be absent. field: position of the table, for errors.
    """
    optional = optional or {}
    known = {**keys, **optional}
    check_type(table, dict, field)
    for key in table:
        if key not in known:
            field.key(key).fail("a known key", "an unknown key", suggest_name(key, known))
    for key, kind in keys.items():
        if key not in table:
            field.key(key).fail(_TYPES[kind], "nothing", f"add {key}")
    for key in table:
        check_type(table[key], known[key], field.key(key))


def suggest_name(name: str, known: Iterable[str]) -> str:
    """Return the remedy for an unknown name: the most similar known name, or all known names."""
    known = sorted(known)
    # Truncated because the comparison is quadratic in the length of the name, which comes from the file.
    near = difflib.get_close_matches(name[:64], known, n=1)
    return f"did you mean {near[0]}?" if near else f"known names: {', '.join(known)}"


def check_type(value: Any, kind: type, field: Field) -> None:
    """Raise HandDescriptionError unless a value has a type; an integer is also a number, a boolean is neither."""
    allowed: tuple[type, ...] = (int, float) if kind is float else (kind,)
    if isinstance(value, bool) or not isinstance(value, allowed):
        remedy = "put [[boards]] before each board" if kind is list else "change its type"
        if kind is dict:
            remedy = "make it a table"
        elif kind is int and isinstance(value, str):
            remedy = "remove the quotes"
        field.fail(_TYPES[kind], format_value(value), remedy)


def check_identifier(name: str, field: Field) -> None:
    """Raise HandDescriptionError unless a name is safe in file names, topics and HDF5 paths."""
    if not _IDENTIFIER.fullmatch(name):
        field.fail("a letter, then letters, digits and _ (64 at most)", format_value(name), "rename it")


def check_description(text: str, field: Field) -> None:
    """Raise HandDescriptionError unless a string is one printable line of at most `MAX_DESCRIPTION` characters."""
    if not text.isprintable() or len(text) > MAX_DESCRIPTION:  # the text is printed on terminals
        field.fail(f"one printable line of at most {MAX_DESCRIPTION} characters", format_value(text), "shorten it")


def check_range(value: int, low: int, high: int, label: str, field: Field) -> None:
    """Raise HandDescriptionError unless low <= value <= high; label: name of the quantity in the error message."""
    if not low <= value <= high:
        field.fail(f"{label} from {low} to {high}", format_value(value), "correct it")


def check_numbers(values: Any, count: int, field: Field, label: str) -> None:
    """Raise HandDescriptionError unless `values` is a list of `count` finite numbers; label: their names for errors."""
    check_type(values, list, field)
    if len(values) != count:
        field.fail(f"{count} numbers ({label})", f"{len(values)}", "write all numbers")
    for index, value in enumerate(values):
        check_type(value, float, field.item(index))
        if not abs(value) <= sys.float_info.max:  # isfinite() raises for an integer that exceeds the range of float
            field.item(index).fail("a finite number", format_value(value), "correct it")


def check_unit(values: list[float], field: Field, label: str) -> None:
    """Raise HandDescriptionError unless `values` is a vector of length 1 within `UNIT_TOLERANCE`; label: its name."""
    length = math.hypot(*values)  # a sum of squares of integers may exceed the range of float
    if abs(length - 1.0) > UNIT_TOLERANCE:
        field.fail(f"{label} of length 1", f"length {length:.4g}", "normalise it")
