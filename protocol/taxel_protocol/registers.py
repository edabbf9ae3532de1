"""The I2C register map of a sensor board. All numbers are little-endian.

A register has a one-byte address, as in SMBus. A read continues from this register byte by byte but does not move the
register pointer: the next read without a write begins at the same register. A snapshot of N taxels is 10 + 2 N bytes
from register 0x80; its 32-byte block k is also readable at register 0x80 + k.
"""

from construct import Array, Bytes, Const, Int8ul, Int16ul, Int32ul, Struct, this

from taxel_protocol.limits import COMPACT_LENGTH_FINE, COMPACT_LENGTH_STEP, CROSSING_MAP_SIZE, WHO_AM_I

Identity = Struct(
    "who_am_i" / Const(WHO_AM_I, Int8ul),
    "map_version" / Int8ul,
    "firmware_major" / Int8ul,
    "firmware_minor" / Int8ul,
    "firmware_patch" / Int8ul,
    "kind" / Int8ul,
    "address" / Int8ul,
    "map_revision" / Int8ul,
    "unique_id" / Bytes(8),
    "rows" / Int8ul,
    "columns" / Int8ul,
    "taxel_count" / Int16ul,
    "snapshot_size" / Int16ul,
    "crossing_map" / Bytes(CROSSING_MAP_SIZE),
    "crc32" / Int32ul,
)
"""Registers 0x00..0x39, fixed from boot. map_version: oldest version whose readers can read this map; map_revision:
additions within the version. rows: TX lines; columns: RX lines; crc32: of the 54 bytes before it."""

Status = Struct(
    "state" / Int8ul,
    "error_flags" / Int8ul,
    "reset_cause" / Int8ul,
    "settings_generation" / Int8ul,
    "clock_us" / Int32ul,
    "scans" / Int32ul,
    "scan_time_us" / Int32ul,
    "snapshot_reads" / Int32ul,
    "bus_errors" / Int16ul,
    "rejected_writes" / Int16ul,
    "front_end" / Int8ul,
    "reserved" / Int8ul,
    "saturated_conversions" / Int16ul,
)
"""Registers 0x40..0x5B. All of them are latched at the same instant, when a read begins. front_end: a code of
`names.FrontEnd`."""

ScanSettings = Struct(
    "sub_conversions" / Int16ul,
    "sense_clock_divider" / Int16ul,
    "modulator_clock_divider" / Int8ul,
    "idac_code" / Int8ul,
    "settle_cycles" / Int16ul,
)
"""How one crossing is measured, on a board with the front end CAPSENSE; another front end defines its own meaning of
the 8 bytes. A conversion takes sub_conversions * sense_clock_divider modulator clocks, each of modulator_clock_divider
CPU clocks, after settle_cycles CPU clocks; its largest count is sub_conversions * sense_clock_divider."""

SettingsRegister = Struct(
    "settings" / ScanSettings,
    "crc32" / Int32ul,
)
"""Registers 0x60..0x6B, read and write. crc32: of the board's address byte and the 8 bytes before it; in a write, the
board's front end follows the address byte unless it is 0, so that settings for another converter are rejected. A write
takes effect at the stop condition, whole or not at all, from the next scan on."""

CommandRegister = Struct(
    "command" / Int8ul,
    "complement" / Int8ul,
)
"""Registers 0x70..0x71, write only. complement: the command with all bits inverted, so that a single damaged byte
never forms a valid command.
"""

EnterBootloaderRegister = Struct(
    "command" / Int8ul,
    "complement" / Int8ul,
    "key" / Int32ul,
)
"""Registers 0x70..0x75 for the command ENTER_BOOTLOADER, from map revision 1 on. key: `limits.BOOTLOADER_KEY`, so that
neither two bytes of another device's protocol nor a mistaken transfer stop the board's application."""

FaultRecord = Struct(
    "code" / Int8ul,
    "exception" / Int8ul,
    "count" / Int16ul,
    "program_counter" / Int32ul,
    "link_register" / Int32ul,
)
"""Last fault of the firmware since power-on; it survives every reset. code: `names.FaultCode`; exception: number of the
exception (3: HardFault), 0 without one; count: faults since power-on. program_counter, link_register: registers of the
interrupted code, 0 without an exception."""

FaultRegister = Struct(
    "record" / FaultRecord,
    "crc32" / Int32ul,
)
"""Register 0x90, read only, from map revision 1 on. crc32: of the board's address byte and the 12 bytes before it."""

SnapshotHeader = Struct(
    "sequence" / Int16ul,
    "timestamp_us" / Int32ul,
)
"""sequence: scans since boot, modulo 65536. timestamp_us: the board's clock when the scan began."""


CompactHeader = Struct(
    "sequence" / Int16ul,
    "format" / Int8ul,
)
"""Common head of all compact snapshots. format: width of a packed count (0: delta frame), and the key frame mark."""

CompactPacked = Struct(
    "sequence" / Int16ul,
    "format" / Int8ul,
    "timestamp_us" / Int32ul,
)
"""Head of a packed frame, which is decoded without a key frame: counts of 1 to 16 bits follow, then crc32."""

CompactDelta = Struct(
    "sequence" / Int16ul,
    "format" / Int8ul,
    "key_frame" / Int16ul,
    "timestamp_low" / Bytes(3),
)
"""Head of a delta frame, which is coded against a key frame. key_frame: low 16 bits of the CRC-32 of the snapshot that
produced the key frame. timestamp_low: bits 0 to 23; the upper bits follow from the key frame's timestamp, which lies 0
to 2^24 - 1 us earlier.
"""

CompactAcknowledge = Struct("key_frame" / Int16ul)
"""Written to register 0xA0: acknowledges the key frame whose CRC-32 has these low 16 bits."""


def decode_length(length: int) -> int:
    """Return the size in bytes of a compact snapshot from the first byte on the bus, its coded length.

    A value below `COMPACT_LENGTH_FINE` is the size itself. Of any other value, the difference from
    `COMPACT_LENGTH_FINE` is the size in units of `COMPACT_LENGTH_STEP` bytes.
    """
    if length < COMPACT_LENGTH_FINE:
        return length
    return COMPACT_LENGTH_STEP * (length - COMPACT_LENGTH_FINE)


def snapshot(taxel_count: int | object = this._.taxel_count) -> Struct:
    """Define a snapshot of `taxel_count` taxels (a number, or a construct expression that gives it).

    crc32 covers the board's 7-bit address as one byte, then every byte of the snapshot before it. A snapshot sent by
    another board, after one flipped address bit, therefore fails the check.
    """
    return Struct(
        "header" / SnapshotHeader,
        "raw_counts" / Array(taxel_count, Int16ul),
        "crc32" / Int32ul,
    )
