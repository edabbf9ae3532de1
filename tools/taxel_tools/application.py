"""Register reads of a running board: identity, status, and the snapshot that makes a new image confirm itself."""

from contextlib import suppress
from typing import Any, Final

from taxel.stream.fault_record import FAULT_REVISION, REGISTER_SIZE, FaultRecord, parse_fault_register
from taxel_protocol.framing import crc32
from taxel_protocol.layout import get_packer, pack, unpack
from taxel_protocol.limits import (
    BOOTLOADER_KEY,
    REGISTER_COMMAND,
    REGISTER_FAULT,
    REGISTER_IDENTITY,
    REGISTER_SNAPSHOT,
    REGISTER_STATUS,
    WHO_AM_I,
)
from taxel_protocol.names import BoardCommand
from taxel_protocol.registers import EnterBootloaderRegister, Identity, Status
from taxel_tools.errors import BoardError, LostError, NackError, TransferError
from taxel_tools.procedure import Clock, Pause, Procedure, Transfer

READ_ATTEMPTS: Final = 3
RETRY_PAUSE_S: Final = 0.01
SCANS_TO_CONFIRM: Final = 10
"""Number of scans that an image completes before it may confirm itself (firmware/bootloader/DESIGN.md)."""

_SIZE: Final = get_packer(Identity).size
_CRC: Final = _SIZE - 4


def is_identity(data: bytes) -> bool:
    """Return whether `data` is a valid identity block of a board: first byte WHO_AM_I, correct CRC-32."""
    return data[0] == WHO_AM_I and crc32(data[:_CRC]) == int.from_bytes(data[_CRC:_SIZE], "little")


def read_identity_bytes(address: int) -> Procedure[bytes]:
    """Read the identity registers of a board without checking their CRC-32. Raises `TransferError`."""
    return (yield Transfer(address, bytes([REGISTER_IDENTITY]), _SIZE))


def read_identity(address: int) -> Procedure[dict[str, Any] | None]:
    """Read the identity of a board (fields of `Identity`); None if the device does not return a valid one.

    Raises `TransferError`.
    """
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


def read_status(address: int) -> Procedure[dict[str, Any]]:
    """Read the status of a board (fields of `Status`). Raises `TransferError`."""
    return unpack(Status, (yield Transfer(address, bytes([REGISTER_STATUS]), get_packer(Status).size)))[0]


def read_fault(address: int, identity: dict[str, Any]) -> Procedure[FaultRecord | None]:
    """Read the last fault of a board since power-on. Raises `TransferError`.

    identity: identity of the board. Returns None if no fault occurred, if the bytes are damaged, or for a board with
    map revision 0, which keeps no fault record.
    """
    if identity["map_revision"] < FAULT_REVISION:
        return None
    return parse_fault_register(address, (yield Transfer(address, bytes([REGISTER_FAULT]), REGISTER_SIZE)))


def request_bootloader(address: int) -> Procedure[None]:
    """Send the command ENTER_BOOTLOADER to the boards at an I2C address, of any map revision.

    The first transfer carries the key. Boards of map revision 0 reject this transfer; the second transfer, without the
    key, is for these boards. It has no effect on a board with a newer map: either the board is restarting and does not
    acknowledge, or its bootloader ignores the bytes. Both transfers are needed, because the identity of several boards
    at one address cannot be read. Raises `TransferError` if no board acknowledges the first transfer.
    """
    command = {"command": int(BoardCommand.ENTER_BOOTLOADER), "complement": BoardCommand.ENTER_BOOTLOADER ^ 0xFF}
    with_key = pack(EnterBootloaderRegister, command | {"key": BOOTLOADER_KEY})
    yield Transfer(address, bytes([REGISTER_COMMAND]) + with_key)
    with suppress(TransferError):
        yield Transfer(address, bytes([REGISTER_COMMAND]) + with_key[:2])


def get_firmware_version(identity: dict[str, Any]) -> tuple[int, int, int]:
    """Return the firmware version (major, minor, patch) from the identity of a board."""
    return identity["firmware_major"], identity["firmware_minor"], identity["firmware_patch"]


def wait_for_application(address: int, now_s: Clock, timeout_s: float) -> Procedure[dict[str, Any] | None]:
    """Wait until the application of the board at an I2C address answers. Returns its identity, or None after
    `timeout_s`.
    """
    deadline = now_s() + timeout_s
    while now_s() < deadline:
        try:
            identity = yield from read_identity(address)
        except TransferError:
            identity = None
        if identity is not None:
            return identity
        yield Pause(RETRY_PAUSE_S)
    return None


def trigger_confirmation(address: int, now_s: Clock, timeout_s: float) -> Procedure[None]:
    """Wait for the scans of a new firmware image, then read a snapshot, which makes the image confirm itself.

    Failed reads are repeated. Raises `BoardError` if the image does not complete `SCANS_TO_CONFIRM` scans within
    `timeout_s` seconds.
    """
    deadline = now_s() + timeout_s
    while now_s() < deadline:
        try:
            status = yield from read_status(address)
            if status["scans"] >= SCANS_TO_CONFIRM:
                yield Transfer(address, bytes([REGISTER_SNAPSHOT]), 10)  # the first bytes are sufficient
                return
        except (NackError, LostError):
            pass
        yield Pause(5 * RETRY_PAUSE_S)
    raise BoardError(
        address,
        f"the new image does not scan within {timeout_s:g} s and stays unconfirmed; the board returns to the "
        "previous image by itself",
    )
