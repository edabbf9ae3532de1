"""A CSV file as arrays. The columns may have any order and several common names."""

import csv
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from taxel.hand.errors import format_value
from taxel.hand.transforms import make_pose
from taxel.sim.importers.errors import FileLocation, suggest_names
from taxel.types import FloatArray

__all__ = ["POSE_PARTS", "Column", "CsvTable", "Progress", "ignore_progress", "pose_columns", "read_csv"]

Progress = Callable[[str, int, int], object]
"""Called with a description of the current step, the completed amount and the total amount."""

POSE_PARTS = ("x", "y", "z", "qw", "qx", "qy", "qz")
LARGEST_NUMBER = 1e15
"""Largest magnitude of a number: far above every physical quantity, and its square is a finite number."""
_PROGRESS_LINES = 2000  # lines between two calls of the progress function
_MIN_QUATERNION_NORM = 1e-6  # a quaternion with a smaller norm is treated as missing


def ignore_progress(step: str, completed: int, total: int) -> None:
    """Do nothing: the default progress function."""


@dataclass(frozen=True)
class Column:
    """Specification of a column of an imported CSV file.

    kind: "text", "number" (finite) or "integer" (0 or more). aliases: further permitted names. blank: an empty cell is
    permitted and becomes NaN.
    """

    name: str
    kind: Literal["text", "number", "integer"] = "number"
    aliases: tuple[str, ...] = ()
    required: bool = False
    blank: bool = False


@dataclass(frozen=True, eq=False)
class CsvTable:
    """The r rows of an imported CSV file, or of several files that are imported together.

    line: i64[r], line number in the file. texts, numbers: columns by name, [r] strings and f64[r]; only the columns of
    the file. row_sources: file of each row; None if all rows are from `source`.
    """

    source: FileLocation
    line: NDArray[np.int64]
    texts: Mapping[str, Sequence[str]]
    numbers: Mapping[str, FloatArray]
    row_sources: Sequence[FileLocation] | None = None

    def has(self, name: str) -> bool:
        """Return whether the file has a column of this name."""
        return name in self.texts or name in self.numbers

    def at(self, row: int, column: str = "") -> FileLocation:
        """Return the location of a row, and optionally a column, of the CSV file for an error message."""
        source = self.source if self.row_sources is None else self.row_sources[row]
        return source.at(int(self.line[row]), column)

    def vectors(self, names: Sequence[str]) -> FloatArray | None:
        """Return the columns `names` of the CSV file as f64[r, len(names)]; None if the file has none of them.

        Raises ImportDataError if the file has only some of them.
        """
        if not any(name in self.numbers for name in names):
            return None
        for name in names:
            if name not in self.numbers:
                self.source.at(1).fail(f"columns {', '.join(names)}", f"no {name}", "add it, or leave out all of them")
        return np.column_stack([self.numbers[name] for name in names])

    def poses(self, prefix: str) -> FloatArray | None:
        """Return the poses of the columns `pose_columns(prefix)`, f64[r, 4, 4]; None if the CSV file has none of them.

        Raises ImportDataError for a missing column and for a quaternion of zeros.
        """
        names = [column.name for column in pose_columns(prefix)]
        values = self.vectors(names)
        if values is None:
            return None
        is_zero = np.linalg.norm(values[:, 3:], axis=1) < _MIN_QUATERNION_NORM
        if is_zero.any():
            location = self.at(int(np.argmax(is_zero)), names[3])
            location.fail("a quaternion w, x, y, z", "zeros", "write 1, 0, 0, 0 for the identity rotation")
        return make_pose(values[:, :3], values[:, 3:])


def pose_columns(prefix: str, required: bool = False) -> tuple[Column, ...]:
    """Return the columns of a pose: position (metres) and quaternion, such as wrist_x ... wrist_qz for "wrist"."""
    start = f"{prefix}_" if prefix else ""
    return tuple(Column(f"{start}{part}", required=required) for part in POSE_PARTS)


