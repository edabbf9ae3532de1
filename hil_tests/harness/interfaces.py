"""The wires and hands of a rig. A driver implements one of these; a rig has those that it can."""

from collections.abc import Sequence
from typing import Any, Protocol

import can
from numpy.typing import ArrayLike

from taxel.link import Link


class Clock(Protocol):
    """The rig's time: virtual, or this machine's."""

    def now_s(self) -> float:
        """Seconds since any origin."""

    def wait(self, seconds: float) -> None:
        """Let the rig go on for so long."""


class Uart(Protocol):
    """The hub's UART."""

    def link(self) -> Link:
        """Open it; the caller closes the link."""


class I2cBus(Protocol):
    """An I2C adapter on the boards' bus: what the tests use of `smbus2.SMBus`. Errors are OSError, as in Linux."""

    def i2c_rdwr(self, *i2c_msgs: Any) -> None: ...
    def write_quick(self, i2c_addr: int) -> None: ...
    def read_byte(self, i2c_addr: int) -> int: ...
    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int) -> list[int]: ...
    def write_i2c_block_data(self, i2c_addr: int, register: int, data: Sequence[int]) -> None: ...
    def close(self) -> None: ...


class CanBus(Protocol):
    """The Allegro hand's CAN channel."""

    def open(self) -> can.BusABC:
        """Open it; the caller shuts it down."""

    def let_pass(self, seconds: float) -> None:
        """Let the hand go on for so long."""

    def now_s(self) -> float:
        """The clock of the channel."""


class CanFaults(Protocol):
    """What can go wrong with hand and channel."""

    def lose_frames(self, count: int) -> None: ...
    def go_bus_off(self, off: bool) -> None: ...
    def set_temperature(self, celsius: int) -> None: ...
    def switch_servo_off(self, off: bool) -> None: ...
    def silence(self, silent: bool) -> None: ...
    def silence_finger(self, finger: int, silent: bool) -> None: ...


class Power(Protocol):
    """Power of boards and hub."""

    def switch(self, on: bool, address: int | None = None) -> None:
        """One board, or the hub with all its boards (None). Raises RigError for what cannot be switched alone."""


class FaultInjector(Protocol):
    """Faults of firmware/emulator/README.md, by name."""

    def inject(self, name: str, address: int = 0, value: float = 0.0, second: float = 0.0) -> None: ...

    def strikes(self, first: int = 0) -> Sequence[Any]:
        """What has struck: `time_s`, `kind`, `address`."""


class Stimulus(Protocol):
    """A probe that presses taxels."""

    def press(self, address: int, taxel: int, force_n: float) -> None:
        """Press one taxel of a board, and nothing else."""

    def release(self) -> None:
        """Touch nothing."""


class Counts(Protocol):
    """Raw counts in the front end's place: then every delivered count is known."""

    def show(self, counts: ArrayLike) -> None:
        """[n] raw counts in the hand's order, from now on."""
