"""What can be wrong with two datasets that are to be compared."""

from taxel.errors import TaxelError, fit_line


class GapInputError(TaxelError, ValueError):
    """Two datasets, a report or an option that the diagnosis cannot use; one line: what, expected, found, remedy.

    Attributes: where (file or option, and field), expected, found, remedy.
    """

    def __init__(self, where: str, expected: str, found: str, remedy: str) -> None:
        super().__init__(where, expected, found, remedy)
        self.where, self.expected, self.found, self.remedy = where, expected, found, remedy

    def __str__(self) -> str:
        expected, found, remedy = map(fit_line, (self.expected, self.found, self.remedy))
        return f"{fit_line(self.where, 1000)}: expected {expected}, found {found}; {remedy}"
