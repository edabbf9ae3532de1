"""Assembly of flash rows into an image; rows outside one slot are refused."""

from collections.abc import Mapping
from typing import Final

from taxel_protocol.bootloader import (
    BOOT_IMAGE_MAGIC,
    BOOT_ROW_SIZE,
    LAYOUTS,
    BootDevice,
    FlashLayout,
)
from taxel_tools.errors import FirmwareFileError
from taxel_tools.files.firmware import FirmwareImage, parse_image

DEVICE_OFFSET: Final = 5


def build_image(rows: Mapping[int, tuple[bytes, str]], source: str) -> FirmwareImage:
    """Assemble a firmware image from flash rows; a row between the first and the last that the file omits is zero.

    rows: for each row number its 128 bytes, and the place in the file that sets the row ("line 12"). Raises
    `FirmwareFileError` for rows in the bootloader, outside the slots or in both slots, and for an invalid image.
    """
    # Before the layout is known, the smallest bootloader is checked: the file of a bootloader has no image header.
    _check_bootloader(rows, min(layout.bootloader_rows for layout in LAYOUTS.values()), source)
    layout = _find_layout(rows, source)
    _check_bootloader(rows, layout.bootloader_rows, source)
    slots = {row: _find_slot(row, layout) for row in rows}
    for row, slot in sorted(slots.items()):
        if slot is None:
            raise FirmwareFileError(
                source,
                rows[row][1],
                "rows " + " or ".join(f"{first} to {first + layout.slot_rows - 1}" for first in layout.first_rows),
                f"row {row}, outside the slots" if row < layout.row_count else f"row {row}, beyond the flash",
                "only the bootloader writes configuration and metadata; use the file of an application",
            )
    first = min(rows)
    other_slot_rows = [row for row in sorted(rows) if slots[row] != slots[first]]
    if other_slot_rows:
        raise FirmwareFileError(
            source,
            rows[other_slot_rows[0]][1],
            "rows of one slot",
            "rows of slots A and B",
            "use a separate file for each slot",
        )
    last = max(rows)
    data = b"".join(rows[row][0] if row in rows else bytes(BOOT_ROW_SIZE) for row in range(first, last + 1))
    return parse_image(data, source, first)


def _check_bootloader(rows: Mapping[int, tuple[bytes, str]], bootloader_rows: int, source: str) -> None:
    """Raise `FirmwareFileError` if a row belongs to the bootloader."""
    first = min(rows, default=bootloader_rows)
    if first < bootloader_rows:
        raise FirmwareFileError(
            source,
            rows[first][1],
            f"rows from {bootloader_rows} on",
            f"row {first} of the bootloader",
            "the bootloader cannot replace itself; use the file of an application",
        )


def _find_slot(row: int, layout: FlashLayout) -> int | None:
    """Return the flash slot that contains a row; None for a row outside the slots."""
    return next((slot for slot, first in enumerate(layout.first_rows) if 0 <= row - first < layout.slot_rows), None)


def _find_layout(rows: Mapping[int, tuple[bytes, str]], source: str) -> FlashLayout:
    """Return the flash layout of the device that the header of a firmware image names.

    The header is at the start of the first row of a slot. Raises `FirmwareFileError` if there is no header.
    """
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
