"""Numbers that both sides agree on. The generator copies every upper-case name of this module into the C header."""

PROTOCOL_VERSION = 1
"""Version that this package speaks; a hub answers HELLO with the highest version both know."""

PROTOCOL_VERSION_MIN = 1
"""Oldest version that this package still speaks."""

REGISTER_MAP_VERSION = 1
"""Version of the board's I2C register map."""

WHO_AM_I = 0x54
"""First register of every sensor board (ASCII 'T')."""

ADDRESS_MIN = 0x08
ADDRESS_MAX = 0x77
"""7-bit I2C addresses outside 0x08..0x77 are reserved by the I2C specification (UM10204, table 4)."""

LINES_MAX = 16
"""TX or RX lines of one board, so that a crossing map is one SMBus block of 32 bytes."""

TAXELS_MAX = 240
"""Taxels of one board: a snapshot then fits the 16 SMBus blocks at 0x80..0x8F."""

SMBUS_BLOCK = 32
"""Bytes that an SMBus host reads in one transaction at most."""

CROSSING_MAP_SIZE = 32
"""Bytes of the crossing map: one bit a crossing, bit tx * columns + rx, least significant bit first."""

SNAPSHOT_OVERHEAD = 10
"""Bytes of a snapshot beside its counts: sequence 2, timestamp 4, CRC-32 4."""

TRANSFER_MAX = 64
"""Bytes written, or read, in one I2C pass-through command."""

BOOTLOADER_KEY = 0x544F4F42
"""Argument of ENTER_BOOTLOADER: the characters BOOT."""

LOG_TEXT_MAX = 64
"""Bytes of text in one log frame."""

FRAME_HEADER_SIZE = 5
"""Type 1, sequence 2, payload length 2."""

FRAME_CRC_SIZE = 4

PAYLOAD_MAX = 8 + SNAPSHOT_OVERHEAD + 2 * TAXELS_MAX
"""Longest payload: a taxel frame of TAXELS_MAX taxels."""

BODY_MAX = FRAME_HEADER_SIZE + PAYLOAD_MAX + FRAME_CRC_SIZE
"""Longest frame before byte stuffing."""

ENCODED_MAX = BODY_MAX + BODY_MAX // 254 + 1
"""Longest frame after byte stuffing, without its two delimiters."""

WHITENING_SEED = 0xA5
WHITENING_FACTOR = 5
WHITENING_INCREMENT = 0x6B
"""The whitening sequence is k[0] = seed, k[i+1] = (factor * k[i] + increment) mod 256; period 256 (Hull-Dobell)."""

REGISTER_IDENTITY = 0x00
REGISTER_STATUS = 0x40
REGISTER_CLOCK = 0x44
REGISTER_SETTINGS = 0x60
REGISTER_COMMAND = 0x70
REGISTER_SNAPSHOT = 0x80
REGISTER_SNAPSHOT_LAST = 0x8F
REGISTER_COMPACT = 0xA0
REGISTER_COMPACT_LAST = 0xAF
"""Register addresses; 0xA0..0xAF is reserved for compact snapshots."""
