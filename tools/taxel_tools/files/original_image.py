"""Image of a device of the original hardware, with the metadata of the original bootloader."""

from dataclasses import dataclass
from typing import Final

from taxel_protocol.bootloader import BOOT_ROW_SIZE, StockMetadata

METADATA_OFFSET: Final = 64
"""Offset of the original bootloader's metadata in the last row of the flash: its last 64 bytes."""


@dataclass(frozen=True)
class OriginalImage:
    """Image of a device of the original hardware.

    first_row: flash row at which the image begins; 0 for an image without a bootloader. rows: number of rows of the
    flash. content: bytes of the image.
    """

    first_row: int
    rows: int
    content: bytes
    entry: int
    """Address at which the original bootloader enters the image."""

    def metadata_row(self) -> bytes:
        """Build the last row of the flash, by which the original bootloader validates the image.

        The checksum is the two's complement of the 8-bit sum of the image. Source: the vendor's component
        Bootloader_v1_60; not yet confirmed on a device.
        """
        metadata: bytes = StockMetadata.build(
            {
                "checksum": -sum(self.content) & 0xFF,
                "entry": self.entry,
                "last_bootloader_row": self.first_row - 1,
                "reserved_a": bytes(2),
                "length": len(self.content),
                "reserved_b": bytes(3),
                "active": 1,
                "verified": 0,
                "bootloader_version": 0,
                "application_id": 0,
                "application_version": 0,
                "custom_id": 0,
                "reserved_c": bytes(28),
            }
        )
        return (bytes(METADATA_OFFSET) + metadata).ljust(BOOT_ROW_SIZE, b"\0")

    def list_rows(self) -> list[tuple[int, bytes]]:
        """List numbers and bytes of the rows to write.

        For an image behind a bootloader, the metadata row is the last.
        """
        rows = [
            (
                self.first_row + start // BOOT_ROW_SIZE,
                self.content[start : start + BOOT_ROW_SIZE].ljust(BOOT_ROW_SIZE, b"\0"),
            )
            for start in range(0, len(self.content), BOOT_ROW_SIZE)
        ]
        return rows + ([(self.rows - 1, self.metadata_row())] if self.first_row else [])
