"""What can be wrong with a calibration: each mistake prints as one line and carries its data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn

from taxel.errors import TaxelError
from taxel.hand.errors import Field

__all__ = ["CalibrationError", "Place"]


class CalibrationError(TaxelError, ValueError):
    """A calibration that cannot be used.

    Prints as ``file: field: expected ..., found ...; what to do`` on one line.

    Attributes:
        file: the file, or what was called where there is none.
        field: path of the field, such as ``objects[1].points``, or ``file`` where the whole file is meant.
        expected: what should stand there.
        found: what stands there.
        remedy: what to do about it.
    """

    def __init__(self, file: str, field: str, expected: str, found: str, remedy: str) -> None:
        # All five are args, so that the error survives pickling between processes.
        super().__init__(file, field, expected, found, remedy)
        self.file = file
        self.field = field
        self.expected = expected
        self.found = found
        self.remedy = remedy

    def __str__(self) -> str:
        return f"{self.file}: {self.field}: expected {self.expected}, found {self.found}; {self.remedy}"


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
