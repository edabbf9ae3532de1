"""Interpretation of flash rows: the operation that a power cut interrupted, and the valid record."""

from typing import Any, Final

from taxel.link.virtual import PowerCut
from taxel_protocol.bootloader import (
    BOOT_CONFIGURATION_MAGIC,
    BOOT_CONFIGURATION_ROW,
    BOOT_METADATA_MAGIC,
    BOOT_METADATA_ROW,
    BOOT_ROW_SIZE,
    BOOT_SLOT_NONE,
    BOOT_TRIES,
    Configuration,
    Metadata,
    Record,
)
from taxel_protocol.framing import crc32
from taxel_protocol.layout import unpack

OPERATIONS: Final = ("row of the image", "image made pending", "try counted", "image confirmed", "configuration")


def name_operation(cut: PowerCut) -> str:
    """Return which flash operation a power cut interrupted, as one of `OPERATIONS`.

    The row states whether an image, the configuration or the metadata was written. New metadata without a pending
    image confirm an image; with all boot attempts left they make an image pending, with fewer they count an attempt.
    """
    if cut.row in (BOOT_CONFIGURATION_ROW, BOOT_CONFIGURATION_ROW + 1):
        return OPERATIONS[4]
    if cut.row not in (BOOT_METADATA_ROW, BOOT_METADATA_ROW + 1):
        return OPERATIONS[0]
    metadata = unpack(Metadata, unpack(Record, cut.new_data)[0]["payload"])[0]
    if metadata["pending"] == BOOT_SLOT_NONE:
        return OPERATIONS[3]
    return OPERATIONS[1] if metadata["tries"][metadata["pending"]] == BOOT_TRIES else OPERATIONS[2]


def _find_newest_payload(flash: bytes, first_row: int, magic: int) -> bytes | None:
    """Return the payload of the valid flash record with the highest sequence number; None without a valid record.

    flash: content of the whole flash. first_row: first of the two rows with such records. magic: their first bytes. The
    CRC covers the first 120 bytes of a row. The sequence numbers are compared modulo 2^32.
    """
    newest: tuple[int, bytes] | None = None
    for row in (first_row, first_row + 1):
        data = flash[row * BOOT_ROW_SIZE : (row + 1) * BOOT_ROW_SIZE]
        record = unpack(Record, data)[0]
        if record["magic"] != magic or record["crc32"] != crc32(data[:120]):
            continue
        if newest is None or 0 < (record["sequence"] - newest[0]) % 2**32 < 2**31:
            newest = record["sequence"], record["payload"]
    return None if newest is None else newest[1]


def find_confirmed_slot(flash: bytes) -> int | None:
    """Return the slot of the confirmed image; None without a valid record. flash: content of the whole flash."""
    payload = _find_newest_payload(flash, BOOT_METADATA_ROW, BOOT_METADATA_MAGIC)
    return None if payload is None else int(unpack(Metadata, payload)[0]["confirmed"])


def decode_configuration(flash: bytes) -> dict[str, Any] | None:
    """Return the fields of the valid configuration; None if there is none. flash: content of the whole flash."""
    payload = _find_newest_payload(flash, BOOT_CONFIGURATION_ROW, BOOT_CONFIGURATION_MAGIC)
    return None if payload is None else unpack(Configuration, payload)[0]
