"""Rows of flash out of a file, as an image: what lies where it must not, and what belongs to two slots, is refused."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from taxel_protocol.bootloader import (
    BOOT_BOOTLOADER_ROWS,
    BOOT_IMAGE_MAGIC,
    BOOT_ROW_COUNT,
    BOOT_ROW_SIZE,
    LAYOUTS,
    BootDevice,
    FlashLayout,
)
from taxel_tools.errors import FirmwareFileError
from taxel_tools.files.firmware import FirmwareImage, parse_image

DEVICE_OFFSET: Final = 5


def image_of_rows(rows: Mapping[int, tuple[bytes, str]], source: str) -> FirmwareImage:
    """`rows`: 128 bytes of each row, and where in the file they stand ("line 12"). Raises `FirmwareFileError`."""
    for row, (_, where) in sorted(rows.items()):
        if row < BOOT_BOOTLOADER_ROWS:
            raise FirmwareFileError(
                source,
                where,
                f"rows from {BOOT_BOOTLOADER_ROWS} on",
                f"row {row} of the bootloader",
                "the bootloader does not replace itself; give an application's file",
            )
    layout = _layout(rows, source)
    slots = {row: _slot_of(row, layout) for row in rows}
    for row, slot in sorted(slots.items()):
        if slot is None:
            a, b = layout.first_rows
            raise FirmwareFileError(
                source,
                rows[row][1],
                f"rows {a} to {a + layout.slot_rows - 1} or {b} to {b + layout.slot_rows - 1}",
                f"row {row}, outside the slots" if row < BOOT_ROW_COUNT else f"row {row}, beyond the flash",
                "configuration and metadata are the bootloader's own; give an application's file",
            )
    first = min(rows)
    mixed = [row for row in sorted(rows) if slots[row] != slots[first]]
    if mixed:
        raise FirmwareFileError(
            source, rows[mixed[0]][1], "rows of one slot", "rows of slots A and B", "give each slot a file of its own"
        )
    last = max(rows)
    data = b"".join(rows[row][0] if row in rows else bytes(BOOT_ROW_SIZE) for row in range(first, last + 1))
    return parse_image(data, source, first)


def _slot_of(row: int, layout: FlashLayout) -> int | None:
    return next((slot for slot, first in enumerate(layout.first_rows) if 0 <= row - first < layout.slot_rows), None)


def _layout(rows: Mapping[int, tuple[bytes, str]], source: str) -> FlashLayout:
    """The header tells the device, and with it where the slots lie."""
    magic = BOOT_IMAGE_MAGIC.to_bytes(4, "little")
    for row in sorted({first for layout in LAYOUTS.values() for first in layout.first_rows} & set(rows)):
        data = rows[row][0]
        if data.startswith(magic) and data[DEVICE_OFFSET] in BootDevice._value2member_map_:
            return LAYOUTS[BootDevice(data[DEVICE_OFFSET])]
    raise FirmwareFileError(
        source,
        "image header",
        "an image that begins with TXLI in the first row of a slot",
        "none" if rows else "no rows",
        "is this a taxel image?",
    )
