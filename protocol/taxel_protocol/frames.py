"""Payloads of the hub's UART frames, one construct definition each. All numbers are little-endian."""

from dataclasses import dataclass

from construct import Bytes, GreedyBytes, Int8ul, Int16ul, Int32ul, Int64ul, Struct, this

from taxel_protocol.limits import (
    ACKNOWLEDGE_MAX,
    COMPACT_OVERHEAD_CODED,
    COMPACT_SIZE_MAX,
    LOG_TEXT_MAX,
    PAYLOAD_MAX,
    SNAPSHOT_OVERHEAD,
    TAXELS_MAX,
    TRANSFER_MAX,
)
from taxel_protocol.names import FrameType
from taxel_protocol.registers import CompactHeader, Identity, ScanSettings, snapshot

HostHandshake = Struct(
    "tag" / Int8ul,
    "version_min" / Int8ul,
    "version_max" / Int8ul,
)
"""First words of a host. This frame and HubHandshake keep their form in every version of the protocol."""

HubHandshake = Struct(
    "tag" / Int8ul,
    "version_min" / Int8ul,
    "version_max" / Int8ul,
    "version_chosen" / Int8ul,
    "reset_cause" / Int8ul,
    "firmware_major" / Int8ul,
    "firmware_minor" / Int8ul,
    "firmware_patch" / Int8ul,
    "unique_id" / Bytes(8),
    "uptime_us" / Int64ul,
)
"""Answer to HostHandshake, and sent once after a restart (tag 0, version_chosen 0). version_chosen 0: no common version."""

TaxelHeader = Struct(
    "address" / Int8ul,
    "taxel_count" / Int8ul,
    "cycle" / Int16ul,
    "hub_time_us" / Int32ul,
)
"""What the hub puts before a board's snapshot. cycle: poll cycle, modulo 65536; the frames of one cycle show the skin
at one time. hub_time_us: the hub's clock when the read began."""

Taxels = Struct(
    "header" / TaxelHeader,
    "snapshot" / snapshot(this._.header.taxel_count),
)
"""One board's snapshot as the board sent it, its own CRC-32 included."""

CompactTaxels = Struct(
    "header" / TaxelHeader,
    "snapshot" / CompactHeader,
    "rest" / GreedyBytes,
)
"""One board's compact snapshot as the board sent it, without its length byte, its own CRC-32 included."""

HubStatus = Struct(
    "uptime_us" / Int64ul,
    "cycles" / Int32ul,
    "cycle_time_us" / Int32ul,
    "frames_sent" / Int32ul,
    "bytes_sent" / Int32ul,
    "frames_dropped" / Int32ul,
    "commands" / Int32ul,
    "commands_rejected" / Int32ul,
    "bus_recoveries" / Int32ul,
    "boards_streaming" / Int8ul,
    "streaming" / Int8ul,
)
"""frames_sent and bytes_sent count what was put into the UART before this frame (bytes with delimiters), modulo 2^32.
frames_dropped: frames of any type that found no room in the UART's buffer. cycle_time_us: length of the last poll
cycle."""

BoardStatus = Struct(
    "address" / Int8ul,
    "state" / Int8ul,
    "last_fault" / Int8ul,
    "polls" / Int32ul,
    "forwarded" / Int32ul,
    "repeated" / Int32ul,
    "nacks" / Int32ul,
    "timeouts" / Int32ul,
    "crc_errors" / Int32ul,
    "bus_errors" / Int32ul,
    "dropped" / Int32ul,
    "retries" / Int32ul,
)
"""Where every poll of a board went.

polls = forwarded + repeated + nacks + timeouts + crc_errors + bus_errors + dropped, and one more while a poll of this
board is under way. repeated: the board had no newer scan. dropped: read well, but the UART's buffer was full. retries
are not polls.
"""

BoardInfo = Struct(
    "identity" / Identity,
    "settings" / ScanSettings,
)
"""A board's identity registers as the hub read them, and the scan settings in force."""

BoardFaultReport = Struct(
    "address" / Int8ul,
    "fault" / Int8ul,
    "cycle" / Int16ul,
    "hub_time_us" / Int32ul,
    "consecutive" / Int16ul,
)
"""Sent when a board's outcome changes (first failure of a row, or RECOVERED), not for each failure."""

TimeSync = Struct(
    "address" / Int8ul,
    "board_time_us" / Int32ul,
    "hub_time_us" / Int64ul,
)
"""The board's clock and the hub's clock at one instant: the board latched its clock when the hub addressed it."""