def read_csv(path: str | os.PathLike[str], columns: Sequence[Column], progress: Progress = ignore_progress) -> CsvTable:
    """Read a CSV file: UTF-8, commas, one header line; empty lines are skipped.

    Raises ImportDataError with line and column of the first error.
    """
    source = FileLocation(os.fspath(path))
    file = Path(path)
    if not file.is_file():
        source.fail("a CSV file", "a folder" if file.is_dir() else "no such file", "check the path")
    size = max(file.stat().st_size, 1)
    try:
        with file.open(encoding="utf-8-sig", newline="") as stream:
            reader = csv.reader(_with_progress(stream, size, f"reading {file.name}", progress), strict=True)
            return _read_table(reader, columns, source)
    except UnicodeDecodeError:
        source.fail("UTF-8 text", "other bytes", "save the file as UTF-8")
    except csv.Error as error:
        source.at(reader.line_num).fail("comma-separated values", format_value(str(error)), "correct this line")
    except OSError as error:
        source.fail("a readable file", error.strerror or type(error).__name__, "check its permissions")


def _with_progress(stream: Iterator[str], size: int, step: str, progress: Progress) -> Iterator[str]:
    """Yield the lines of a stream of `size` bytes, and call the progress function from time to time."""
    done = 0
    for number, line in enumerate(stream):
        done += len(line)
        if number % _PROGRESS_LINES == 0:
            progress(step, min(done, size), size)
        yield line
    progress(step, size, size)


def _read_table(reader: Any, columns: Sequence[Column], source: FileLocation) -> CsvTable:
    """Convert the rows of a CSV reader to a table. Raises ImportDataError for the first error."""
    order = _read_header(next(reader, []), columns, source)
    values: list[list[Any]] = [[] for _ in order]
    lines: list[int] = []
    for row in reader:
        if not any(cell.strip() for cell in row):
            continue
        line = reader.line_num
        if len(row) != len(order):
            remedy = "give one value for each column, with decimal points"
            source.at(line).fail(f"{len(order)} values", str(len(row)), remedy)
        for column, cell, column_values in zip(order, row, values, strict=True):
            column_values.append(_parse_value(cell.strip(), column, source, line))
        lines.append(line)
    if not lines:
        source.fail("rows below the header", "none", "check whether the recording is empty")
    by_name = dict(zip((column.name for column in order), values, strict=True))
    texts = {column.name: by_name[column.name] for column in order if column.kind == "text"}
    numbers = {name: np.array(content, np.float64) for name, content in by_name.items() if name not in texts}
    return CsvTable(source, np.array(lines, np.int64), texts, numbers)


def _read_header(cells: list[str], columns: Sequence[Column], source: FileLocation) -> list[Column]:
    """Return the known column that each cell of the header line names.

    Raises ImportDataError for an unknown or repeated name, and for a missing required column.
    """
    known = {name.lower(): column for column in columns for name in (column.name, *column.aliases)}
    order: list[Column] = []
    location = source.at(1)
    if len(cells) == 1 and any(mark in cells[0] for mark in ";\t"):
        location.fail("columns separated by commas", format_value(cells[0]), "save the file with commas")
    for cell in cells:
        name = cell.strip()
        column = known.get(name.lower())
        if column is None:
            suggestion = suggest_names(name, [column.name for column in columns])
            location.fail("known columns", format_value(name), f"rename or remove this column ({suggestion})")
        if column in order:
            found = f"{format_value(name)}, a second column {column.name}"
            location.fail("each column once", found, "remove one of the two")
        order.append(column)
    for column in columns:
        if column.required and column not in order:
            location.fail(f"a column {column.name}", "none", "add it; the first line names the columns")
    return order


def _parse_value(cell: str, column: Column, source: FileLocation, line: int) -> str | float:
    """Convert a cell of a CSV file to the type of its column: a string or a number; NaN for a permitted empty cell.

    Raises ImportDataError for any other cell, with the line number `line`.
    """
    if column.kind == "text":
        if not cell:
            source.at(line, column.name).fail("a name", "nothing", "add the name")
        return cell
    if not cell and column.blank:
        return float("nan")
    try:
        value = float(cell) if "_" not in cell else float("nan")  # Python would accept 1_000
    except ValueError:
        value = float("nan")
    is_integer = column.kind == "integer"
    if not abs(value) <= LARGEST_NUMBER or (is_integer and (value < 0 or value % 1)):
        finite = f"a number of at most {LARGEST_NUMBER:g}" if np.isfinite(value) else "a finite number"
        expected = "an integer of 0 or more" if is_integer else finite
        remedy = f"write it as {'3' if is_integer else '0.125'}"
        source.at(line, column.name).fail(expected, format_value(cell), remedy)
    return value
