"""What can be wrong with a calibration: each mistake prints as one line and carries its data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn

from taxel.errors import FieldError
from taxel.hand.errors import Field

__all__ = ["CalibrationError", "Place"]


class CalibrationError(FieldError, ValueError):
    """A calibration that cannot be used."""


@dataclass(frozen=True)
class Place(Field):
    """A place in a calibration: where an error points."""

    def key(self, name: str) -> Place:
        """The place of a key below this one."""
        return Place(self.file, super().key(name).path)

    def item(self, index: int) -> Place:
        """The place of an element of the list that stands here."""
        return Place(self.file, super().item(index).path)

    def fail(self, expected: str, found: str, remedy: str) -> NoReturn:
        """Raise CalibrationError for this place."""
        raise CalibrationError(self.file, self.path or "file", expected, found, remedy)

    def __str__(self) -> str:
        return f"{self.file}: {self.path}" if self.path else self.file
