"""Wires that end in an emulated world: its UART and its I2C bus, in virtual time."""

from taxel.link.virtual.processor import Fault, HandlerCost, Processor
from taxel.link.virtual.smbus import VirtualSMBus
from taxel.link.virtual.uart import VirtualMemoryLink, VirtualSerialLink
from taxel.link.virtual.world import FaultError, PowerCut, Strike, VirtualWorld

__all__ = [
    "Fault",
    "FaultError",
    "HandlerCost",
    "PowerCut",
    "Processor",
    "Strike",
    "VirtualMemoryLink",
    "VirtualSMBus",
    "VirtualSerialLink",
    "VirtualWorld",
]
