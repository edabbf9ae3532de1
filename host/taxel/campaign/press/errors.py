"""What can go wrong with a press."""

from __future__ import annotations

from taxel.errors import TaxelError


class PressError(TaxelError):
    """A press that does not come to rest. `named` adds which one it was."""

    def __init__(self, what: str, press: str = "") -> None:
        super().__init__(what, press)

    def __str__(self) -> str:
        what, press = self.args
        where = f"press {press}" if press else "press"
        return f"{where}: the object {what}; press elsewhere, with less force, or with smaller offsets"

    def named(self, press: str) -> PressError:
        """The same of the press `press`."""
        return PressError(self.args[0], press)


class PressPlanError(TaxelError, ValueError):
    """Numbers from which no plan of presses can be drawn."""

    def __init__(self, field: str, expected: str, found: str) -> None:
        super().__init__(field, expected, found)

    def __str__(self) -> str:
        field, expected, found = self.args
        return f"press plan: {field}: expected {expected}, found {found}; correct it"
