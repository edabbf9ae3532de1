"""The I2C bus of a virtual world, with the interface of `smbus2.SMBus`: code for `/dev/i2c-N` runs on it unchanged."""

from __future__ import annotations

import errno
import os
from collections.abc import Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Final, Self

from taxel.link.virtual.world import VirtualWorld

if TYPE_CHECKING:
    from smbus2 import i2c_msg

BLOCK_MAX: Final = 32
READ_FLAG: Final = 0x0001  # I2C_M_RD of linux/i2c.h

# What the i2c-dev adapters of the Raspberry Pi and of FTDI bridges answer (Documentation/i2c/fault-codes.rst of Linux).
_ERRORS: Final = {
    -1: errno.ENXIO,  # address not acknowledged
    -2: errno.EREMOTEIO,  # a byte not acknowledged
    -3: errno.EAGAIN,  # arbitration lost
    -4: errno.EIO,  # a start or stop where none belongs
    -5: errno.ETIMEDOUT,
    -6: errno.EBUSY,  # a line is held low
}


class VirtualSMBus:
    """An I2C adapter on the bus of `world`; it waits for the hub's stop as a second master does.

    .. warning::
        Not modelled: PEC, SMBus block reads whose length the slave tells, ten-bit addresses, a transfer with more
        than a write and a read of one address (refused with EOPNOTSUPP, as some adapters do).
    """

    def __init__(self, world: VirtualWorld) -> None:
        self._world = world
        self.fd: int | None = -1
        self.pec = 0

    def i2c_rdwr(self, *i2c_msgs: i2c_msg) -> None:
        """One transfer of a write, a read, or a read after a write with a repeated start between. Raises OSError."""
        reads = [bool(message.flags & READ_FLAG) for message in i2c_msgs]
        if reads not in ([False], [True], [False, True]) or len({message.addr for message in i2c_msgs}) != 1:
            raise OSError(errno.EOPNOTSUPP, os.strerror(errno.EOPNOTSUPP))
        write = b"" if reads[0] else bytes(i2c_msgs[0])
        size = i2c_msgs[-1].len if reads[-1] else 0
        data = self._transfer(i2c_msgs[0].addr, write, size)
        for place, value in enumerate(data):
            i2c_msgs[-1].buf[place] = bytes([value])

    def _transfer(self, address: int, write: bytes, read_size: int) -> bytes:
        result, data = self._world.transfer(address, write, read_size)
        if result:
            number = _ERRORS[result]
            raise OSError(number, os.strerror(number))
        return data

    def write_quick(self, i2c_addr: int, force: bool | None = None) -> None:
        """Address a device for writing and stop."""
        self._transfer(i2c_addr, b"", 0)

    def read_byte(self, i2c_addr: int, force: bool | None = None) -> int:
        """One byte from where the device's pointer stands."""
        return self._transfer(i2c_addr, b"", 1)[0]

    def write_byte(self, i2c_addr: int, value: int, force: bool | None = None) -> None:
        """One byte: for our boards, the register pointer."""
        self._transfer(i2c_addr, bytes([value]), 0)

    def read_byte_data(self, i2c_addr: int, register: int, force: bool | None = None) -> int:
        """One byte of a register."""
        return self._transfer(i2c_addr, bytes([register]), 1)[0]

    def write_byte_data(self, i2c_addr: int, register: int, value: int, force: bool | None = None) -> None:
        """One byte into a register."""
        self._transfer(i2c_addr, bytes([register, value]), 0)

    def read_word_data(self, i2c_addr: int, register: int, force: bool | None = None) -> int:
        """Two bytes of a register, little-endian."""
        return int.from_bytes(self._transfer(i2c_addr, bytes([register]), 2), "little")

    def write_word_data(self, i2c_addr: int, register: int, value: int, force: bool | None = None) -> None:
        """Two bytes into a register, little-endian."""
        self._transfer(i2c_addr, bytes([register]) + value.to_bytes(2, "little"), 0)

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int, force: bool | None = None) -> list[int]:
        """Up to 32 bytes from a register on."""
        _check_block(length)
        return list(self._transfer(i2c_addr, bytes([register]), length))

    def write_i2c_block_data(
        self, i2c_addr: int, register: int, data: Sequence[int], force: bool | None = None
    ) -> None:
        """Up to 32 bytes into a register."""
        _check_block(len(data))
        self._transfer(i2c_addr, bytes([register, *data]), 0)

    def close(self) -> None:
        """Let go of the adapter; the world is the caller's."""
        self.fd = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _check_block(length: int) -> None:
    if length > BLOCK_MAX:
        raise ValueError(f"Desired block length over {BLOCK_MAX} bytes")
