"""A rig on a bench: real ports, opened as its file names them."""

from contextlib import ExitStack
from typing import Any

from hil_tests.harness.physical.can_bus import PhysicalCanBus
from hil_tests.harness.physical.power import ModemLinePower
from hil_tests.harness.physical.stimulus import OperatorStimulus
from hil_tests.harness.physical.uart import PhysicalClock, SerialUart
from hil_tests.harness.rig_file import RigDescription
from taxel.link import open_i2c


def open_physical(description: RigDescription, stack: ExitStack) -> dict[str, Any]:
    """Drivers of what the rig file names. Raises `RigError` or `LinkError` of one line for what is not there."""
    devices = description.devices
    drivers: dict[str, Any] = {"clock": PhysicalClock(), "uart": SerialUart(devices["uart"].options["url"])}
    if "i2c" in devices:
        drivers["i2c"] = open_i2c(devices["i2c"].options["bus"])
        stack.callback(drivers["i2c"].close)
    if "can" in devices:
        drivers["can"] = PhysicalCanBus(devices["can"].options["url"])
    if "power" in devices:
        drivers["power"] = ModemLinePower(**devices["power"].options)
        stack.callback(drivers["power"].close)
    if "stimulus" in devices:
        drivers["stimulus"] = OperatorStimulus(description.hand)
    return drivers
