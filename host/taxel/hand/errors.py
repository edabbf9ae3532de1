"""Errors of the hand package; each message is one line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NoReturn

from taxel.errors import FieldError, TaxelError

_MAX_VALUE_LENGTH = 60
"""Largest number of characters of a value in an error message."""


class HandDescriptionError(FieldError, ValueError):
    """Invalid or unreadable hand description."""


class UnknownBoardError(TaxelError, LookupError):
    """Error: the hand has no board with the requested address or name.

    Attributes:
        hand: name of the hand description.
        board: the requested address or name, as text.
        expected_boards: addresses or names of the boards of the hand.
    """

    def __init__(self, hand: str, board: str, expected_boards: Sequence[str]) -> None:
        """Create the error for a board that the hand does not have.

        hand: name of the hand description. board: requested address or name. expected_boards: addresses or names of the
        boards that the hand has.
        """
        super().__init__(hand, board, tuple(expected_boards))
        self.hand = hand
        self.board = board
        self.expected_boards = tuple(expected_boards)

    def _format_message(self) -> str:
        return f"hand {self.hand!r} has no board {self.board}; expected one of {', '.join(self.expected_boards)}"


class UnknownBranchError(TaxelError, LookupError):
    """Error: no board of the hand has the requested branch.

    Attributes:
        hand: name of the hand description.
        branch: the requested branch.
        expected_branches: branches of the hand.
    """

    def __init__(self, hand: str, branch: str, expected_branches: Sequence[str]) -> None:
        """Create the error for a branch that the hand does not have."""
        super().__init__(hand, branch, tuple(expected_branches))
        self.hand = hand
        self.branch = branch
        self.expected_branches = tuple(expected_branches)

    def _format_message(self) -> str:
        """Format the error as one line with the names of the hand's branches, or with how to add branches."""
        remedy = f"expected one of {', '.join(self.expected_branches)}"
        if not self.expected_branches:
            remedy = 'add branch = "..." to the boards of the hand description'
        return f"hand {self.hand!r} has no branch {self.branch!r}; {remedy}"


class HandGeometryError(TaxelError, ValueError):
    """Error: taxel positions are required, but the hand description contains none.

    Attributes:
        hand: name of the hand description.
    """

    def __init__(self, hand: str) -> None:
        """Create the error for a hand description without geometry; hand: its name."""
        super().__init__(hand)
        self.hand = hand

    def _format_message(self) -> str:
        return f"hand {self.hand!r}: the description contains no taxel positions; add robot, [geometry] and board links"


class UnknownLinkError(TaxelError, LookupError):
    """Error: the robot has no link with the requested name.

    Attributes:
        robot: name of the robot.
        link_name: the requested link.
        expected_links: links of the robot.
    """

    def __init__(self, robot: str, link_name: str, expected_links: Sequence[str]) -> None:
        """Create the error for a link that the robot does not have; expected_links: names of the links of the robot."""
        super().__init__(robot, link_name, tuple(expected_links))
        self.robot = robot
        self.link_name = link_name
        self.expected_links = tuple(expected_links)

    def _format_message(self) -> str:
        return f"robot {self.robot!r} has no link {self.link_name!r}; expected one of {', '.join(self.expected_links)}"


@dataclass(frozen=True)
class Field:
    """Position of a field in a description file, for error messages."""

    file: str
    path: str = ""

    def key(self, name: str) -> Field:
        """Return the position of the key `name` in this table of a description file, for error messages."""
        key = name if name.isidentifier() and len(name) <= _MAX_VALUE_LENGTH else format_value(name)
        return Field(self.file, f"{self.path}.{key}" if self.path else key)

    def item(self, index: int) -> Field:
        """Return the position of the element `index` of this list of a description file, for error messages."""
        return Field(self.file, f"{self.path}[{index}]")

    def fail(self, expected: str, found: str, remedy: str) -> NoReturn:
        """Raise HandDescriptionError for this field of a description file."""
        raise HandDescriptionError(self.file, self.path or "file", expected, found, remedy)


def format_value(value: object) -> str:
    """Format a value of an untrusted file as a short printable string."""
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list):
        return "a list"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int) and value.bit_length() > 64:  # str() raises for integers with many digits
        return f"an integer of {value.bit_length()} bits"
    text = repr(value)
    return text if len(text) <= _MAX_VALUE_LENGTH else f"{text[: _MAX_VALUE_LENGTH - 3]}..."


def format_path(path: object) -> str:
    """Format a file name for an error message; quoted if it contains unprintable characters."""
    text = str(path)
    return text if text.isprintable() and text else repr(text)


def format_address(address: int) -> str:
    """Format an I2C address in hexadecimal (0x20); other values as `format_value`."""
    return f"0x{address:02X}" if 0 <= address <= 0xFF else format_value(address)
