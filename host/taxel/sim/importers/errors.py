"""Errors of imported files: one line with the file, the location, the expected and the found content."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NoReturn

from taxel.errors import FieldError
from taxel.hand.errors import format_path, format_value

__all__ = ["FileLocation", "ImportDataError", "suggest_names"]

_MAX_SUGGESTIONS = 3
_MAX_CHARACTERS = 64
"""Longer names are compared by their beginning only, because the comparison takes quadratic time."""


class ImportDataError(FieldError, ValueError):
    """Error: a file cannot be imported. field: the location in the file, such as ``line 7, column fx``."""


@dataclass(frozen=True)
class FileLocation:
    """A location in an imported file, for errors. field: "file" for the whole file."""

    file: str
    field: str = "file"

    def at(self, line: int, column: str = "") -> FileLocation:
        """Return the location of a line of a CSV file, and optionally a column, for an error message."""
        return FileLocation(self.file, f"line {line}, column {format_path(column)}" if column else f"line {line}")

    def key(self, name: str) -> FileLocation:
        """Return the location of a named part of the file, such as a key or an array, for error messages."""
        text = format_path(name) if len(name) <= _MAX_CHARACTERS else format_value(name)
        return FileLocation(self.file, text if self.field == "file" else f"{self.field}.{text}")

    def fail(self, expected: str, found: str, remedy: str) -> NoReturn:
        """Raise ImportDataError for this location in an imported file."""
        raise ImportDataError(format_path(self.file), self.field, expected, found, remedy)


def suggest_names(name: str, known: Iterable[str]) -> str:
    """Return the remedy for an unknown name: a question with the most similar known names, else some known names."""
    names = list(known)
    similar = difflib.get_close_matches(name[:_MAX_CHARACTERS], names, n=_MAX_SUGGESTIONS, cutoff=0.5)
    if similar:
        return f"did you mean {' or '.join(similar)}?"
    listed = names[: 2 * _MAX_SUGGESTIONS]
    ellipsis = ", ..." if len(names) > len(listed) else ""
    return f"known names: {', '.join(listed)}{ellipsis}" if names else "there are no such names"
