"""A talk with a board as a generator: it yields transfers and pauses, and is handed what was read.

A generator does not know which wire it runs over, nor that others run beside it. A transfer that fails is thrown into
it as a `TransferError`.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import TypeAlias, TypeVar

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


Steps: TypeAlias = Generator[Transfer | Pause, bytes, T]
Clock: TypeAlias = Callable[[], float]
