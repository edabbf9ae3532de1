"""What can be wrong with a file that is to be imported: each mistake prints as one line and carries its data."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NoReturn

from taxel.errors import FieldError
from taxel.hand.errors import format_path, format_value

__all__ = ["ImportDataError", "Source", "near_names"]

_NEAR = 3
_NEAR_CHARACTERS = 64


class ImportDataError(FieldError, ValueError):
    """A file that cannot be turned into a grasp dataset; field: such as ``line 7, column fx``."""


@dataclass(frozen=True)
class Source:
    """A place in a file that is imported: where an error points."""

    file: str
    field: str = "file"

    def at(self, line: int, column: str = "") -> Source:
        """A line, and a column, of a CSV file."""
        return Source(self.file, f"line {line}, column {format_path(column)}" if column else f"line {line}")

    def key(self, name: str) -> Source:
        """A named part of the file."""
        bare = format_path(name) if len(name) <= _NEAR_CHARACTERS else format_value(name)
        return Source(self.file, bare if self.field == "file" else f"{self.field}.{bare}")

    def fail(self, expected: str, found: str, remedy: str) -> NoReturn:
        """Raise ImportDataError for this place."""
        raise ImportDataError(format_path(self.file), self.field, expected, found, remedy)


def near_names(name: str, known: Iterable[str]) -> str:
    """What to write instead of an unknown name: close matches, else all that are known, as part of a remedy."""
    names = list(known)
    near = difflib.get_close_matches(name[:_NEAR_CHARACTERS], names, n=_NEAR, cutoff=0.5)
    if near:
        return f"did you mean {' or '.join(near)}?"
    more = ", ..." if len(names) > 2 * _NEAR else ""
    return f"known are {', '.join(names[: 2 * _NEAR])}{more}" if names else "there are none"
