"""A rig: the drivers of what stands on the bench, and what it can therefore do."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from typing import Any

from hil_tests.harness.interfaces import (
    CanBus,
    CanFaults,
    Clock,
    Counts,
    FaultInjector,
    I2cBus,
    Power,
    Stimulus,
    Uart,
)
from hil_tests.harness.physical import open_physical
from hil_tests.harness.rig_file import RigDescription
from hil_tests.harness.virtual import open_virtual
from taxel.hand import Hand

ABILITIES = {
    "uart": "the hub's UART",
    "i2c": "an I2C adapter on the boards' bus",
    "can": "the hand's CAN channel",
    "can_faults": "faults of the hand and its CAN channel",
    "power": "power of boards and hub switched",
    "faults": "faults injected",
    "stimulus": "taxels pressed with a probe",
    "counts": "raw counts that are known",
    "build": "boards, clocks and settings chosen for the test",
    "clocks": "clocks of boards and hub that begin where the test wants",
    "hours": "minutes and more of virtual time in a test",
}
"""What a test may need, and what a rig without it lacks."""


@dataclass
class Rig:
    """What a test works on. A driver that the rig lacks is None; `needs` marks keep a test from meeting one."""

    description: RigDescription
    clock: Clock
    uart: Uart
    i2c: I2cBus | None = None
    can: CanBus | None = None
    can_faults: CanFaults | None = None
    power: Power | None = None
    faults: FaultInjector | None = None
    stimulus: Stimulus | None = None
    counts: Counts | None = None
    build: dict[str, Any] = field(default_factory=dict)

    @property
    def hand(self) -> Hand:
        """The skin on the rig."""
        return self.description.hand


def abilities_of(description: RigDescription) -> set[str]:
    """What a rig can do, before anything is opened."""
    if description.is_virtual:
        return set(ABILITIES) - ({"clocks", "hours"} if description.executed else set())
    return set(description.devices) & set(ABILITIES)


@contextmanager
def opened(description: RigDescription, build: dict[str, Any], *, counts: bool = False) -> Iterator[Rig]:
    """The rig's drivers, open; closed at the end. `build`: how a virtual rig is put together for one test."""
    with ExitStack() as stack:
        if description.is_virtual:
            drivers = open_virtual(description, build, stack, counts=counts)
        else:
            drivers = open_physical(description, stack)
        yield Rig(description, **drivers, build=build)
