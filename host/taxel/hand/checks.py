"""Checks that every description file shares: keys, types, names and ranges, each refused with one line."""

from __future__ import annotations

import difflib
import math
import re
import sys
from collections.abc import Iterable, Mapping
from typing import Any

from taxel.hand.errors import Field, format_value

UNIT_TOLERANCE = 1e-3
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
    """The table has exactly these keys, each of its type; those of `optional` may be absent."""
    optional = optional or {}
    known = {**keys, **optional}
    check_type(table, dict, field)
    for key in table:
        if key not in known:
            field.key(key).fail("a known key", "an unknown one", suggest_name(key, known))
    for key, kind in keys.items():
        if key not in table:
            field.key(key).fail(_TYPES[kind], "nothing", f"add {key}")
    for key in table:
        check_type(table[key], known[key], field.key(key))


def suggest_name(name: str, known: Iterable[str]) -> str:
    """What to do about an unknown name."""
    known = sorted(known)
    # Cut: the comparison is quadratic and the name is the file's.
    near = difflib.get_close_matches(name[:64], known, n=1)
    return f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}"


def check_type(value: Any, kind: type, field: Field) -> None:
    """The value is of that type; an integer may stand where a number is expected, a boolean nowhere."""
    allowed: tuple[type, ...] = (int, float) if kind is float else (kind,)
    if isinstance(value, bool) or not isinstance(value, allowed):
        remedy = "write [[boards]] before each board" if kind is list else "change its type"
        if kind is dict:
            remedy = "make it a table"
        elif kind is int and isinstance(value, str):
            remedy = "remove the quotes"
        field.fail(_TYPES[kind], format_value(value), remedy)


def check_identifier(name: str, field: Field) -> None:
    """A name that is safe in file names, topics and HDF5 paths."""
    if not _IDENTIFIER.fullmatch(name):
        field.fail("a letter, then letters, digits and _ (64 at most)", format_value(name), "rename it")


def check_description(text: str, field: Field) -> None:
    """One line for people."""
    if not text.isprintable() or len(text) > MAX_DESCRIPTION:  # it is printed: no control characters
        field.fail(f"one printable line of at most {MAX_DESCRIPTION} characters", format_value(text), "shorten it")


def check_range(value: int, low: int, high: int, what: str, field: Field) -> None:
    """`value` lies in [low, high]."""
    if not low <= value <= high:
        field.fail(f"{what} from {low} to {high}", format_value(value), "correct it")


def check_numbers(values: Any, count: int, field: Field, what: str) -> None:
    """`values` is a list of `count` finite numbers."""
    check_type(values, list, field)
    if len(values) != count:
        field.fail(f"{count} numbers ({what})", f"{len(values)}", "give each of them")
    for index, value in enumerate(values):
        check_type(value, float, field.item(index))
        if not abs(value) <= sys.float_info.max:  # isfinite refuses an integer that no float can hold
            field.item(index).fail("a finite number", format_value(value), "correct it")


def check_unit(values: list[float], field: Field, what: str) -> None:
    """`values` is a vector of length 1 (to 1e-3: figures are written rounded, and normalised when read)."""
    length = math.hypot(*values)  # a sum of squares may be an integer that no float can hold
    if abs(length - 1.0) > UNIT_TOLERANCE:
        field.fail(f"{what} of length 1", f"length {length:.4g}", "normalise it")
