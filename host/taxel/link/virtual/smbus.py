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

# Error numbers of the i2c-dev adapters of Raspberry Pi and FTDI bridges (Linux, Documentation/i2c/fault-codes.rst).
_ERRORS: Final = {
    -1: errno.ENXIO,  # address not acknowledged
    -2: errno.EREMOTEIO,  # a byte not acknowledged
    -3: errno.EAGAIN,  # arbitration lost
    -4: errno.EIO,  # a misplaced start or stop condition
    -5: errno.ETIMEDOUT,
    -6: errno.EBUSY,  # a line is held low
}


class VirtualSMBus:
    """An I2C adapter on the bus of an emulated world: a second master, which waits for the stop condition of the hub.

    .. warning::
        Not modelled: PEC, SMBus block reads with a length from the slave, ten-bit addresses, a transfer of more than
        one write and one read of one address (EOPNOTSUPP, as with some adapters).
    """

    def __init__(self, world: VirtualWorld, recovers: bool = False) -> None:
        """Connect an emulated I2C adapter to the bus of a virtual world, without packet error checking (pec = 0).

        recovers: whether the adapter's driver frees a held bus after a failed transfer, as many Linux drivers do.
        """
        self._world = world
        self._recovers = recovers
        self.fd: int | None = -1  # no file is open; None: closed, as in smbus2
        self.pec = 0

    def i2c_rdwr(self, *i2c_msgs: i2c_msg) -> None:
        """Transfer a write, a read, or a write and a read with a repeated start between them, on the emulated I2C bus.

        i2c_msgs: messages of smbus2 to one address; read bytes are stored in the last one. Raises OSError as Linux
        does.
        """
        reads = [bool(message.flags & READ_FLAG) for message in i2c_msgs]
        if reads not in ([False], [True], [False, True]) or len({message.addr for message in i2c_msgs}) != 1:
            raise OSError(errno.EOPNOTSUPP, os.strerror(errno.EOPNOTSUPP))
        write = b"" if reads[0] else bytes(i2c_msgs[0])
        size = i2c_msgs[-1].len if reads[-1] else 0
        data = self._transfer(i2c_msgs[0].addr, write, size)
        for index, value in enumerate(data):
            i2c_msgs[-1].buf[index] = bytes([value])

    def _transfer(self, address: int, write: bytes, read_size: int) -> bytes:
        """Write bytes to an I2C address, then read `read_size` bytes from it, in one transfer; return the read bytes.

        Raises OSError with the error number that Linux uses for this failure.
        """
        result, data = self._world.transfer(address, write, read_size)
        if result:
            number = _ERRORS[result]
            if self._recovers and number not in (errno.ENXIO, errno.EREMOTEIO):
                self._world.recover_bus()
            raise OSError(number, os.strerror(number))
        return data

    def write_quick(self, i2c_addr: int, force: bool | None = None) -> None:
        """Address a device on the emulated I2C bus for writing, then send a stop condition."""
        self._transfer(i2c_addr, b"", 0)

    def read_byte(self, i2c_addr: int, force: bool | None = None) -> int:
        """Read one byte of the device at an I2C address, at its present register pointer."""
        return self._transfer(i2c_addr, b"", 1)[0]

    def write_byte(self, i2c_addr: int, value: int, force: bool | None = None) -> None:
        """Write one byte to the device at an I2C address; on sensor boards it sets the register pointer."""
        self._transfer(i2c_addr, bytes([value]), 0)

    def read_byte_data(self, i2c_addr: int, register: int, force: bool | None = None) -> int:
        """Read one byte of a register of the device at an I2C address."""
        return self._transfer(i2c_addr, bytes([register]), 1)[0]

    def write_byte_data(self, i2c_addr: int, register: int, value: int, force: bool | None = None) -> None:
        """Write one byte to a register of the device at an I2C address."""
        self._transfer(i2c_addr, bytes([register, value]), 0)

    def read_word_data(self, i2c_addr: int, register: int, force: bool | None = None) -> int:
        """Read two bytes of a register of the device at an I2C address, little-endian."""
        return int.from_bytes(self._transfer(i2c_addr, bytes([register]), 2), "little")

    def write_word_data(self, i2c_addr: int, register: int, value: int, force: bool | None = None) -> None:
        """Write two bytes to a register of the device at an I2C address, little-endian."""
        self._transfer(i2c_addr, bytes([register]) + value.to_bytes(2, "little"), 0)

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int, force: bool | None = None) -> list[int]:
        """Read `length` bytes (at most 32) from the device at an I2C address, beginning at a register."""
        _check_block(length)
        return list(self._transfer(i2c_addr, bytes([register]), length))

    def write_i2c_block_data(
        self, i2c_addr: int, register: int, data: Sequence[int], force: bool | None = None
    ) -> None:
        """Write up to 32 bytes to the device at an I2C address, beginning at a register."""
        _check_block(len(data))
        self._transfer(i2c_addr, bytes([register, *data]), 0)

    def close(self) -> None:
        """Close the emulated I2C adapter; the virtual world stays open."""
        self.fd = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the emulated I2C adapter at the end of the `with` block."""
        self.close()


def _check_block(length: int) -> None:
    """Raise ValueError, as smbus2 does, for a block of more than `BLOCK_MAX` bytes."""
    if length > BLOCK_MAX:
        raise ValueError(f"Desired block length over {BLOCK_MAX} bytes")
