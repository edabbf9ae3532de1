"""Errors of the board commands. Each prints as one line that names the bus or the board."""

from typing import Final

from taxel.errors import FieldError, TaxelError

HUB: Final = 0
"""Address that stands for the hub. No board uses 0 (I2C general call)."""


class WireError(TaxelError):
    """The connection to the bus failed, so that no board can be reached.

    `wire`: name of the connection; `problem`: what failed and what to do.
    """

    def __init__(self, wire: str, problem: str) -> None:
        """Create the error of a failed connection. wire: name of the port or adapter; problem: description and
        remedy.
        """
        super().__init__(wire, problem)
        self.wire = wire
        self.problem = problem

    def _format_message(self) -> str:
        return f"{self.wire}: {self.problem}"


class BoardError(TaxelError):
    """A board or the hub did not carry out a request.

    `address`: 7-bit I2C address, or `HUB`; `problem`: what failed and what to do.
    """

    def __init__(self, address: int, problem: str) -> None:
        """Create the error of a failed request. address: I2C address of the board or hub; problem: description and
        remedy.
        """
        super().__init__(address, problem)
        self.address = address
        self.problem = problem

    def _format_message(self) -> str:
        return f"hub: {self.problem}" if self.address == HUB else f"board 0x{self.address:02X}: {self.problem}"


class TransferError(BoardError):
    """A transfer failed; a repetition may succeed."""


class NackError(TransferError):
    """The I2C address or a byte was not acknowledged."""


class LostError(TransferError):
    """It is unknown whether the transfer took place: the command or its reply was lost."""


class StatusError(BoardError):
    """A bootloader refused a packet. `status`: its code (`taxel_protocol.bootloader.BootStatus`)."""

    def __init__(self, address: int, problem: str, status: int) -> None:
        """Create the error of a packet that a bootloader refused. address: I2C address; status: code in the
        response.
        """
        TaxelError.__init__(self, address, problem, status)
        self.address = address
        self.problem = problem
        self.status = status


class FirmwareFileError(FieldError, ValueError):
    """A firmware file or manifest that cannot be used; `field` is the line or the key."""


class PlanError(FieldError, ValueError):
    """A provisioning plan that cannot be used."""


class SignatureError(FirmwareFileError):
    """A firmware file without a valid signature of a trusted key."""

    def __init__(
        self,
        source: str,
        expected: str,
        found: str,
        remedy: str = "sign the image with taxel sign, or write it with --unsigned",
    ) -> None:
        """Create the error of a missing, wrong or untrusted signature; source: the file."""
        super().__init__(source, "signature", expected, found, remedy)
