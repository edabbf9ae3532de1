"""What can be wrong with two datasets that are to be compared."""

from taxel.errors import TaxelError


class GapInputError(TaxelError, ValueError):
    """Two datasets, a report or an option that the diagnosis cannot use; one line: what, expected, found, remedy.

    Attributes: where (file or option, and field), expected, found, remedy.
    """

    def __init__(self, where: str, expected: str, found: str, remedy: str) -> None:
        super().__init__(where, expected, found, remedy)
        self.where, self.expected, self.found, self.remedy = where, expected, found, remedy

    def __str__(self) -> str:
        return f"{self.where}: expected {self.expected}, found {self.found}; {self.remedy}"
