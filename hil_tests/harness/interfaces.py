"""Interfaces of the devices of a rig. Each driver class implements one of them; tests use only these methods."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final, Protocol, runtime_checkable

import can
from numpy.typing import ArrayLike

from taxel.link import Link


@runtime_checkable
class Clock(Protocol):
    """Time of the rig: virtual time or the time of this machine."""

    def now_s(self) -> float:
        """Return the time in seconds since an arbitrary origin."""

    def wait(self, seconds: float) -> None:
        """Let `seconds` pass on the rig."""


@runtime_checkable
class Uart(Protocol):
    """UART of the hub."""

    def open_link(self) -> Link:
        """Open a link to the hub. The caller closes the link."""


@runtime_checkable
class I2cBus(Protocol):
    """I2C adapter on the bus of the boards: the methods of `smbus2.SMBus` that tests use.

    Errors are `OSError` with the error numbers of Linux.
    """

    def i2c_rdwr(self, *i2c_msgs: Any) -> None: ...
    def write_quick(self, i2c_addr: int) -> None: ...
    def read_byte(self, i2c_addr: int) -> int: ...
    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]: ...
    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int]) -> None: ...


@runtime_checkable
class CanBus(Protocol):
    """CAN channel of the Allegro hand."""

    def open_bus(self) -> can.BusABC:
        """Open the channel with python-can. The caller shuts the channel down."""

    def now_s(self) -> float:
        """Return the time on the clock of the channel, seconds."""

    def advance(self, seconds: float) -> None:
        """Let `seconds` pass for the hand."""


@runtime_checkable
class CanFaults(Protocol):
    """Faults of the Allegro hand and of its CAN channel."""

    def lose_frames(self, count: int) -> None:
        """Make the channel lose the next `count` frames, of either direction."""

    def set_bus_off(self, is_off: bool) -> None:
        """Let the CAN controller of the host enter or leave the state bus-off."""

    def set_temperature(self, celsius: int) -> None:
        """Let the hand report this motor temperature in degrees Celsius."""

    def set_servo_off(self, is_off: bool) -> None:
        """Let the hand report its motors as off or on."""

    def set_silent(self, is_silent: bool) -> None:
        """Let the hand stop sending frames, or send them again."""

    def set_finger_silent(self, finger: int, is_silent: bool) -> None:
        """Let the hand stop sending the joint angles of this finger, or send them again."""


@runtime_checkable
class Power(Protocol):
    """Power supply of boards and hub."""

    def switch(self, on: bool, address: int | None = None) -> None:
        """Switch the power of one board, or of the hub with all boards (None).

        Raises `RigError` for a board whose power cannot be switched alone.
        """


@runtime_checkable
class FaultInjector(Protocol):
    """Faults of boards, bus, hub and UART, by the names in firmware/emulator/README.md."""

    def inject(self, name: str, address: int = 0, value: float = 0.0, second_value: float = 0.0) -> None:
        """Arm a fault of a board, or of hub and UART (address 0). value, second_value: parameters of the fault."""

    def read_events(self, first: int = 0) -> Sequence[Any]:
        """Return the faults that have taken effect, from event number `first` on, each with `time_s`, `kind` and
        `address`.
        """


@runtime_checkable
class Stimulus(Protocol):
    """Force probe on the skin."""

    def press(self, address: int, taxel: int, force_n: float) -> None:
        """Apply a force to one taxel of a board, and to no other taxel."""

    def release(self) -> None:
        """Remove the probe from the skin."""


@runtime_checkable
class RawCounts(Protocol):
    """Raw counts that replace the measurements of the front ends, so that the expected counts are exact."""

    def set_counts(self, counts: ArrayLike) -> None:
        """Let all taxels measure these raw counts from now on, one for each taxel in the order of the hand."""


INTERFACES: Final[Mapping[str, type]] = MappingProxyType(
    {
        "clock": Clock,
        "uart": Uart,
        "i2c": I2cBus,
        "can": CanBus,
        "can_faults": CanFaults,
        "power": Power,
        "faults": FaultInjector,
        "stimulus": Stimulus,
        "counts": RawCounts,
    }
)
"""Interface of each device, by the name of its table in rig files. Drivers are opened in this order."""
