"""Named arrays of an imported file, and the errors of their use."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from taxel.hand.errors import format_value
from taxel.recording.grasp_checks import Location
from taxel.recording.grasp_format import LARGEST_ARRAY_BYTES

NUMBERS: Final = "iufb"
"""NumPy kinds of numbers: integers, unsigned integers, floating-point numbers, booleans."""

_SUGGESTIONS: Final = 3
_LISTED: Final = 8


@dataclass(frozen=True)
class Field:
    """A named array of a file.

    Attributes:
        name: name in the file.
        shape: shape of the array; the first axis is the frame, except for positions.
        dtype: name of the NumPy type, such as "float64"; "text" for strings.
        load: function that reads and returns the array; raises DatasetError.
    """

    name: str
    shape: tuple[int, ...]
    dtype: str
    load: Callable[[], NDArray[Any]]

    @property
    def is_numeric(self) -> bool:
        """Whether the array contains numbers."""
        return self.dtype != "text"


@dataclass(frozen=True)
class Source:
    """A file, or a folder of a known layout, as named arrays.

    path: the file. kind: type of the file for error messages, such as "CSV table". fields: arrays by name, in the order
    of the file. is_table: whether the fields are columns of one table.
    """

    path: Path
    kind: str
    fields: Mapping[str, Field]
    is_table: bool = False

    @property
    def location(self) -> Location:
        """Location of the file for error messages."""
        return Location(str(self.path))

    def at(self, name: str) -> Location:
        """Location of a field for error messages."""
        return self.location.key(name.lstrip("/"))

    def find(self, name: str) -> Field:
        """Return the field of a name. Raises DatasetError for an unknown name; the message suggests similar names."""
        if name not in self.fields:
            remedy = suggest_names(name, self.fields)
            self.at(name).fail(f"a field of the {self.kind}", "none of this name", remedy)
        return self.fields[name]

    def read(self, name: str) -> NDArray[Any]:
        """Read a field of any type. Raises DatasetError."""
        return self.find(name).load()

    def read_numbers(self, name: str) -> NDArray[Any]:
        """Read a numeric field. Raises DatasetError for a text or another type."""
        array = self.read(name)
        if array.dtype.kind not in NUMBERS:
            found = format_value(find_text(array))
            remedy = "correct that entry, or choose another field"
            self.at(name).fail("an array of numbers", found, remedy)
        return array


def find_text(array: NDArray[Any]) -> str:
    """Return the first entry that is not a number, as a string, such as "n/a"; the array's type if there is none.

    Only the first 100,000 entries are examined.
    """
    for entry in array.ravel()[:100_000]:
        try:
            float(entry)
        except (TypeError, ValueError):
            return str(entry)
    return f"type {array.dtype}"


def suggest_names(name: str, known: Iterable[str]) -> str:
    """Return the remedy in the message about an unknown name: the most similar known names, else some known names."""
    names = list(known)
    similar = difflib.get_close_matches(name[:64], names, n=_SUGGESTIONS, cutoff=0.5)
    if similar:
        return f"use {' or '.join(similar)}"
    listed = ", ".join(names[:_LISTED]) + (", ..." if len(names) > _LISTED else "")
    return f"use one of {listed}" if names else "the file has no fields; check the file"


def check_size(shape: tuple[int, ...], itemsize: int, location: Location) -> None:
    """Raise DatasetError for an array that exceeds the size limit of the dataset format.

    itemsize: bytes of an element; it is taken as at least 8, the size after the conversion to float64.
    """
    if prod(shape) * max(itemsize, 8) > LARGEST_ARRAY_BYTES:
        location.fail(f"at most {LARGEST_ARRAY_BYTES // 8} numbers", str(prod(shape)), "divide the file")


def make_field(name: str, array: NDArray[Any]) -> Field:
    """Return a field for an array that is already in memory."""
    is_numeric = array.dtype.kind in NUMBERS
    return Field(name, array.shape, str(array.dtype) if is_numeric else "text", lambda: np.asarray(array))
