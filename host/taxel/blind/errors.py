"""Errors of a blind check's folder."""

from taxel.errors import TaxelError


class BlindRunError(TaxelError):
    """A folder or file that does not belong to this blind check, or a diagnosing process that ended."""

    def __init__(self, where: str, expected: str, found: str, remedy: str) -> None:
        """Create the error of a blind check.

        where: file or process. expected, found: required and actual content of this file, or output of this process.
        remedy: what the user can do.
        """
        super().__init__(where, expected, found, remedy)

    def _format_message(self) -> str:
        """Format the error as one line with the location, expected and found values, and the remedy."""
        where, expected, found, remedy = self.args
        return f"{where}: expected {expected}, found {found}; {remedy}"
