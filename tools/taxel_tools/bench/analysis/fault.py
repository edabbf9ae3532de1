"""Named faults and their places."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Final

from taxel.hand import BoardKind
from taxel.types import ByteArray


class Axis(IntEnum):
    """The two directions of lines of a board."""

    TX = 0
    RX = 1


BOARD: Final = "board"
"""Place of a fault of the whole board."""


@dataclass(frozen=True)
class Fault:
    """A fault of a board.

    `name`: such as "open line"; `place`: such as "TX 3", "taxel 17", "board"; `text`: measured evidence and the part to
    inspect; `severity`: factor beyond the limit.
    """

    name: str
    place: str
    text: str
    severity: float


def get_lines_of_taxels(kind: BoardKind, axis: Axis) -> ByteArray:
    """Return the number of the TX or RX line (`axis`) of each taxel of a board, u8[taxels]."""
    return kind.tx if axis is Axis.TX else kind.rx


def compute_severity_below(share: float, limit: float) -> float:
    """Compute the severity of a value below its lower limit: limit divided by value.

    share: the value. Returns infinity for a value of 0 or less.
    """
    return float("inf") if share <= 0.0 else limit / share


def format_line_name(axis: Axis, index: int) -> str:
    """Format the name of a line, such as "TX 3"."""
    return f"{axis.name} {index}"


def format_line_pair_name(axis: Axis, first: int, second: int) -> str:
    """Format the names of two lines with the lower number first, such as "TX 3 and TX 4"."""
    low, high = sorted((first, second))
    return f"{format_line_name(axis, low)} and {format_line_name(axis, high)}"


def format_connector_pin(axis: Axis, index: int, tx_count: int) -> str:
    """Format the connector pin of a line, such as "J1 pin 5".

    TX lines come first on the connector, then RX lines (docs/assumptions.md).
    """
    pin = 1 + index + (tx_count if axis is Axis.RX else 0)
    return f"J1 pin {pin}"


def format_taxel_name(taxel: int) -> str:
    """Format the name of a taxel, such as "taxel 17"."""
    return f"taxel {taxel}"
