"""Errors of the twin."""

from taxel.errors import TaxelError


class TwinInputError(TaxelError):
    """A schedule or a reference of the twin that cannot be used; the message is one line with the place and the
    action.
    """

    def __init__(self, place: str, expected: str, found: str, action: str) -> None:
        """Create the error. place: file and field. expected, found: required and actual content of the field."""
        super().__init__(place, expected, found, action)

    def _format_message(self) -> str:
        """Format the error as one line."""
        place, expected, found, action = self.args
        return f"{place}: expected {expected}, found {found}; {action}"
