"""What is given new firmware: how it is asked for its bootloader, and how its application shows that it works."""

from __future__ import annotations

from typing import Protocol

from taxel_tools.application import confirm, read_identity, version_of, wait_for_application
from taxel_tools.errors import TransferError
from taxel_tools.session import BootSession
from taxel_tools.steps import Clock, Steps, Version


class Target(Protocol):
    """A board on the bus, or the hub. `noun`: what messages call it."""

    address: int
    noun: str
    now_s: Clock
    session: BootSession

    def version(self) -> Steps[Version | None]:
        """Of the application that runs; None if none answers."""
        ...

    def enter(self) -> Steps[None]:
        """Lead it into its bootloader, and begin a session."""
        ...

    def wait_for_application(self, patience_s: float) -> Steps[Version | None]:
        """Wait until an application answers; its version, or None if none does in time."""
        ...

    def confirm(self, patience_s: float) -> Steps[None]:
        """Do what a new image waits for before it confirms itself. Raises `BoardError`."""
        ...

    def settle(self) -> Steps[None]:
        """Look whether everything is as it was before. Raises `BoardError`."""
        ...


class BoardTarget:
    """A board on the bus."""

    noun = "board"

    def __init__(self, address: int, now_s: Clock) -> None:
        self.address = address
        self.now_s = now_s
        self.session = BootSession(address, now_s)

    def version(self) -> Steps[Version | None]:
        """Of its application; None also while it writes or restarts."""
        try:
            identity = yield from read_identity(self.address)
        except TransferError:
            return None
        return None if identity is None else version_of(identity)

    def enter(self) -> Steps[None]:
        """Through its command register."""
        yield from self.session.enter()

    def wait_for_application(self, patience_s: float) -> Steps[Version | None]:
        """Read its identity until there is one."""
        identity = yield from wait_for_application(self.address, self.now_s, patience_s)
        return None if identity is None else version_of(identity)

    def confirm(self, patience_s: float) -> Steps[None]:
        """Let it scan, and read a snapshot."""
        yield from confirm(self.address, self.now_s, patience_s)

    def settle(self) -> Steps[None]:
        """Nothing else hangs on a board."""
        yield from ()
