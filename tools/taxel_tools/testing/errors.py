"""The errors of this room: each prints as one line and carries its data."""

from __future__ import annotations

from taxel.errors import FieldError, TaxelError


class FatalTestError(TaxelError):
    """Raised by a phase after which the others make no sense. Its text is one line: what and what to do."""


class OperatorNeededError(TaxelError):
    """Somebody was asked and nobody is there to answer. `question`: what was asked."""

    def __init__(self, question: str) -> None:
        super().__init__(question)
        self.question = question

    def __str__(self) -> str:
        return f"nobody is there to answer '{self.question}'; run the test at a terminal, or without this phase"


class SerialNumberError(TaxelError, ValueError):
    """A serial number that no board of the plan can have. `found`: what was given; `expected`: in words."""

    def __init__(self, found: str, expected: str) -> None:
        super().__init__(found, expected)
        self.found = found
        self.expected = expected

    def __str__(self) -> str:
        return f"serial number: expected {self.expected}, found {self.found}; read the label again"


class ResultFileError(FieldError, ValueError):
    """A result file that cannot be read or written; `field` is the place in it."""


class HistoryError(TaxelError):
    """A history that cannot be used. `path`: its file; `problem`: what and what to do."""

    def __init__(self, path: str, problem: str) -> None:
        super().__init__(path, problem)
        self.path = path
        self.problem = problem

    def __str__(self) -> str:
        return f"{self.path}: {self.problem}"
