"""Who stands at the bench: asked for a serial number, told what to do, asked whether it is so."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Protocol

from rich.console import Console

from taxel.errors import TaxelError
from taxel_tools.testing.errors import OperatorNeededError

__all__ = ["NoOperator", "Operator", "OperatorNeededError", "ScriptedOperator", "TerminalOperator"]

_ANSWERS = {"y": True, "yes": True, "n": False, "no": False}


class Operator(Protocol):
    """Somebody who answers. Every method raises `OperatorNeededError` where nobody does."""

    def ask_serial(self) -> str:
        """The serial number of the device, without spaces around it."""

    def prompt(self, text: str) -> None:
        """Tell what to do and wait until it is done."""

    def confirm(self, text: str) -> bool:
        """Ask what can be answered by yes or no."""


class TerminalOperator:
    """Somebody at the terminal, or a bar-code reader that types.

    check_serial: raises a `TaxelError` for a serial number that cannot be, after which it is asked for again.
    """

    def __init__(self, console: Console | None = None, check_serial: Callable[[str], None] | None = None) -> None:
        self._console = console or Console(stderr=True, soft_wrap=True)
        self._check_serial = check_serial

    def ask_serial(self) -> str:
        """Ask until there is one that can be."""
        while True:
            found = self._ask("serial number: ")
            try:
                if found and self._check_serial is not None:
                    self._check_serial(found)
            except TaxelError as error:
                self._console.print(str(error), markup=False, highlight=False)
                continue
            if found:
                return found

    def prompt(self, text: str) -> None:
        """Show the text and wait for Enter."""
        self._console.print(text, markup=False, highlight=False)
        self._ask("press Enter when done ")

    def confirm(self, text: str) -> bool:
        """Ask until the answer is yes or no."""
        while True:
            answer = _ANSWERS.get(self._ask(f"{text} (y/n) ").lower())
            if answer is not None:
                return answer

    def _ask(self, question: str) -> str:
        try:
            return self._console.input(question, markup=False).strip()
        except EOFError:
            raise OperatorNeededError(question.strip()) from None


class ScriptedOperator:
    """Answers that are known before: a text for each serial number, a truth for each confirmation, in their order.

    on_prompt: called with each prompt, which takes no answer; so a test presses where an operator would.
    `heard`: all that was said, in its order.
    """

    def __init__(self, answers: Iterable[str | bool], on_prompt: Callable[[str], None] | None = None) -> None:
        self._answers = iter(answers)
        self._on_prompt = on_prompt
        self.heard: list[str] = []

    def ask_serial(self) -> str:
        """The next answer."""
        return str(self._next("serial number"))

    def prompt(self, text: str) -> None:
        """Note it, and call `on_prompt`."""
        self.heard.append(text)
        if self._on_prompt is not None:
            self._on_prompt(text)

    def confirm(self, text: str) -> bool:
        """The next answer: a truth, or yes or no."""
        answer = self._next(text)
        return answer if isinstance(answer, bool) else _ANSWERS[answer.lower()]

    def _next(self, question: str) -> str | bool:
        self.heard.append(question)
        try:
            return next(self._answers)
        except StopIteration:
            raise OperatorNeededError(question) from None


class NoOperator:
    """Nobody. A phase that asks ends with an error of one line."""

    def ask_serial(self) -> str:
        """Raises `OperatorNeededError`."""
        raise OperatorNeededError("serial number")

    def prompt(self, text: str) -> None:
        """Raises `OperatorNeededError`."""
        raise OperatorNeededError(text)

    def confirm(self, text: str) -> bool:
        """Raises `OperatorNeededError`."""
        raise OperatorNeededError(text)
