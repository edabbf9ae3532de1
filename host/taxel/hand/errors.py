"""The errors of this room: each prints as one line and carries its data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NoReturn

from taxel.errors import FieldError, TaxelError

_MAX_SHOWN = 60  # characters of a found value that an error repeats; keeps the line readable


class HandDescriptionError(FieldError, ValueError):
    """A hand description that cannot be used."""


class UnknownBoardError(TaxelError, LookupError):
    """A board that the hand does not have.

    Attributes:
        hand: name of the hand description.
        board: the address or the name that was asked for, as text.
    """

    def __init__(self, hand: str, board: str, known: Sequence[str]) -> None:
        super().__init__(hand, board, tuple(known))
        self.hand = hand
        self.board = board
        self.known = tuple(known)

    def __str__(self) -> str:
        return f"hand {self.hand!r} has no board {self.board}; it has {', '.join(self.known)}"


class HandGeometryError(TaxelError, ValueError):
    """A hand whose description does not say where its taxels are, where somebody needs to know.

    Attributes:
        hand: name of the hand description.
    """

    def __init__(self, hand: str) -> None:
        super().__init__(hand)
        self.hand = hand

    def __str__(self) -> str:
        return f"hand {self.hand!r}: its description gives no taxel positions; add robot, [geometry] and links"


class UnknownLinkError(TaxelError, LookupError):
    """A link that the robot does not have.

    Attributes:
        robot: name of the robot.
        link: what was asked for.
    """

    def __init__(self, robot: str, link: str, known: Sequence[str]) -> None:
        super().__init__(robot, link, tuple(known))
        self.robot = robot
        self.link = link
        self.known = tuple(known)

    def __str__(self) -> str:
        return f"robot {self.robot!r} has no link {self.link!r}; it has {', '.join(self.known)}"


@dataclass(frozen=True)
class Field:
    """A place in a description file: where an error points."""

    file: str
    path: str = ""

    def key(self, name: str) -> Field:
        """The place of a key below this one."""
        bare = name if name.isidentifier() and len(name) <= _MAX_SHOWN else format_value(name)
        return Field(self.file, f"{self.path}.{bare}" if self.path else bare)

    def item(self, index: int) -> Field:
        """The place of an element of the list that stands here."""
        return Field(self.file, f"{self.path}[{index}]")

    def fail(self, expected: str, found: str, remedy: str) -> NoReturn:
        """Raise HandDescriptionError for this place."""
        raise HandDescriptionError(self.file, self.path or "file", expected, found, remedy)


def format_value(value: object) -> str:
    """A value found in a file, as one short printable piece of text; files are not trusted to be either."""
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list):
        return "a list"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int) and value.bit_length() > 64:  # Python refuses to print integers of many digits
        return f"an integer of {value.bit_length()} bits"
    text = repr(value)
    return text if len(text) <= _MAX_SHOWN else f"{text[: _MAX_SHOWN - 3]}..."


def format_path(path: object) -> str:
    """A file name for an error: as it is, or quoted where it holds a character that would break the line."""
    text = str(path)
    return text if text.isprintable() and text else repr(text)


def format_address(address: int) -> str:
    """An I2C address as people write it: 0x20. Anything that is no byte is shown plainly."""
    return f"0x{address:02X}" if 0 <= address <= 0xFF else format_value(address)
