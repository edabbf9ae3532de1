"""What a running board says of itself: identity, health, and the snapshot that lets a new image confirm itself."""

from __future__ import annotations

from typing import Any, Final

from taxel_protocol.framing import crc32
from taxel_protocol.layout import packer_of, unpack
from taxel_protocol.limits import REGISTER_IDENTITY, REGISTER_SNAPSHOT, REGISTER_STATUS, WHO_AM_I
from taxel_protocol.registers import Identity, Status
from taxel_tools.errors import BoardError, LostError, NackError, TransferError
from taxel_tools.steps import Clock, Pause, Steps, Transfer

READ_ATTEMPTS: Final = 3
AGAIN_S: Final = 0.01
SCANS_TO_CONFIRM: Final = 10
"""Scans that an image completes before it may confirm itself (firmware/bootloader/DESIGN.md)."""

_SIZE: Final = packer_of(Identity).size
_CRC: Final = _SIZE - 4


def is_identity(data: bytes) -> bool:
    """Whether these bytes are a board's identity, undamaged."""
    return data[0] == WHO_AM_I and crc32(data[:_CRC]) == int.from_bytes(data[_CRC:_SIZE], "little")


def read_identity_bytes(address: int) -> Steps[bytes]:
    """The identity registers as they are read, damaged or not. Raises `TransferError`."""
    return (yield Transfer(address, bytes([REGISTER_IDENTITY]), _SIZE))


def read_identity(address: int) -> Steps[dict[str, Any] | None]:
    """Fields of `Identity`; None if what answers there is no application of ours. Raises `TransferError`."""
    for attempt in range(READ_ATTEMPTS):
        try:
            data = yield from read_identity_bytes(address)
        except LostError:
            if attempt + 1 == READ_ATTEMPTS:
                raise
            continue
        if is_identity(data):
            return unpack(Identity, data)[0]
    return None


def read_status(address: int) -> Steps[dict[str, Any]]:
    """Fields of `Status`. Raises `TransferError`."""
    return unpack(Status, (yield Transfer(address, bytes([REGISTER_STATUS]), packer_of(Status).size)))[0]


def version_of(identity: dict[str, Any]) -> tuple[int, int, int]:
    """Firmware version of an identity."""
    return identity["firmware_major"], identity["firmware_minor"], identity["firmware_patch"]


def wait_for_application(address: int, now_s: Clock, patience_s: float) -> Steps[dict[str, Any] | None]:
    """Wait until an application answers; None if none does in time."""
    deadline = now_s() + patience_s
    while now_s() < deadline:
        try:
            identity = yield from read_identity(address)
        except TransferError:
            identity = None
        if identity is not None:
            return identity
        yield Pause(AGAIN_S)
    return None


def confirm(address: int, now_s: Clock, patience_s: float) -> Steps[None]:
    """Do what a new image waits for: let it scan, then read a snapshot. Raises `BoardError` if it does not scan."""
    deadline = now_s() + patience_s
    while now_s() < deadline:
        try:
            status = yield from read_status(address)
            if status["scans"] >= SCANS_TO_CONFIRM:
                yield Transfer(address, bytes([REGISTER_SNAPSHOT]), 10)
                return
        except (NackError, LostError):
            pass
        yield Pause(5 * AGAIN_S)
    raise BoardError(
        address,
        f"the new image does not scan after {patience_s:g} s; it stays unconfirmed and the board goes back to the old "
        "one by itself",
    )
