"""A rig: the opened drivers of its devices, and the abilities that tests may require."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Final

from hil_tests.harness.context import DriverContext
from hil_tests.harness.drivers import open_driver
from hil_tests.harness.interfaces import (
    CanBus,
    CanFaults,
    Clock,
    FaultInjector,
    I2cBus,
    Power,
    RawCounts,
    Stimulus,
    Uart,
)
from hil_tests.harness.rig_file import RigDescription
from hil_tests.harness.virtual.world import WorldBuild, has_linux_hub, open_world
from taxel.hand import Hand

ABILITIES: Final = {
    "uart": "the hub's UART",
    "i2c": "an I2C adapter on the boards' bus",
    "can": "the hand's CAN channel",
    "can_faults": "faults of the hand and its CAN channel",
    "power": "switched power of boards and hub",
    "faults": "fault injection",
    "uart_faults": "faults of a UART between hub and host",
    "hub_board": "a hub with its own processor and flash",
    "stimulus": "a force probe",
    "counts": "known raw counts",
    "build": "boards, clocks and settings selected by the test",
    "clocks": "clocks of boards and hub that start at a given time",
    "hours": "minutes or hours of virtual time",
}
"""Abilities that a test may require, and the text for a rig that lacks the ability."""

NATIVE_WORLD_ABILITIES: Final = frozenset({"clocks", "hours"})
"""Abilities that an emulated world has only if it executes no ARM images."""


HUB_BOARD_ABILITIES: Final = frozenset({"uart_faults", "hub_board"})
"""Abilities that an emulated world has only with a hub board, not with a Linux hub on an I2C adapter."""


@dataclass
class Rig:
    """Drivers that a test uses. The driver of a device that the rig lacks is None.

    A test with the mark `needs("power")` runs only on a rig whose `power` is not None; the same holds for each device.
    """

    description: RigDescription
    clock: Clock
    uart: Uart
    i2c: I2cBus | None = None
    can: CanBus | None = None
    can_faults: CanFaults | None = None
    power: Power | None = None
    faults: FaultInjector | None = None
    stimulus: Stimulus | None = None
    counts: RawCounts | None = None

    @property
    def hand(self) -> Hand:
        """Description of the skin on the rig."""
        return self.description.hand


def get_abilities(description: RigDescription) -> set[str]:
    """Determine the abilities of a rig from its file, before a device is opened.

    A virtual rig has all abilities, with two exceptions: it lacks `NATIVE_WORLD_ABILITIES` if it executes ARM images,
    and `HUB_BOARD_ABILITIES` if it has a Linux hub. A physical rig has the abilities that its devices provide.
    """
    if description.is_virtual:
        missing = NATIVE_WORLD_ABILITIES if description.executed else frozenset()
        return set(ABILITIES) - missing - (HUB_BOARD_ABILITIES if has_linux_hub(description) else frozenset())
    return set(description.devices) & set(ABILITIES)


@contextmanager
def open_rig(description: RigDescription, build: WorldBuild | None = None) -> Iterator[Rig]:
    """Open the drivers of a rig, and close them at the end. build: settings of a virtual rig for one test."""
    with ExitStack() as exit_stack:
        context = DriverContext(description, exit_stack)
        if description.is_virtual:
            context.virtual_world = open_world(description, build or WorldBuild(), exit_stack)
        for name, device in description.devices.items():
            context.drivers[name] = open_driver(device.driver, context, device.options)
        yield Rig(description, **context.drivers)
