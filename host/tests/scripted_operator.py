"""Operator for tests, with prepared answers."""

from collections.abc import Callable, Iterable

from taxel_tools.testing.errors import OperatorNeededError


class ScriptedOperator:
    """An operator with prepared serial numbers.

    `on_prompt` is called with each instruction, so that a test can do what an operator would do. `texts`: all questions
    and instructions, in order.
    """

    def __init__(self, serial_numbers: Iterable[str] = (), on_prompt: Callable[[str], None] | None = None) -> None:
        self._serial_numbers = iter(serial_numbers)
        self._on_prompt = on_prompt
        self.texts: list[str] = []

    def read_serial_number(self) -> str:
        """Return the next prepared serial number. Raises OperatorNeededError if there is none left."""
        self.texts.append("serial number")
        try:
            return next(self._serial_numbers)
        except StopIteration:
            raise OperatorNeededError("serial number") from None

    def prompt(self, text: str) -> None:
        """Store the instruction and call `on_prompt`."""
        self.texts.append(text)
        if self._on_prompt is not None:
            self._on_prompt(text)
