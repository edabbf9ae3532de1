"""Errors of a calibration; each message is one line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn

from taxel.errors import FieldError
from taxel.hand.errors import Field

__all__ = ["CalibrationError", "CalibrationField"]


class CalibrationError(FieldError, ValueError):
    """Invalid or unreadable calibration."""


@dataclass(frozen=True)
class CalibrationField(Field):
    """Location of a field in a calibration file, for error messages."""

    def key(self, name: str) -> CalibrationField:
        """Return the location of a key of this table in the calibration file."""
        return CalibrationField(self.file, super().key(name).path)

    def item(self, index: int) -> CalibrationField:
        """Return the location of an element of this list in the calibration file."""
        return CalibrationField(self.file, super().item(index).path)

    def fail(self, expected: str, found: str, remedy: str) -> NoReturn:
        """Raise CalibrationError for this field of the calibration file."""
        raise CalibrationError(self.file, self.path or "file", expected, found, remedy)

    def __str__(self) -> str:
        """Format the location as "file: path of the field"."""
        return f"{self.file}: {self.path}" if self.path else self.file