Log = Struct(
    "level" / Int8ul,
    "code" / Int16ul,
    "hub_time_us" / Int32ul,
    "text" / GreedyBytes,
)
"""Text for people: ASCII, at most 64 bytes."""

Reply = Struct(
    "tag" / Int8ul,
    "command" / Int8ul,
    "status" / Int8ul,
    "data" / GreedyBytes,
)
"""Ends a command. data: SCAN_BUS: one byte for each address that answered. I2C_TRANSFER: the bytes read. GET_TIME:
GetTimeReply.
"""

CommandPayload = Struct(
    "tag" / Int8ul,
    "command" / Int8ul,
    "arguments" / GreedyBytes,
)
"""tag: chosen by the host, repeated in the reply."""

Acknowledgement = Struct(
    "address" / Int8ul,
    "reference" / Int16ul,
)
"""For one board. Bit 7 of address: forget the reference; `reference` then means nothing. Else the low 16 bits of the
CRC-32 of the candidate that was decoded."""

Acknowledge = Struct("acknowledgements" / GreedyBytes)
"""1 to ACKNOWLEDGE_MAX times Acknowledgement; there is no reply."""

StartArguments = Struct("flags" / Int8ul)
"""START, from version 2 on; without arguments: flags 0. Bits: StartFlag."""

SetRateArguments = Struct("period_us" / Int32ul)
"""SET_RATE: shortest time from the start of one poll cycle to the next; 0: as fast as the bus allows."""

EnterBootloaderArguments = Struct("key" / Int32ul)
"""ENTER_BOOTLOADER: `limits.BOOTLOADER_KEY`, so that no chance command leaves a hub without its firmware."""

TransferArguments = Struct(
    "address" / Int8ul,
    "read_length" / Int8ul,
    "data" / GreedyBytes,
)
"""I2C_TRANSFER: write `data` (may be empty), then, after a repeated start, read `read_length` bytes (may be 0)."""

SetScanSettingsArguments = Struct(
    "address" / Int8ul,
    "settings" / ScanSettings,
)
"""SET_SCAN_SETTINGS: address 0 is every board."""

GetBoardInfoArguments = Struct("address" / Int8ul)
"""GET_BOARD_INFO: address 0 is every board; the answer is one BOARD_INFO frame a board, then the reply."""

GetTimeReply = Struct("hub_time_us" / Int64ul)
"""GET_TIME: the hub's clock when the command's last byte had arrived."""


@dataclass(frozen=True)
class FrameSpec:
    """Which payloads a frame type allows; a decoder checks it before it believes a CRC.

    `minimum` and `maximum` are payload lengths in bytes. `has_address`: the payload's first byte is a board's address.
    """

    payload: Struct
    minimum: int
    maximum: int
    has_address: bool = False


def _fixed(payload: Struct, has_address: bool = False) -> FrameSpec:
    size = payload.sizeof()
    return FrameSpec(payload, size, size, has_address)


FRAMES: dict[FrameType, FrameSpec] = {
    FrameType.HUB_HANDSHAKE: _fixed(HubHandshake),
    FrameType.TAXELS: FrameSpec(Taxels, 8 + SNAPSHOT_OVERHEAD + 2, 8 + SNAPSHOT_OVERHEAD + 2 * TAXELS_MAX, True),
    FrameType.COMPACT_TAXELS: FrameSpec(CompactTaxels, 8 + COMPACT_OVERHEAD_CODED, 8 + COMPACT_SIZE_MAX, True),
    FrameType.HUB_STATUS: _fixed(HubStatus),
    FrameType.BOARD_STATUS: _fixed(BoardStatus, has_address=True),
    FrameType.BOARD_INFO: _fixed(BoardInfo),
    FrameType.BOARD_FAULT: _fixed(BoardFaultReport, has_address=True),
    FrameType.TIME_SYNC: _fixed(TimeSync, has_address=True),
    FrameType.LOG: FrameSpec(Log, 7, 7 + LOG_TEXT_MAX),
    FrameType.REPLY: FrameSpec(Reply, 3, 3 + 128),
    FrameType.HOST_HANDSHAKE: _fixed(HostHandshake),
    FrameType.COMMAND: FrameSpec(CommandPayload, 2, 4 + TRANSFER_MAX),
    FrameType.ACKNOWLEDGE: FrameSpec(Acknowledge, 3, 3 * ACKNOWLEDGE_MAX),
}
"""Every frame type of this version. COMPACT_TAXELS and ACKNOWLEDGE came with version 2: a decoder of version 1 refuses
them."""

assert max(spec.maximum for spec in FRAMES.values()) == PAYLOAD_MAX
