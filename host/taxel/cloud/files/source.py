"""A file of points that is not trusted: its bytes, bounded, and one-line errors that name it."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NoReturn

import numpy as np
import numpy.typing as npt

from taxel.cloud.errors import CloudFileError

LARGEST_FILE: Final = 64 * 2**20
"""Bytes: more than a million triangles. A cloud of a campaign has less than one megabyte."""

LONGEST_HEADER: Final = 2**20
"""Bytes before the numbers begin."""

MOST_WORDS: Final = 8 * 2**20
"""Of a text: as pieces, each takes some fifty bytes."""


@dataclass(frozen=True)
class Source:
    """name: for messages. data: all bytes of the file."""

    name: str
    data: bytes

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> Source:
        """Read a file. Raises CloudFileError for one that is too large or empty, OSError if it cannot be read."""
        size = Path(path).stat().st_size
        source = cls(str(path), b"")
        if size > LARGEST_FILE:
            source.fail("file", f"at most {LARGEST_FILE} bytes", str(size), "thin it out")
        # A pipe or a device states no size: no more than the bound is read of it.
        with Path(path).open("rb") as file:
            data = file.read(LARGEST_FILE + 1)
        if not 0 < len(data) <= LARGEST_FILE:
            source.fail("file", f"1 to {LARGEST_FILE} bytes", str(len(data)), "use another file")
        return cls(str(path), data)

    def fail(self, field: str, expected: str, found: str, remedy: str) -> NoReturn:
        """Raise CloudFileError for a part of this file."""
        raise CloudFileError(self.name, field, expected, found, remedy)

    def text(self) -> str:
        """All of it as text; what is not ASCII cannot be a number and is found later."""
        return self.few_words(self.data.decode("latin-1"), "file")

    def few_words(self, text: str, field: str) -> str:
        """The text itself, if splitting it takes not too much memory."""
        breaks = sum(text.count(mark) for mark in " \t\n\r\v\f")
        if breaks > MOST_WORDS:
            self.fail(field, f"at most {MOST_WORDS} words", f"about {breaks}", "thin it out, or write it as binary")
        return text

    def numbers(self, text: str, field: str) -> npt.NDArray[np.float64]:
        """The numbers of a text, f64[k]. Fails for anything else in it."""
        words = self.few_words(text, field).split()
        try:
            return np.array(words, dtype=np.float64)
        except ValueError as error:
            self.fail(field, "numbers", shown(str(error).rpartition(":")[2].strip(" '")), "correct it")

    def table(self, text: str, columns: int, field: str) -> npt.NDArray[np.float64]:
        """Rows of numbers, f64[rows, columns]. Fails if they do not fill the rows."""
        numbers = self.numbers(text, field)
        if len(numbers) % columns:
            self.fail(field, f"rows of {columns} numbers", f"{len(numbers)} numbers", "correct it")
        return numbers.reshape(-1, columns)


def natural(word: str) -> int | None:
    """A whole number of at most 18 decimal digits, or None."""
    return int(word) if word.isascii() and word.isdecimal() and len(word) <= 18 else None


def shown(text: str, longest: int = 40) -> str:
    """A piece of a file for a message: printable, short."""
    clean = "".join(letter if letter.isprintable() else "?" for letter in text)
    return repr(clean if len(clean) <= longest else clean[:longest] + "...").replace("\\", "")


def whole(values: npt.NDArray[np.float64], source: Source, field: str) -> npt.NDArray[np.int64]:
    """Numbers as integers; fails where one is none, or far too large."""
    with np.errstate(invalid="ignore"):
        result = values.astype(np.int64)
    if not np.array_equal(result, values):
        source.fail(field, "whole numbers", "others", "correct it")
    return result
