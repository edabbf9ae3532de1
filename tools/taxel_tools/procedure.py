"""Exchanges with a board as generators: a generator yields transfers and pauses, and receives the bytes read.

A generator is independent of the connection and of other generators that share the bus. A failed transfer is raised
inside the generator as a `TransferError`; the outcomes of a burst are stored in the burst.
"""

from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from typing import TypeAlias, TypeVar

from taxel_tools.errors import TransferError

Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class Transfer:
    """One I2C transfer: a write, then a read after a repeated start; at most 64 bytes each."""

    address: int
    write: bytes = b""
    read_size: int = 0


@dataclass(frozen=True, slots=True)
class Pause:
    """A request to make no transfer to this board for a number of seconds."""

    seconds: float


@dataclass(slots=True)
class Burst:
    """Transfers with one board of which none depends on the outcome of an earlier one.

    `outcomes` holds, for each transfer, the bytes read or the error, once the generator continues. A bus without a
    queue runs the transfers in order and ends with the first failure; with a queue, later transfers may run as well.
    """

    transfers: tuple[Transfer, ...]
    outcomes: list[bytes | TransferError] = field(default_factory=list)


Version: TypeAlias = tuple[int, int, int]
"""Major, minor, patch."""
Procedure: TypeAlias = Generator[Transfer | Burst | Pause, bytes, Result]
Clock: TypeAlias = Callable[[], float]
