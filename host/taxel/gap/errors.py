"""Exception for datasets, reports and options that the diagnosis of the gap cannot use."""

from taxel.errors import TaxelError, fit_line


class GapInputError(TaxelError, ValueError):
    """A dataset, a report or an option that the diagnosis cannot use; the message is one line.

    Attributes:
        where: the file or option, and the field.
        expected, found: the permitted content and the actual content.
        remedy: the action of the user that corrects the error.
    """

    def __init__(self, where: str, expected: str, found: str, remedy: str) -> None:
        super().__init__(where, expected, found, remedy)
        self.where, self.expected, self.found, self.remedy = where, expected, found, remedy

    def _format_message(self) -> str:
        expected, found, remedy = map(fit_line, (self.expected, self.found, self.remedy))
        return f"{fit_line(self.where, 1000)}: expected {expected}, found {found}; {remedy}"
