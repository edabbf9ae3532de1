"""Constants shared by both sides. The generator copies every upper-case name of this module into the C header."""

PROTOCOL_VERSION = 3
"""Protocol version of this package; a hub answers HOST_HANDSHAKE with the highest version that both sides support."""

PROTOCOL_VERSION_MIN = 1
"""Oldest protocol version that this package still supports."""

REGISTER_MAP_VERSION = 2
"""Version of the board's I2C register map; version 2 added compact snapshots. A board reports the oldest version whose
readers can read its map; additions that such readers may ignore are counted by REGISTER_MAP_REVISION."""

REGISTER_MAP_REVISION = 1
"""Additions to the register map within its version; revision 1 added the key of ENTER_BOOTLOADER and the fault record.
Boards of revision 0 enter their bootloader without a key."""

REGISTER_MAP_VERSION_MIN = 1
"""Oldest register map that a hub still polls; boards without compact snapshots report this version."""

WHO_AM_I = 0x54
"""First register of every sensor board (ASCII 'T')."""

ADDRESS_MIN = 0x08
ADDRESS_MAX = 0x77
"""7-bit I2C addresses outside 0x08..0x77 are reserved by the I2C specification (UM10204, table 4)."""

LINES_MAX = 16
"""Largest number of TX or RX lines of a board: the crossing map then fits one SMBus block of 32 bytes."""

TAXELS_MAX = 240
"""Largest number of taxels of a board: a snapshot then fits the 16 SMBus blocks at 0x80..0x8F."""

SMBUS_BLOCK = 32
"""Largest number of bytes that an SMBus host reads in one transaction."""

CROSSING_MAP_SIZE = 32
"""Bytes of the crossing map: one bit per crossing, bit tx * columns + rx, least significant bit first."""

SNAPSHOT_OVERHEAD = 10
"""Bytes of a snapshot in addition to its counts: sequence 2, timestamp 4, CRC-32 4."""

COMPACT_OVERHEAD_PACKED = 11
"""Bytes of a packed frame in addition to its counts: header 3, timestamp 4, CRC-32 4."""

COMPACT_OVERHEAD_DELTA = 12
"""Bytes of a delta frame in addition to its coded counts: header 3, key frame 2, timestamp 3, CRC-32 4."""

COMPACT_TAXELS_MAX = 238
"""Largest number of taxels of a board with compact snapshots: the longest compact snapshot is then no longer than the
longest uncompressed one."""

COMPACT_SIZE_MAX = 488
"""Longest compact snapshot in bytes: COMPACT_TAXELS_MAX counts of 16 bits."""

COMPACT_LENGTH_FINE = 0x80
"""Length bytes below this value count bytes; from this value on, the low seven bits count steps of COMPACT_LENGTH_STEP
bytes."""

COMPACT_LENGTH_STEP = 4

COMPACT_WIDTH_MASK = 0x1F
"""Bits of a compact snapshot's `format` that hold the width of a packed count in bits; 0: delta frame."""

COMPACT_START_MASK = 0x60
"""Bits of `format` of a packed key frame: the initial scale of its taxels."""

COMPACT_START_SHIFT = 5

COMPACT_KEY_FRAME = 0x80
"""Bit of `format` that marks a key frame: once acknowledged, this snapshot produces the next key frame."""

ACKNOWLEDGE_FORGET = 0x80
"""Bit of an acknowledgement's address: the host has no key frame of this board."""

ACKNOWLEDGE_MAX = 22
"""Largest number of acknowledgements in one ACKNOWLEDGE frame."""

TRANSFER_MAX = 64
"""Largest number of bytes written, or read, by one I2C_TRANSFER command."""

BOOTLOADER_KEY = 0x544F4F42
"""Argument of ENTER_BOOTLOADER, for the hub and for a board: the characters BOOT."""

LOG_TEXT_MAX = 64
"""Largest number of bytes of text in one LOG frame."""

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
REGISTER_FAULT = 0x90
REGISTER_COMPACT = 0xA0
"""Register addresses."""
