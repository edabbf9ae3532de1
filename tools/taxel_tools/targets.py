"""Devices that receive firmware: how to start the bootloader, and how to check the new application."""

from typing import Protocol

from taxel_tools.application import get_firmware_version, read_identity, trigger_confirmation, wait_for_application
from taxel_tools.errors import TransferError
from taxel_tools.procedure import Clock, Procedure, Version
from taxel_tools.session import BootSession


class Target(Protocol):
    """A board on the bus, or the hub. `device_name`: name of the device in messages."""

    address: int
    device_name: str
    now_s: Clock
    session: BootSession

    def read_version(self) -> Procedure[Version | None]:
        """Read the version of the running application; None if no application answers."""
        ...

    def enter(self) -> Procedure[None]:
        """Restart the device into its bootloader and start a session."""
        ...

    def wait_for_application(self, timeout_s: float) -> Procedure[Version | None]:
        """Wait until an application answers; return its version, or None after `timeout_s` seconds."""
        ...

    def trigger_confirmation(self, timeout_s: float) -> Procedure[None]:
        """Fulfil the condition under which a new image confirms itself. Raises `BoardError`."""
        ...

    def check_operation(self) -> Procedure[None]:
        """Check that the device works as before the update. Raises `BoardError`."""
        ...


class BoardTarget:
    """A board on the bus."""

    device_name = "board"

    def __init__(self, address: int, now_s: Clock) -> None:
        """Create the access for a firmware update of the board at an I2C address. now_s: clock of the wire, in s."""
        self.address = address
        self.now_s = now_s
        self.session = BootSession(address, now_s)

    def read_version(self) -> Procedure[Version | None]:
        """Read the firmware version of the board from its identity registers.

        Returns None if no application answers, also while the board writes its flash or restarts.
        """
        try:
            identity = yield from read_identity(self.address)
        except TransferError:
            return None
        return None if identity is None else get_firmware_version(identity)

    def enter(self) -> Procedure[None]:
        """Restart the board into its bootloader by the command register, and start a session."""
        yield from self.session.enter()

    def wait_for_application(self, timeout_s: float) -> Procedure[Version | None]:
        """Read the identity of the board until it is valid. Returns its version, or None after `timeout_s` seconds."""
        identity = yield from wait_for_application(self.address, self.now_s, timeout_s)
        return None if identity is None else get_firmware_version(identity)

    def trigger_confirmation(self, timeout_s: float) -> Procedure[None]:
        """Wait until the board has scanned, then read a snapshot, so that its new firmware image confirms itself."""
        yield from trigger_confirmation(self.address, self.now_s, timeout_s)

    def check_operation(self) -> Procedure[None]:
        """Check nothing, as no other device depends on a board."""
        yield from ()
