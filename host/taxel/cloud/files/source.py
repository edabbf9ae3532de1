"""An untrusted file of points: a bounded number of bytes, and one-line errors that name the file."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Final, NoReturn

import numpy as np
import numpy.typing as npt

from taxel.cloud.errors import CloudFileError
from taxel.input_files import check_regular_file, read_regular_file

MAX_FILE_BYTES: Final = 64 * 2**20
"""Largest accepted size of a file: more than a million triangles. The cloud of a campaign has less than one
megabyte."""

MAX_HEADER_BYTES: Final = 2**20
"""Largest accepted size of a header, bytes."""

MAX_WORDS: Final = 8 * 2**20
"""Largest number of words in a text; each takes some fifty bytes of memory after splitting."""


@dataclass(frozen=True)
class Source:
    """Content of a file. name: path in messages. data: all bytes of the file."""

    name: str
    data: bytes

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> Source:
        """Read the bytes of a point cloud or mesh file.

        Raises CloudFileError for an empty or too large file, OSError, also for a pipe or a device.
        """
        size = check_regular_file(path).st_size
        source = cls(str(path), b"")
        if size > MAX_FILE_BYTES:
            source.fail("file", f"at most {MAX_FILE_BYTES} bytes", str(size), "reduce the number of points")
        data = read_regular_file(path, MAX_FILE_BYTES)
        if not data:
            source.fail("file", f"1 to {MAX_FILE_BYTES} bytes", "0", "use another file")
        return cls(str(path), data)

    def fail(self, field: str, expected: str, found: str, remedy: str) -> NoReturn:
        """Raise CloudFileError for a field of this point cloud or mesh file; remedy: what the user can do."""
        raise CloudFileError(self.name, field, expected, found, remedy)

    def decode_text(self) -> str:
        """Return the whole file as text.

        Bytes beyond ASCII become letters, which the parser of numbers refuses later.
        """
        return self.limit_words(self.data.decode("latin-1"), "file")

    def limit_words(self, text: str, field: str) -> str:
        """Return the text unchanged. Raises CloudFileError if splitting it into words would need too much memory.

        field: part of the file, for the message.
        """
        breaks = sum(text.count(mark) for mark in " \t\n\r\v\f")
        if breaks > MAX_WORDS:
            self.fail(field, f"at most {MAX_WORDS} words", f"about {breaks}", "reduce the points, or write binary data")
        return text

    def parse_numbers(self, text: str, field: str) -> npt.NDArray[np.float64]:
        """Parse a string of numbers separated by blanks or line ends, f64[k]. Raises CloudFileError for any other word.

        field: part of the file, for the message.
        """
        words = self.limit_words(text, field).split()
        try:
            return np.array(words, dtype=np.float64)
        except ValueError as error:
            self.fail(field, "numbers", quote(str(error).rpartition(":")[2].strip(" '")), "correct it")

    def parse_table(self, text: str, columns: int, field: str) -> npt.NDArray[np.float64]:
        """Parse a string of numbers as rows of `columns` numbers, f64[rows, columns].

        field: part of the file, for the message. Raises CloudFileError if the values do not fill the last row.
        """
        numbers = self.parse_numbers(text, field)
        if len(numbers) % columns:
            self.fail(field, f"rows of {columns} numbers", f"{len(numbers)} numbers", "correct it")
        return numbers.reshape(-1, columns)


def parse_natural(word: str) -> int | None:
    """Parse a word of 1 to 18 decimal digits; return None for any other word."""
    return int(word) if word.isascii() and word.isdecimal() and len(word) <= 18 else None


def quote(text: str, max_length: int = 40) -> str:
    """Quote a part of a file for a message: printable, shortened to `max_length`, in quotation marks."""
    printable = "".join(letter if letter.isprintable() else "?" for letter in text)
    shortened = printable if len(printable) <= max_length else printable[:max_length] + "..."
    return repr(shortened).replace("\\", "")


def convert_to_integers(values: npt.NDArray[np.float64], source: Source, field: str) -> npt.NDArray[np.int64]:
    """Convert numbers to integers. Raises CloudFileError for a value that is not an integer, or is too large.

    source, field: file and part of the file, for the message.
    """
    with np.errstate(invalid="ignore"):
        result = values.astype(np.int64)
    if not np.array_equal(result, values):
        source.fail(field, "integers", "other numbers", "correct it")
    return result
