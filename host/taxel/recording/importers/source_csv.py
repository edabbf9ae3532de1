"""CSV tables: UTF-8, columns separated by comma, semicolon or tab, with or without a header line.

Without a header line the columns have the names c0, c1, ... A first line that begins with "#" is a header, as
numpy.savetxt writes it. An empty entry of a column of numbers is a missing value (NaN).
"""

from __future__ import annotations

import codecs
import csv
import re
from collections import Counter
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from taxel.hand.errors import format_value
from taxel.input_files.csv_rows import parse_float
from taxel.recording.grasp_checks import Location
from taxel.recording.importers.fields import Source, check_size, make_field

_SEPARATORS: Final = ",;\t"
_SPACES: Final = " \t"
_CONTROL: Final = re.compile(rb"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\xff]")
"""Bytes that a table of numbers does not contain."""
_FAST_BYTES: Final = 1 << 16
"""Size above which a table of numbers is parsed by numpy.loadtxt, which is ten times faster than Python, bytes."""


def open_file(path: Path) -> Source:
    """Read a CSV table; every column is a field. Raises DatasetError with the line of the first error."""
    location = Location(str(path))
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            first = file.readline()
    except (UnicodeDecodeError, OSError):
        location.fail("a table as UTF-8 text", "other bytes", "save the table as CSV with the encoding UTF-8")
    if "\0" in first:
        location.fail("a table as UTF-8 text", "binary data", "save the table as CSV")
    separator = max(_SEPARATORS, key=first.count)
    try:
        header = next(csv.reader([first.lstrip("# ")], delimiter=separator), [])
    except csv.Error as error:
        location.key("line 1").fail("a CSV table", format_value(str(error)), "save the table as CSV again")
    names = [name.strip(_SPACES) for name in header]
    has_header = any(not _is_number(name) for name in names)
    if not has_header:
        names = [f"c{number}" for number in range(len(names))]
    _check_names(names, location)
    columns = _read_fast(path, separator, has_header, len(names))
    if columns is None:
        columns = _read_rows(path, separator, has_header, names, location)
    if not columns or not len(columns[0]):
        location.fail("rows below the header", "none", "check whether the recording is empty")
    fields = {name: make_field(name, column) for name, column in zip(names, columns, strict=True)}
    return Source(path, "CSV table", fields, is_table=True)


def _check_names(names: list[str], location: Location) -> None:
    """Raise DatasetError for a name of more than one column."""
    name, count = Counter(names).most_common(1)[0] if names else ("", 0)
    if count > 1:
        location.key(name or "(empty name)").fail("each column once", f"{count} columns", "rename the columns")


def _is_number(text: str) -> bool:
    """Whether a string is a number; an empty string is treated as a missing number."""
    try:
        parse_float(text or "nan")
    except ValueError:
        return False
    return True


def _read_fast(path: Path, separator: str, has_header: bool, width: int) -> list[NDArray[Any]] | None:
    """Read the columns of a large table of numbers with NumPy.

    width: number of columns. None for a small table, and for a table with strings, empty entries or errors, which
    `_read_rows` reads instead.
    """
    if path.stat().st_size < _FAST_BYTES or _has_other_bytes(path):
        return None
    try:
        table = np.loadtxt(path, delimiter=separator, skiprows=int(has_header), ndmin=2, encoding="utf-8-sig")
    except (ValueError, UnicodeDecodeError):
        return None
    return list(table.T) if table.shape[1] == width else None


def _has_other_bytes(path: Path) -> bool:
    """Whether a file contains control characters or bytes outside ASCII; a UTF-8 byte order mark is permitted."""
    with path.open("rb") as file:
        chunk = file.read(_FAST_BYTES).removeprefix(codecs.BOM_UTF8)
        while chunk:
            if _CONTROL.search(chunk):
                return True
            chunk = file.read(1 << 20)
    return False


def _read_rows(
    path: Path, separator: str, has_header: bool, names: list[str], location: Location
) -> list[NDArray[Any]]:
    """Read the columns of a table, numbers or strings. Raises DatasetError for rows of different lengths."""
    # A file with more bytes than the largest permitted array is refused before its rows fill the memory.
    check_size((path.stat().st_size // 8,), 8, location)
    rows: list[list[str]] = []
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file, delimiter=separator, strict=True)
            for row in reader:
                if not row or (has_header and reader.line_num == 1):
                    continue
                if len(row) != len(names):
                    line = location.key(f"line {reader.line_num}")
                    line.fail(f"{len(names)} entries as in the first line", str(len(row)), "correct that line")
                rows.append(row)
    except (csv.Error, UnicodeDecodeError, OSError) as error:
        location.fail("a CSV table as UTF-8 text", format_value(str(error)), "save the table as CSV again")
    return [_convert_column([row[index].strip(_SPACES) for row in rows]) for index in range(len(names))]


def _convert_column(column: list[str]) -> NDArray[Any]:
    """Convert a column to f64 if every entry is a number or empty (NaN), else to an array of strings."""
    try:
        return np.array([parse_float(entry or "nan") for entry in column], np.float64)
    except ValueError:
        return np.array(column, dtype=str)
