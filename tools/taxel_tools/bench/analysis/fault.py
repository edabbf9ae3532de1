"""Named faults and their places."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.hand import BoardKind


class Axis(IntEnum):
    """The two kinds of lines of a board."""

    TX = 0
    RX = 1


BOARD: Final = "board"
"""The place of what is wrong with a whole board."""


@dataclass(frozen=True)
class Fault:
    """Something that is wrong with a board.

    `name`: such as "open line"; `place`: such as "TX 3", "taxel 17", "board"; `text`: what was seen and where to look;
    `severity`: how many times beyond the limit.
    """

    name: str
    place: str
    text: str
    severity: float


def lines_of(kind: BoardKind, axis: Axis) -> NDArray[np.uint8]:
    """Line of each taxel, u8[taxels]."""
    return kind.tx if axis is Axis.TX else kind.rx


def severity_below(share: float, least: float) -> float:
    """How many times below its lower limit a share is; infinite for nothing at all."""
    return float("inf") if share <= 0.0 else least / share


def line_name(axis: Axis, index: int) -> str:
    """TX 3."""
    return f"{axis.name} {index}"


def lines_name(axis: Axis, first: int, second: int) -> str:
    """TX 3 and TX 4, the lower one first."""
    low, high = sorted((first, second))
    return f"{line_name(axis, low)} and {line_name(axis, high)}"


def joint(axis: Axis, index: int, tx_count: int) -> str:
    """Where a line is soldered. TX lines come first on the board's connector, then RX lines (docs/assumptions.md)."""
    pin = 1 + index + (tx_count if axis is Axis.RX else 0)
    return f"J1 pin {pin}"


def taxel_name(taxel: int) -> str:
    """Taxel 17."""
    return f"taxel {taxel}"
