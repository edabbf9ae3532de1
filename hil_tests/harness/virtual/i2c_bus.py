"""I2C adapter on the bus of an emulated world."""

from typing import ClassVar

from hil_tests.harness.context import DriverContext
from taxel.link.virtual import VirtualSMBus


class VirtualI2cBus(VirtualSMBus):
    """A second master beside the hub, with the methods of `smbus2.SMBus`."""

    is_virtual: ClassVar[bool] = True

    def __init__(self, context: DriverContext) -> None:
        super().__init__(context.world)
