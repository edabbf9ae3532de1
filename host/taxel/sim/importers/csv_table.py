"""A CSV file of known columns, in any order and under their common names, as arrays."""

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
from taxel.sim.importers.errors import Source, near_names
from taxel.types import FloatArray

__all__ = ["POSE_PARTS", "Column", "CsvTable", "Progress", "pose_columns", "read_csv", "silent"]

Progress = Callable[[str, int, int], object]
"""Called with what is being done, how much of it is finished, and of how much."""

POSE_PARTS = ("x", "y", "z", "qw", "qx", "qy", "qz")
_REPORT_LINES = 2000
_LEAST_LENGTH = 1e-6


def silent(what: str, finished: int, of: int) -> None:
    """Say nothing."""


@dataclass(frozen=True)
class Column:
    """A column. kind: text, number (finite) or integer (0 or more). blank: a number may be left empty, then NaN."""

    name: str
    kind: Literal["text", "number", "integer"] = "number"
    aliases: tuple[str, ...] = ()
    required: bool = False
    blank: bool = False


@dataclass(frozen=True, eq=False)
class CsvTable:
    """r rows. line: i64[r], line in the file. texts: [r] each; numbers: f64[r] each; absent columns are missing."""

    source: Source
    line: NDArray[np.int64]
    texts: Mapping[str, Sequence[str]]
    numbers: Mapping[str, FloatArray]

    def has(self, name: str) -> bool:
        """Whether the file has that column."""
        return name in self.texts or name in self.numbers

    def at(self, row: int, column: str = "") -> Source:
        """The place of a row, for an error."""
        return self.source.at(int(self.line[row]), column)

    def vectors(self, names: Sequence[str]) -> FloatArray | None:
        """Columns side by side, f64[r, len(names)]; None if the file has none of them. All or none must be there."""
        there = [name for name in names if name in self.numbers]
        if not there:
            return None
        for name in names:
            if name not in self.numbers:
                self.source.at(1).fail(f"columns {', '.join(names)}", f"no {name}", "add it, or leave out all of them")
        return np.column_stack([self.numbers[name] for name in names])

    def poses(self, prefix: str) -> FloatArray | None:
        """The poses in `pose_columns(prefix)`, f64[r, 4, 4]; None if the file has none."""
        names = [column.name for column in pose_columns(prefix)]
        values = self.vectors(names)
        if values is None:
            return None
        short = np.linalg.norm(values[:, 3:], axis=1) < _LEAST_LENGTH
        if short.any():
            place = self.at(int(np.argmax(short)), names[3])
            place.fail("a quaternion w, x, y, z", "zeros", "write 1, 0, 0, 0 where nothing is turned")
        return make_pose(values[:, :3], values[:, 3:])


def pose_columns(prefix: str, required: bool = False) -> tuple[Column, ...]:
    """Columns of a pose: position (metres) and quaternion, such as wrist_x ... wrist_qz; prefix "": x ... qz."""
    stem = f"{prefix}_" if prefix else ""
    return tuple(Column(f"{stem}{part}", required=required) for part in POSE_PARTS)


def read_csv(path: str | os.PathLike[str], columns: Sequence[Column], progress: Progress = silent) -> CsvTable:
    """Read a CSV file: UTF-8, commas, one header line; empty lines are skipped.

    Raises ImportDataError for the first mistake, by line and column.
    """
    source = Source(os.fspath(path))
    file = Path(path)
    if not file.is_file():
        source.fail("a CSV file", "a folder" if file.is_dir() else "no such file", "check the path")
    size = max(file.stat().st_size, 1)
    try:
        with file.open(encoding="utf-8-sig", newline="") as stream:
            reader = csv.reader(_counted(stream, size, f"reading {file.name}", progress), strict=True)
            return _read(reader, columns, source)
    except UnicodeDecodeError:
        source.fail("UTF-8 text", "other bytes", "save the file as UTF-8")
    except csv.Error as error:
        source.at(reader.line_num).fail("comma-separated values", format_value(str(error)), "correct that line")
    except OSError as error:
        source.fail("a readable file", error.strerror or type(error).__name__, "check its permissions")


def _counted(stream: Iterator[str], size: int, what: str, progress: Progress) -> Iterator[str]:
    done = 0
    for number, line in enumerate(stream):
        done += len(line)
        if number % _REPORT_LINES == 0:
            progress(what, min(done, size), size)
        yield line
    progress(what, size, size)


def _read(reader: Any, columns: Sequence[Column], source: Source) -> CsvTable:
    order = _header(next(reader, []), columns, source)
    values: list[list[Any]] = [[] for _ in order]
    lines: list[int] = []
    for row in reader:
        if not any(cell.strip() for cell in row):
            continue
        line = reader.line_num
        if len(row) != len(order):
            remedy = "give one for each column, with points in the numbers"
            source.at(line).fail(f"{len(order)} values", str(len(row)), remedy)
        for column, cell, kept in zip(order, row, values, strict=True):
            kept.append(_value(cell.strip(), column, source, line))
        lines.append(line)
    if not lines:
        source.fail("rows below the header", "none", "is the recording empty?")
    named = dict(zip((column.name for column in order), values, strict=True))
    texts = {column.name: named[column.name] for column in order if column.kind == "text"}
    numbers = {name: np.array(kept, np.float64) for name, kept in named.items() if name not in texts}
    return CsvTable(source, np.array(lines, np.int64), texts, numbers)


def _header(cells: list[str], columns: Sequence[Column], source: Source) -> list[Column]:
    """The column that each cell of the header names."""
    known = {name.lower(): column for column in columns for name in (column.name, *column.aliases)}
    order: list[Column] = []
    place = source.at(1)
    if len(cells) == 1 and any(mark in cells[0] for mark in ";\t"):
        place.fail("columns apart by commas", format_value(cells[0]), "save the file with commas")
    for cell in cells:
        name = cell.strip()
        column = known.get(name.lower())
        if column is None:
            near = near_names(name, [column.name for column in columns])
            place.fail("known columns", format_value(name), f"rename or remove that column ({near})")
        if column in order:
            place.fail(
                "each column once", f"{format_value(name)}, which is {column.name} again", "remove one of the two"
            )
        order.append(column)
    for column in columns:
        if column.required and column not in order:
            place.fail(f"a column {column.name}", "none", "add it; the first line names the columns")
    return order


def _value(cell: str, column: Column, source: Source, line: int) -> str | float:
    if column.kind == "text":
        if not cell:
            source.at(line, column.name).fail("a name", "nothing", "fill it in")
        return cell
    if not cell and column.blank:
        return float("nan")
    try:
        value = float(cell) if "_" not in cell else float("nan")
    except ValueError:
        value = float("nan")
    whole = column.kind == "integer"
    if not np.isfinite(value) or (whole and (value < 0 or value % 1)):
        expected = "an integer of 0 or more" if whole else "a finite number"
        source.at(line, column.name).fail(expected, format_value(cell), f"write it as {'3' if whole else '0.125'}")
    return value
