"""Errors of the test framework. Each prints as one line and stores its data."""

from taxel.errors import FieldError, TaxelError, fit_line


class FatalTestError(TaxelError):
    """Error of a phase that makes the remaining phases meaningless. One line: the problem and the remedy."""


class OperatorNeededError(TaxelError):
    """An instruction or a question without an operator to answer. `question`: its text."""

    def __init__(self, question: str) -> None:
        """Create the error of a question to an operator while there is none."""
        super().__init__(question)
        self.question = question

    def _format_message(self) -> str:
        return f"no operator to answer '{self.question}'; run the test at a terminal, or without this phase"


class SerialNumberError(TaxelError, ValueError):
    """A serial number that the plan does not allow. `found`: the number; `expected`: description of a valid one."""

    def __init__(self, found: str, expected: str) -> None:
        """Create the error of a serial number that the test plan does not allow."""
        super().__init__(found, expected)
        self.found = found
        self.expected = expected

    def _format_message(self) -> str:
        return f"serial number: expected {self.expected}, found {self.found}; read the label again"


class ResultFileError(FieldError, ValueError):
    """A result file that cannot be read or written; `field` is the position in the file."""


class HistoryError(TaxelError):
    """A history that cannot be used. `path`: its file; `problem`: the problem and the remedy."""

    def __init__(self, path: str, problem: str) -> None:
        """Create the error of a file with earlier test results that cannot be used."""
        super().__init__(path, problem)
        self.path = path
        self.problem = problem

    def _format_message(self) -> str:
        return f"{fit_line(self.path, 1000)}: {fit_line(self.problem)}"
