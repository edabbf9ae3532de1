"""What goes wrong between a host and boards: each prints as one line that names the wire or the board."""

from __future__ import annotations

from typing import Final

from taxel.errors import FieldError, TaxelError

HUB: Final = 0
"""In place of a board's address: no board has it (I2C's general call)."""


class WireError(TaxelError):
    """The wire itself failed, so that no board can be reached. `wire`: its name; `problem`: what and what to do."""

    def __init__(self, wire: str, problem: str) -> None:
        super().__init__(wire, problem)
        self.wire = wire
        self.problem = problem

    def __str__(self) -> str:
        return f"{self.wire}: {self.problem}"


class BoardError(TaxelError):
    """One board, or the hub, did not do what was asked. `address`: 7-bit, or `HUB`; `problem`: what and what to do."""

    def __init__(self, address: int, problem: str) -> None:
        super().__init__(address, problem)
        self.address = address
        self.problem = problem

    def __str__(self) -> str:
        return f"hub: {self.problem}" if self.address == HUB else f"board 0x{self.address:02X}: {self.problem}"


class TransferError(BoardError):
    """A transfer did not run to its end; it may be tried again."""


class NackError(TransferError):
    """The address or a byte was not acknowledged."""


class LostError(TransferError):
    """Nobody knows whether the transfer took place: command or reply were lost on their way."""


class StatusError(BoardError):
    """A bootloader refused a packet. `status`: its code (`taxel_protocol.bootloader.BootStatus`)."""

    def __init__(self, address: int, problem: str, status: int) -> None:
        TaxelError.__init__(self, address, problem, status)
        self.address = address
        self.problem = problem
        self.status = status


class FirmwareFileError(FieldError, ValueError):
    """A firmware file or manifest that cannot be used; `field` is the line or key."""


class PlanError(FieldError, ValueError):
    """A provisioning plan that cannot be used."""
