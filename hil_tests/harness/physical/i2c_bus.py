"""I2C adapter of this machine."""

from collections.abc import Sequence
from typing import Any

from hil_tests.harness.context import DriverContext
from hil_tests.harness.interfaces import I2cBus
from taxel.link import open_i2c


class LinuxI2cBus(I2cBus):
    """The adapter `/dev/i2c-N`, opened by smbus2."""

    def __init__(self, context: DriverContext, bus: str) -> None:
        """Open the I2C adapter of a physical rig until the end of the test. bus: number or path of the adapter."""
        self._smbus = open_i2c(bus)
        context.close_at_end(self._smbus.close)

    def i2c_rdwr(self, *i2c_msgs: Any) -> None:
        self._smbus.i2c_rdwr(*i2c_msgs)

    def write_quick(self, i2c_addr: int) -> None:
        self._smbus.write_quick(i2c_addr)

    def read_byte(self, i2c_addr: int) -> int:
        return self._smbus.read_byte(i2c_addr)

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]:
        return self._smbus.read_i2c_block_data(i2c_addr, register, length)

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int]) -> None:
        self._smbus.write_i2c_block_data(i2c_addr, register, data)
