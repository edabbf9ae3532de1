"""Numbers that both sides agree on. The generator copies every upper-case name of this module into the C header."""

PROTOCOL_VERSION = 2
"""Version that this package speaks; a hub answers HANDSHAKE with the highest version both know."""

PROTOCOL_VERSION_MIN = 1
"""Oldest version that this package still speaks."""

REGISTER_MAP_VERSION = 2
"""Version of the board's I2C register map: 2 has compact snapshots."""

REGISTER_MAP_VERSION_MIN = 1
"""Oldest map that a hub still polls, and that of a board without compact snapshots."""

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

COMPACT_OVERHEAD_MIN = 11
"""Bytes of a compact snapshot beside its packed counts: header 3, timestamp 4, CRC-32 4."""

COMPACT_OVERHEAD_CODED = 12
"""Bytes of a compact snapshot beside its coded counts: header 3, reference 2, timestamp 3, CRC-32 4."""

COMPACT_TAXELS_MAX = 238
"""Taxels of a board with compact snapshots: the longest one then takes no more room than the longest plain one."""

COMPACT_SIZE_MAX = 488
"""Longest compact snapshot in bytes: COMPACT_TAXELS_MAX counts of 16 bits."""

COMPACT_LENGTH_FINE = 0x80
"""Lengths below it are bytes; from it on, the low seven bits count COMPACT_LENGTH_STEP bytes each."""

COMPACT_LENGTH_STEP = 4

COMPACT_WIDTH_MASK = 0x1F
"""Bits of a compact snapshot's `form` that say how many bits a packed count has; 0: coded against a reference."""

COMPACT_START_MASK = 0x60
"""Bits of `form` of a packed candidate: from which scale its reference begins."""

COMPACT_START_SHIFT = 5

COMPACT_CANDIDATE = 0x80
"""Bit of `form`: acknowledged, this snapshot makes the next reference."""

ACKNOWLEDGE_FORGET = 0x80
"""Bit of an acknowledgement's address: the host has no reference of this board."""

ACKNOWLEDGE_MAX = 22
"""Acknowledgements in one frame."""

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
"""Register addresses."""
