"""Operator of a test station: enters serial numbers and follows instructions."""

from collections.abc import Callable
from typing import Protocol

from rich.console import Console

from taxel.errors import TaxelError
from taxel_tools.testing.errors import OperatorNeededError

__all__ = ["NoOperator", "Operator", "OperatorNeededError", "TerminalOperator"]


class Operator(Protocol):
    """A person at the test station. Every method raises `OperatorNeededError` if nobody can answer."""

    def read_serial_number(self) -> str:
        """Read the serial number of the device, without surrounding spaces."""

    def prompt(self, text: str) -> None:
        """Show an instruction to the operator and wait until it is done."""


class TerminalOperator:
    """A person at the terminal, or a bar-code reader that acts as a keyboard.

    `check_serial_number` raises a `TaxelError` for an invalid serial number; the question is then repeated.
    """

    def __init__(
        self, console: Console | None = None, check_serial_number: Callable[[str], None] | None = None
    ) -> None:
        """Create an operator who reads instructions and enters texts at a terminal.

        console: terminal; default: standard error. check_serial_number: raises an error for a serial number that is
        not allowed.
        """
        self._console = console or Console(stderr=True, soft_wrap=True)
        self._check_serial_number = check_serial_number

    def read_serial_number(self) -> str:
        """Read a serial number from the terminal; the question is repeated until the number is valid."""
        while True:
            serial_number = self._read_line("serial number: ")
            try:
                if serial_number and self._check_serial_number is not None:
                    self._check_serial_number(serial_number)
            except TaxelError as error:
                self._console.print(str(error), markup=False, highlight=False)
                continue
            if serial_number:
                return serial_number

    def prompt(self, text: str) -> None:
        """Show an instruction at the terminal and wait for Enter."""
        self._console.print(text, markup=False, highlight=False)
        self._read_line("press Enter when done ")

    def _read_line(self, question: str) -> str:
        """Read the answer of the operator to a question. Raises `OperatorNeededError` if the input has ended."""
        try:
            return self._console.input(question, markup=False).strip()
        except EOFError:
            raise OperatorNeededError(question.strip()) from None


class NoOperator:
    """No operator: a phase that needs one ends with one error line."""

    def read_serial_number(self) -> str:
        """Raise `OperatorNeededError`, as there is no operator."""
        raise OperatorNeededError("serial number")

    def prompt(self, text: str) -> None:
        """Raise `OperatorNeededError`, as there is no operator."""
        raise OperatorNeededError(text)
