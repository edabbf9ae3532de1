"""Connections to the bus of boards: an I2C adapter, or the hub's I2C pass-through."""

from __future__ import annotations

import errno
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Final, Protocol

from taxel.link import Link
from taxel.optional import optional_import
from taxel_tools.errors import LostError, NackError, TransferError, WireError
from taxel_tools.hub_queue import HubQueue
from taxel_tools.procedure import Transfer

if TYPE_CHECKING:
    from smbus2 import i2c_msg

CompletedTransfer = tuple[int, bytes | TransferError]
"""Number of a transfer, and the bytes read or the error."""

WAIT_MIN_S: Final = 1e-6
"""Shortest wait: a shorter time could be lost in rounding, and virtual time would not advance."""

_NACK_ERRNOS: Final = {errno.ENXIO, errno.EREMOTEIO}
_LOST_ERRNOS: Final = {errno.EAGAIN, errno.EIO, errno.ETIMEDOUT, errno.EBUSY}


class BoardWire(Protocol):
    """A bus of boards. `name`: name in messages; `is_queued`: several transfers may be in flight."""

    name: str
    is_queued: bool

    def now_s(self) -> float:
        """Return the time of this bus's clock in seconds."""
        ...

    def submit(self, transfer: Transfer) -> int:
        """Start an I2C transfer after the transfers started earlier. Returns the number of the transfer."""
        ...

    def collect(self, timeout_s: float) -> list[CompletedTransfer]:
        """Return the ended I2C transfers as (number, read bytes or error); waits at most `timeout_s` for the first.

        Raises `WireError`, `LinkError`.
        """
        ...

    def scan(self) -> list[int]:
        """List every I2C address that a device acknowledges."""
        ...

    def close(self) -> None:
        """Close the port of the bus. May be called twice."""
        ...


class SmbusBus(Protocol):
    """The methods of `smbus2.SMBus` that this package uses."""

    def i2c_rdwr(self, *i2c_msgs: i2c_msg) -> None:
        """Run the messages of one I2C transfer."""
        ...

    def close(self) -> None:
        """Close the I2C adapter."""
        ...


class SmbusWire:
    """A Linux I2C adapter, or any object with the interface of `smbus2.SMBus`."""

    is_queued = False

    def __init__(
        self,
        bus: SmbusBus,
        name: str,
        now_s: Callable[[], float] = time.monotonic,
        wait: Callable[[float], None] = time.sleep,
    ) -> None:
        """Create the access to boards through an I2C adapter.

        bus: open adapter. name: for messages. now_s, wait: clock and pause in s, replaced by virtual time in an
        emulation.
        """
        self.name = name
        self._bus = bus
        self._now_s = now_s
        self._wait = wait
        self._number = 0
        self._completed: list[CompletedTransfer] = []

    def now_s(self) -> float:
        """Return the time of the adapter's clock in seconds."""
        return self._now_s()

    def submit(self, transfer: Transfer) -> int:
        """Run an I2C transfer on the adapter immediately, and store its result. Returns the number of the transfer."""
        self._number += 1
        self._completed.append((self._number, self._run_transfer(transfer)))
        return self._number

    def _run_transfer(self, transfer: Transfer) -> bytes | TransferError:
        """Run a transfer on the adapter.

        Returns the bytes read (b"" for a pure write), or the error of the device. Raises `WireError` if the adapter
        fails.
        """
        with optional_import("smbus2", f"the I2C adapter {self.name}"):
            from smbus2 import i2c_msg
        # A transfer without data writes 0 bytes: only the address is sent, and the device acknowledges it.
        messages = [i2c_msg.write(transfer.address, transfer.write)] if transfer.write or not transfer.read_size else []
        read = i2c_msg.read(transfer.address, transfer.read_size)
        try:
            self._bus.i2c_rdwr(*messages, *([read] if transfer.read_size else []))
        except OSError as error:
            if error.errno in _NACK_ERRNOS:
                return NackError(transfer.address, f"does not acknowledge on {self.name}")
            if error.errno in _LOST_ERRNOS:
                return LostError(transfer.address, f"a transfer failed on {self.name} ({error.strerror})")
            raise WireError(self.name, f"{error.strerror}; check the adapter and its driver") from None
        return bytes(read) if transfer.read_size else b""

    def collect(self, timeout_s: float) -> list[CompletedTransfer]:
        """Return the ended I2C transfers as (number, read bytes or error).

        If there are none, the method first waits for `timeout_s` seconds.
        """
        if not self._completed:
            self._wait(max(timeout_s, WAIT_MIN_S))
        completed, self._completed = self._completed, []
        return completed

    def scan(self) -> list[int]:
        """List every I2C address that acknowledges an empty write."""
        return [address for address in range(0x08, 0x78) if self._run_transfer(Transfer(address)) == b""]

    def close(self) -> None:
        """Close the I2C adapter."""
        self._bus.close()


class HubWire:
    """Command I2C_TRANSFER over the hub's UART, with several commands in flight."""

    is_queued = True

    def __init__(self, link: Link) -> None:
        """Create the access to boards through the hub: make a handshake over the UART `link` and stop the stream of
        frames.
        """
        self.name = link.name
        self.hub = HubQueue(link)
        try:
            self.hub.handshake()
            self.hub.stop()
        except BaseException:
            self.close()
            raise

    def now_s(self) -> float:
        """Return the time of the link's clock in seconds."""
        return self.hub.now_s()

    def submit(self, transfer: Transfer) -> int:
        """Queue an I2C transfer through the hub; it is sent once the hub has space in its receive buffer."""
        return self.hub.submit(transfer)

    def collect(self, timeout_s: float) -> list[CompletedTransfer]:
        """Return the ended I2C transfers as (number, read bytes or error); waits at most `timeout_s` for the first."""
        return self.hub.collect(timeout_s)

    def scan(self) -> list[int]:
        """List every I2C address that acknowledges in the hub's bus scan."""
        return self.hub.scan_bus()

    def close(self) -> None:
        """Stop reading from the hub and close the link."""
        self.hub.stream.close()
