"""Microcontrollers for which images exist."""

from dataclasses import dataclass
from typing import Final

from taxel_protocol.bootloader import BootDevice


@dataclass(frozen=True)
class Part:
    """A microcontroller that the emulator executes.

    `board`, `hub`: devices in the headers of its images. `records_brown_out`: whether the reset cause of a brown-out
    differs from that of a power-on.
    """

    board: BootDevice
    hub: BootDevice
    records_brown_out: bool


PARTS: Final = {
    "psoc4200": Part(BootDevice.BOARD, BootDevice.HUB, True),
    "psoc4100s": Part(BootDevice.BOARD_64K, BootDevice.HUB_64K, False),
}
"""Part by the folder of its port in firmware/boards."""
