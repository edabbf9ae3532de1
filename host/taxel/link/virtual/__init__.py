"""An emulated world in this process, with its UART and its I2C bus, in virtual time."""

from taxel.link.virtual.master_world import VirtualMasterWorld
from taxel.link.virtual.processor import Fault, HandlerCost, Processor
from taxel.link.virtual.smbus import VirtualSMBus
from taxel.link.virtual.uart import VirtualMemoryLink, VirtualSerialLink
from taxel.link.virtual.world import FaultError, FaultEvent, PowerCut, VirtualWorld

__all__ = [
    "Fault",
    "FaultError",
    "FaultEvent",
    "HandlerCost",
    "PowerCut",
    "Processor",
    "VirtualMasterWorld",
    "VirtualMemoryLink",
    "VirtualSMBus",
    "VirtualSerialLink",
    "VirtualWorld",
]
