"""Definitions of the bootloader: packets, image header, flash map, metadata and configuration records.

All numbers are little-endian. `bootloader_packets` builds and parses packets; `bootloader_images` builds images and
records.

A packet is ``01 | command or status | length u16 | data | checksum u16 | 17``, as in the Cypress bootloader, and at
most 64 bytes long. Commands 31 to 3C are those of Cypress; 50 to 53 are extensions of this project, outside the range
of Cypress's later protocol. `firmware/bootloader/SPEC.md` explains every byte.
"""

from dataclasses import dataclass
from enum import IntEnum

from construct import Bytes, Int8ul, Int16ul, Int32ul, Struct

BOOT_VERSION = 1
"""Version of the records, the image header and commands 50 to 53."""

BOOT_ROW_SIZE = 128
"""Bytes of a flash row, the smallest unit of a write."""

BOOT_ROW_COUNT = 256
"""Rows of the PSoC 4200's one flash array: 32,768 bytes."""

BOOT_CONFIGURATION_ROW = 252
BOOT_METADATA_ROW = 254
"""First of the two rows of each record; the rows are written alternately."""

BOOT_SLOT_NONE = 0xFF
"""No slot; a slot is 0 (A) or 1 (B)."""

BOOT_TRIES = 3
"""Number of starts of an image on trial before the bootloader gives up on it, unless it confirms itself."""

BOOT_DEFAULT_ADDRESS = 0x77
"""7-bit I2C address of a board without a configuration."""

BOOT_LISTEN_US = 100_000
"""Time in microseconds for which a bootloader waits for a host before it starts an image; not after a commanded
reset."""

BOOT_GAP_US = 50_000
"""Silence on a UART, in microseconds, after which an incomplete packet is discarded."""

BOOT_SILICON_ID = 0x04C81193
"""Silicon id of a CY8C4245AXI-483."""

BOOT_SILICON_ID_16K = 0x04FA1193
"""Silicon id that a bootloader for 16 KiB of flash reports: that of a CY8C4244AXI-443. The id of the CY8C4244AZI-443 in
the 48-TQFP package is not published (confirm)."""

BOOT_SILICON_ID_64K = 0x1B2511AB
"""Silicon id of a CY8C4146AXI-S433 (PSoC 4100S): manufacturer's device header."""

BOOT_PACKET_START = 0x01
BOOT_PACKET_END = 0x17
BOOT_PACKET_OVERHEAD = 7
BOOT_PACKET_MAX = 64
BOOT_KEY_SIZE = 6

BOOT_IMAGE_MAGIC = int.from_bytes(b"TXLI", "little")
BOOT_METADATA_MAGIC = int.from_bytes(b"TXLM", "little")
BOOT_CONFIGURATION_MAGIC = int.from_bytes(b"TXLC", "little")


class BootCommand(IntEnum):
    """Commands from a host to a bootloader."""

    VERIFY_APPLICATION = 0x31
    GET_FLASH_SIZE = 0x32
    GET_APPLICATION_STATUS = 0x33
    ERASE_ROW = 0x34
    SYNC = 0x35
    SET_ACTIVE = 0x36
    SEND_DATA = 0x37
    ENTER = 0x38
    PROGRAM_ROW = 0x39
    VERIFY_ROW = 0x3A
    EXIT = 0x3B
    GET_METADATA = 0x3C
    GET_INFO = 0x50
    SEARCH = 0x51
    READ_CONFIGURATION = 0x52
    WRITE_CONFIGURATION = 0x53


class BootStatus(IntEnum):
    """Result of a packet sent to the bootloader."""

    OK = 0x00
    KEY = 0x01
    VERIFY = 0x02
    LENGTH = 0x03
    DATA = 0x04
    COMMAND = 0x05
    DEVICE = 0x06
    VERSION = 0x07
    CHECKSUM = 0x08
    ARRAY = 0x09
    ROW = 0x0A
    ROW_PROTECTED = 0x0B
    APPLICATION = 0x0C
    ACTIVE = 0x0D
    CALLBACK = 0x0E
    UNKNOWN = 0x0F


class BootDevice(IntEnum):
    """Device on which a firmware image runs.

    BOARD_16K: a sensor board whose part has 16 KiB of flash, with one slot. BOARD_64K, HUB_64K: a sensor board or a hub
    with a PSoC 4100S, which has 64 KiB.
    """

    BOARD = 1
    HUB = 2
    BOARD_16K = 3
    BOARD_64K = 4
    HUB_64K = 5


HUBS = (BootDevice.HUB, BootDevice.HUB_64K)
"""Devices that are a hub; the others are sensor boards."""


class BootChecksum(IntEnum):
    """Type of checksum of bootloader packets; the numbers are those of a .cyacd header.

    ANY: the checksum of the host's first packet is used.
    """

    SUM = 0
    CRC = 1
    ANY = 2


class BootStay(IntEnum):
    """Reason why a bootloader has not started a firmware image."""

    LISTENING = 0
    REQUESTED = 1
    NO_IMAGE = 2
    HOST = 3


ImageHeader = Struct(
    "magic" / Int32ul,
    "header_version" / Int8ul,
    "device" / Int8ul,
    "kind" / Int8ul,
    "slot" / Int8ul,
    "version_major" / Int8ul,
    "version_minor" / Int8ul,
    "version_patch" / Int8ul,
    "reserved_a" / Int8ul,
    "length" / Int32ul,
    "vectors" / Int32ul,
    "reserved_b" / Bytes(8),
    "crc32" / Int32ul,
)
"""The first 32 bytes of an image. kind: design of the board, 0 for any. length: of the image with this header, a
multiple of 4. vectors: address of its vector table. crc32: of bytes 0 to 27, then of bytes 32 to length - 1."""

