"""Where transfers go: an I2C adapter, or the hub's pass-through."""

from __future__ import annotations

import errno
import time
from collections.abc import Callable
from typing import Final, Protocol

from smbus2 import i2c_msg

from taxel.link import Link
from taxel_tools.errors import LostError, NackError, TransferError, WireError
from taxel_tools.hub_queue import HubQueue
from taxel_tools.procedure import Transfer

CompletedTransfer = tuple[int, bytes | TransferError]
"""A transfer's number, and what was read or what went wrong."""

GRAIN_S: Final = 1e-6
"""The least that is waited: less could be lost in rounding, and time would stand still."""

_NACKS: Final = {errno.ENXIO, errno.EREMOTEIO}
_AGAIN: Final = {errno.EAGAIN, errno.EIO, errno.ETIMEDOUT, errno.EBUSY}


class BoardWire(Protocol):
    """A bus of boards. `name` goes into messages; `is_queued`: several transfers may be under way at a time."""

    name: str
    is_queued: bool

    def now_s(self) -> float:
        """Seconds of the wire's own clock."""
        ...

    def submit(self, transfer: Transfer) -> int:
        """Begin a transfer, after those begun before; returns its number."""
        ...

    def collect(self, timeout_s: float) -> list[CompletedTransfer]:
        """Transfers that have ended; waits at most `timeout_s` for the first. Raises `WireError`, `LinkError`."""
        ...

    def scan(self) -> list[int]:
        """Every address that acknowledges."""
        ...

    def close(self) -> None:
        """Let go of the port. May be called twice."""
        ...


class SmbusBus(Protocol):
    """What this room needs of `smbus2.SMBus`."""

    def i2c_rdwr(self, *i2c_msgs: i2c_msg) -> None:
        """One transfer."""
        ...

    def close(self) -> None:
        """Let go of the device."""
        ...


class SmbusWire:
    """An I2C adapter of Linux, or anything with the interface of `smbus2.SMBus`."""

    is_queued = False

    def __init__(
        self,
        bus: SmbusBus,
        name: str,
        now_s: Callable[[], float] = time.monotonic,
        wait: Callable[[float], None] = time.sleep,
    ) -> None:
        self.name = name
        self._bus = bus
        self._now_s = now_s
        self._wait = wait
        self._number = 0
        self._ended: list[CompletedTransfer] = []

    def now_s(self) -> float:
        """Seconds of the adapter's clock."""
        return self._now_s()

    def submit(self, transfer: Transfer) -> int:
        """Make the transfer now."""
        self._number += 1
        self._ended.append((self._number, self._make(transfer)))
        return self._number

    def _make(self, transfer: Transfer) -> bytes | TransferError:
        messages = [i2c_msg.write(transfer.address, transfer.write)] if transfer.write or not transfer.read_size else []
        read = i2c_msg.read(transfer.address, transfer.read_size)
        try:
            self._bus.i2c_rdwr(*messages, *([read] if transfer.read_size else []))
        except OSError as error:
            if error.errno in _NACKS:
                return NackError(transfer.address, f"does not acknowledge on {self.name}")
            if error.errno in _AGAIN:
                return LostError(transfer.address, f"a transfer failed on {self.name} ({error.strerror})")
            raise WireError(self.name, f"{error.strerror}; check the adapter and its driver") from None
        return bytes(read) if transfer.read_size else b""

    def collect(self, timeout_s: float) -> list[CompletedTransfer]:
        """What has been made; waits if nothing has."""
        if not self._ended:
            self._wait(max(timeout_s, GRAIN_S))
        ended, self._ended = self._ended, []
        return ended

    def scan(self) -> list[int]:
        """Every address that acknowledges a write of nothing."""
        return [address for address in range(0x08, 0x78) if self._make(Transfer(address)) == b""]

    def close(self) -> None:
        """Let go of the adapter."""
        self._bus.close()


class HubWire:
    """The hub's I2C_TRANSFER over its UART: several commands are on their way at a time."""

    is_queued = True

    def __init__(self, link: Link) -> None:
        self.name = link.name
        self.hub = HubQueue(link)
        try:
            self.hub.handshake()
            self.hub.stop()
        except BaseException:
            self.close()
            raise

    def now_s(self) -> float:
        """Seconds of the link's clock."""
        return self.hub.now_s()

    def submit(self, transfer: Transfer) -> int:
        """Queue the transfer; it is sent as soon as the hub has room."""
        return self.hub.submit(transfer)

    def collect(self, timeout_s: float) -> list[CompletedTransfer]:
        """Replies that have come."""
        return self.hub.collect(timeout_s)

    def scan(self) -> list[int]:
        """Every address that acknowledges, by the hub's own sweep."""
        return self.hub.scan_bus()

    def close(self) -> None:
        """Stop reading and close the link."""
        self.hub.stream.close()
