"""Generated from protocol/taxel_protocol by tools/codegen/clients.py (make generate). Do not edit."""

ADDRESS_MIN = 8
ADDRESS_MAX = 119
BODY_MAX = 507
PAYLOAD_MAX = 498
FRAME_HEADER_SIZE = 5
FRAME_CRC_SIZE = 4
SNAPSHOT_OVERHEAD = 10
WHITENING_SEED = 165
WHITENING_FACTOR = 5
WHITENING_INCREMENT = 107
TYPE_TAXELS = 2

FRAMES = {
    0x01: (False, 24, 24),  # HUB_HANDSHAKE
    0x02: (True, 20, 498),  # TAXELS
    0x03: (True, 20, 496),  # COMPACT_TAXELS
    0x08: (False, 42, 42),  # HUB_STATUS
    0x09: (True, 39, 39),  # BOARD_STATUS
    0x0A: (False, 66, 66),  # BOARD_INFO
    0x0B: (True, 10, 10),  # BOARD_FAULT
    0x0C: (True, 13, 13),  # TIME_SYNC
    0x0D: (False, 7, 71),  # LOG
    0x0E: (False, 3, 131),  # REPLY
    0x81: (False, 3, 3),  # HOST_HANDSHAKE
    0x82: (False, 2, 68),  # COMMAND
    0x83: (False, 3, 66),  # ACKNOWLEDGE
}
"""Whether the payload begins with the address of a board, and its shortest and longest size, by frame type."""
