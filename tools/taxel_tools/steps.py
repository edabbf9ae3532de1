"""A talk with a board as a generator: it yields transfers and pauses, and is handed what was read.

A generator does not know which wire it runs over, nor that others run beside it. A transfer that fails is thrown into
it as a `TransferError`; what came of a burst is in the burst.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from typing import TypeAlias, TypeVar

from taxel_tools.errors import TransferError

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Transfer:
    """One I2C transfer: write, then read after a repeated start; at most 64 bytes each."""

    address: int
    write: bytes = b""
    read_size: int = 0


@dataclass(frozen=True, slots=True)
class Pause:
    """So many seconds in which this board is left alone."""

    seconds: float


@dataclass(slots=True)
class Burst:
    """Transfers with one board that need not wait for each other's outcome.

    `outcomes`, of each what was read or its error, are there when the generator goes on. A wire without a queue makes
    one transfer after the other and ends with the first that fails; on any other wire those after it may be made too.
    """

    transfers: tuple[Transfer, ...]
    outcomes: list[bytes | TransferError] = field(default_factory=list)


Version: TypeAlias = tuple[int, int, int]
"""Major, minor, patch."""
Steps: TypeAlias = Generator[Transfer | Burst | Pause, bytes, T]
Clock: TypeAlias = Callable[[], float]
