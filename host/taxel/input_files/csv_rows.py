"""Rows of a CSV file of unknown origin, read one at a time with bounded memory."""

import csv
import io
import os
from collections.abc import Iterator, Sequence
from typing import Final

from taxel.input_files.regular_file import open_regular_file
from taxel.input_files.text_error import TextError, format_reason

LINE_MAX: Final = 1 << 16
"""Largest number of characters of a line that are read at once. A longer line is divided into rows, which have too few
columns and are therefore refused later.
"""


def read_csv_rows(path: str | os.PathLike[str]) -> Iterator[tuple[int, list[str]]]:
    """Yield (line number from 1, entries) for each row of a file of comma-separated values.

    A byte that is not UTF-8 becomes the character U+FFFD, which is no part of a number. Raises TextError for an entry
    of more than 128 KiB, InputFileError for a pipe or a device, and OSError.
    """
    with io.TextIOWrapper(open_regular_file(path), encoding="utf-8-sig", errors="replace", newline="") as file:
        # A file without line ends is read in pieces of `LINE_MAX` characters, which bounds the memory.
        reader = csv.reader(iter(lambda: file.readline(LINE_MAX), ""))
        while True:
            try:
                row = next(reader, None)
            except csv.Error as error:
                raise TextError(f"line {reader.line_num}", "comma-separated values", format_reason(error)) from None
            if row is None:
                return
            yield reader.line_num, row


def _is_plain(text: str) -> bool:
    """Whether a text has only the characters of a number, and spaces or tabs around it.

    Python's conversions also accept "_" between digits, digits of other scripts, and control characters around a
    number, which a damaged table can contain.
    """
    number = text.strip(" \t")
    return "_" not in number and number.isascii() and number.isprintable()


def parse_float(text: str) -> float:
    """Convert an entry to a number. Raises ValueError for another text, also for digits with "_"."""
    if not _is_plain(text):
        raise ValueError(f"could not convert to a number: {format_reason(ascii(text))}")
    return float(text)


def parse_integer(text: str) -> int:
    """Convert an entry to an integer. Raises ValueError for another text, also for digits with "_"."""
    if not _is_plain(text):
        raise ValueError(f"could not convert to an integer: {format_reason(ascii(text))}")
    return int(text)


def read_csv_table(
    path: str | os.PathLike[str], columns: Sequence[str], most_rows: int
) -> Iterator[tuple[int, list[str]]]:
    """Yield (line number from 1, entries in the order of `columns`) for each row below the heading.

    The heading contains exactly these columns in any order. Raises TextError for another heading, a row with another
    number of entries and for more than `most_rows` rows, and as `read_csv_rows`.
    """
    rows = read_csv_rows(path)
    _, heading = next(rows, (1, []))
    if sorted(heading) != sorted(columns):
        wrong = next((name for name in columns if name not in heading), None)
        found = f"no column {wrong}" if wrong is not None else "an unknown or a repeated column"
        raise TextError("line 1", f"the columns {','.join(columns)}", found if heading else "no heading")
    order = [heading.index(name) for name in columns]
    for count, (number, row) in enumerate(rows):
        if count == most_rows:
            raise TextError(f"line {number}", f"at most {most_rows} rows", "more")
        if len(row) != len(columns):
            raise TextError(f"line {number}", f"{len(columns)} entries", str(len(row)))
        yield number, [row[index] for index in order]
