"""Rows of a CSV file of unknown origin, read one at a time with bounded memory."""

import csv
import io
import os
from collections.abc import Iterator
from typing import Final

from taxel.input_files.regular_file import open_regular_file
from taxel.input_files.text_error import TextError, format_reason

LINE_MAX: Final = 1 << 16
"""Largest number of characters that are read at once; a longer line is divided, and its parts have too few columns."""


def read_csv_rows(path: str | os.PathLike[str]) -> Iterator[tuple[int, list[str]]]:
    """Yield (number of the line, entries) of each row of a file with commas.

    A byte that is not UTF-8 becomes the character U+FFFD, which is no part of a number. Raises TextError for an entry
    of more than 128 KiB, InputFileError for a pipe or a device, and OSError.
    """
    with io.TextIOWrapper(open_regular_file(path), encoding="utf-8-sig", errors="replace", newline="") as file:
        reader = csv.reader(iter(lambda: file.readline(LINE_MAX), ""))
        while True:
            try:
                row = next(reader, None)
            except csv.Error as error:
                raise TextError(f"line {reader.line_num}", "comma-separated values", format_reason(error)) from None
            if row is None:
                return
            yield reader.line_num, row


def parse_float(text: str) -> float:
    """Return the number of an entry. Raises ValueError for another text, also for digits with "_"."""
    if "_" in text or not text.isascii():
        raise ValueError(f"could not convert to a number: {format_reason(ascii(text))}")
    return float(text)


def parse_integer(text: str) -> int:
    """Return the integer of an entry. Raises ValueError as `parse_float`."""
    if "_" in text or not text.isascii():
        raise ValueError(f"could not convert to an integer: {format_reason(ascii(text))}")
    return int(text)