Record = Struct(
    "magic" / Int32ul,
    "sequence" / Int32ul,
    "payload" / Bytes(112),
    "crc32" / Int32ul,
    "balance" / Int32ul,
)
"""One row of a pair that is written alternately. crc32: of the 120 bytes before it. balance: 1 if the row's other
32-bit words add up to zero, else 0; the processor's flash does not reliably store a row whose words add up to zero."""

Metadata = Struct(
    "confirmed" / Int8ul,
    "pending" / Int8ul,
    "tries" / Bytes(2),
)
"""Front of a metadata record's payload. confirmed, pending: a slot or FF. tries: remaining starts of each slot."""

Configuration = Struct(
    "version" / Int8ul,
    "address" / Int8ul,
    "kind" / Int8ul,
    "reserved" / Int8ul,
    "serial_number" / Bytes(16),
    "idac_codes" / Bytes(16),
)
"""Front of a configuration record's payload. serial_number: ASCII, padded with zeros. idac_codes: calibrated current
code of each RX line; 0: the code of the scan settings applies."""

EnterReply = Struct(
    "silicon_id" / Int32ul,
    "revision" / Int8ul,
    "bootloader_version" / Bytes(3),
)

FlashSizeReply = Struct(
    "first_row" / Int16ul,
    "last_row" / Int16ul,
)
"""Rows that this session may write: those of the slot that is not protected."""

RowAddress = Struct(
    "array" / Int8ul,
    "row" / Int16ul,
)

StockMetadata = Struct(
    "checksum" / Int8ul,
    "entry" / Int32ul,
    "last_bootloader_row" / Int16ul,
    "reserved_a" / Bytes(2),
    "length" / Int32ul,
    "reserved_b" / Bytes(3),
    "active" / Int8ul,
    "verified" / Int8ul,
    "bootloader_version" / Int16ul,
    "application_id" / Int16ul,
    "application_version" / Int16ul,
    "custom_id" / Int32ul,
    "reserved_c" / Bytes(28),
)
"""Reply to GET_METADATA, in the format of the stock bootloader. custom_id: the image's CRC-32; checksum is 0."""

Info = Struct(
    "version" / Int8ul,
    "device" / Int8ul,
    "stay" / Int8ul,
    "target" / Int8ul,
    "confirmed" / Int8ul,
    "pending" / Int8ul,
    "tries" / Bytes(2),
    "address" / Int8ul,
    "kind" / Int8ul,
    "unique_id" / Bytes(8),
)
"""Reply to GET_INFO. stay: reason why no image runs (BootStay). target: the slot that a host may write."""

SearchArguments = Struct(
    "bits" / Int8ul,
    "unique_id" / Bytes(8),
)
"""Boards whose unique id begins with these bits (most significant bit of byte 0 first) answer from now on; all other
boards do not respond until a later search includes them."""

SearchReply = Struct(
    "unique_id" / Bytes(8),
    "complement" / Bytes(8),
)
"""If several boards answer at once, the bus carries the AND of their replies: where they differ, both bits are 0."""

WriteConfigurationArguments = Struct(
    "unique_id" / Bytes(8),
    "configuration" / Configuration,
)
"""unique_id: id of the addressed board."""


@dataclass(frozen=True)
class FlashLayout:
    """Use of the flash rows of a device.

    first_rows: first row of each slot for a firmware image, of A and of B; a part with 16 KiB has slot A only. The
    bootloader has the rows before slot A.
    slot_rows: rows of each slot. row_count: rows of the flash; the last four contain configuration and metadata.
    silicon_id: the id that the bootloader reports.
    """

    device: BootDevice
    first_rows: tuple[int, ...]
    slot_rows: int
    row_count: int = BOOT_ROW_COUNT
    silicon_id: int = BOOT_SILICON_ID

    @property
    def bootloader_rows(self) -> int:
        """Return the number of rows of the bootloader, from row 0 on."""
        return self.first_rows[0]

    @property
    def slot_size(self) -> int:
        """Return the number of bytes of a slot."""
        return self.slot_rows * BOOT_ROW_SIZE

    @property
    def configuration_row(self) -> int:
        """Return the first of the two rows of the configuration record."""
        return self.row_count - 4

    @property
    def metadata_row(self) -> int:
        """Return the first of the two rows of the metadata record."""
        return self.row_count - 2

    def slot_address(self, slot: int) -> int:
        """Return the flash address of a slot's first byte."""
        return self.first_rows[slot] * BOOT_ROW_SIZE


LAYOUTS = {
    BootDevice.BOARD: FlashLayout(BootDevice.BOARD, (32, 142), 110),
    BootDevice.HUB: FlashLayout(BootDevice.HUB, (32, 142), 110),
    BootDevice.BOARD_16K: FlashLayout(BootDevice.BOARD_16K, (32,), 92, 128, BOOT_SILICON_ID_16K),
    BootDevice.BOARD_64K: FlashLayout(BootDevice.BOARD_64K, (64, 286), 222, 512, BOOT_SILICON_ID_64K),
    BootDevice.HUB_64K: FlashLayout(BootDevice.HUB_64K, (64, 286), 222, 512, BOOT_SILICON_ID_64K),
}
"""Flash layout of each device: a bootloader of 4 KiB (8 KiB on a part with 64 KiB), then the slots, then the records.
Two slots of 13.75 KiB on a part with 32 KiB, two of 27.75 KiB with 64 KiB, one of 11.5 KiB with 16 KiB."""
