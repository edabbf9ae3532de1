"""Faults of a virtual Allegro hand and of its CAN channel."""

from typing import ClassVar

from hil_tests.harness.context import DriverContext
from hil_tests.harness.errors import RigError
from hil_tests.harness.interfaces import CanFaults
from hil_tests.harness.virtual.can_bus import VirtualCanBus


class VirtualCanFaults(CanFaults):
    """Faults of the hand and the channel of `VirtualCanBus`."""

    is_virtual: ClassVar[bool] = True

    def __init__(self, context: DriverContext) -> None:
        """Create the faults of the emulated CAN hand of this rig. Raises `RigError` if the rig has no virtual CAN
        bus.
        """
        can_bus = context.drivers["can"]
        if not isinstance(can_bus, VirtualCanBus):
            found = type(can_bus).__name__
            raise RigError(f"[can_faults] driver 'virtual': expected the driver 'virtual' of [can], found {found}")
        self._channel, self._faults = can_bus.channel, can_bus.hand.faults

    def lose_frames(self, count: int) -> None:
        self._channel.frames_to_lose = count

    def set_bus_off(self, is_off: bool) -> None:
        self._channel.is_off = is_off

    def set_temperature(self, celsius: int) -> None:
        self._faults.temperature_c = celsius

    def set_servo_off(self, is_off: bool) -> None:
        self._faults.is_servo_off = is_off

    def set_silent(self, is_silent: bool) -> None:
        self._faults.is_silent = is_silent

    def set_finger_silent(self, finger: int, is_silent: bool) -> None:
        """Let the joints of a finger of the emulated hand stop sending their angles, or send them again."""
        if is_silent:
            self._faults.dropped_fingers.add(finger)
        else:
            self._faults.dropped_fingers.discard(finger)
