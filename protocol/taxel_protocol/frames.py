"""Payloads of the hub's UART frames, one construct definition each. All numbers are little-endian."""

from dataclasses import dataclass

from construct import Bytes, GreedyBytes, Int8ul, Int16ul, Int32ul, Int64ul, Struct, this

from taxel_protocol.limits import (
    ACKNOWLEDGE_MAX,
    COMPACT_OVERHEAD_DELTA,
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
"""First frame of a host. The format of this frame and of HubHandshake is the same in every protocol version."""

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
"""Answer to HostHandshake; also sent once after a restart (tag 0, version_chosen 0). version_chosen 0: no version in
common, or no handshake yet."""

TaxelHeader = Struct(
    "address" / Int8ul,
    "taxel_count" / Int8ul,
    "cycle" / Int16ul,
    "hub_time_us" / Int32ul,
)
"""Header that the hub puts before a board's snapshot. cycle: poll cycle, modulo 65536; the frames of one cycle show the
skin at the same time. hub_time_us: the hub's clock when the read began."""

Taxels = Struct(
    "header" / TaxelHeader,
    "snapshot" / snapshot(this._.header.taxel_count),
)
"""One board's snapshot as the board sent it, its own CRC-32 included."""

CompactTaxels = Struct(
    "header" / TaxelHeader,
    "snapshot" / CompactHeader,
    "data" / GreedyBytes,
)
"""One board's compact snapshot as the board sent it, with its own CRC-32 but without its length byte."""

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
"""frames_sent and bytes_sent: frames, and bytes with delimiters, written to the UART's buffer before this frame, modulo
2^32. frames_dropped: frames of any type that did not fit the UART's buffer. cycle_time_us: duration of the last poll
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
"""Outcome counters of the polls of a board.

polls = forwarded + repeated + nacks + timeouts + crc_errors + bus_errors + dropped, plus one while a poll of this
board is in progress. repeated: the board had no newer scan. dropped: read correctly, but the UART's buffer was full.
Retries are not counted as polls.
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
"""Sent for the first of consecutive failures of a board and at their end (RECOVERED), not for each failure."""

TimeSync = Struct(
    "address" / Int8ul,
    "board_time_us" / Int32ul,
    "hub_time_us" / Int64ul,
)
"""The clocks of board and hub at the same instant: the board latches its clock when the hub addresses it."""

Log = Struct(
    "level" / Int8ul,
    "code" / Int16ul,
    "hub_time_us" / Int32ul,
    "text" / GreedyBytes,
)
"""Human-readable message: ASCII, at most 64 bytes."""

Reply = Struct(
    "tag" / Int8ul,
    "command" / Int8ul,
    "status" / Int8ul,
    "data" / GreedyBytes,
)
"""Answer that ends a command. data: SCAN_BUS: one byte for each address that acknowledged. I2C_TRANSFER: the bytes
read. GET_TIME: GetTimeReply.
"""

CommandPayload = Struct(
    "tag" / Int8ul,
    "command" / Int8ul,
    "arguments" / GreedyBytes,
)
"""tag: chosen by the host, repeated in the reply."""

Acknowledgement = Struct(
    "address" / Int8ul,
    "key_frame" / Int16ul,
)
"""Acknowledgement for one board. Bit 7 of address clear: `key_frame` holds the low 16 bits of the CRC-32 of the decoded
key frame. Bit 7 set: the host has no key frame of this board, and `key_frame` is ignored."""

Acknowledge = Struct("acknowledgements" / GreedyBytes)
"""1 to ACKNOWLEDGE_MAX acknowledgements; the hub sends no reply."""

StartArguments = Struct("flags" / Int8ul)
"""START, from protocol version 2 on; flags: bits of StartFlag, 0 if the argument is missing."""

SetRateArguments = Struct("period_us" / Int32ul)
"""SET_RATE: shortest time from the start of one poll cycle to the next; 0: as fast as the bus allows."""

EnterBootloaderArguments = Struct("key" / Int32ul)
"""ENTER_BOOTLOADER: `limits.BOOTLOADER_KEY`, so that a damaged command cannot stop the hub's application."""

TransferArguments = Struct(
    "address" / Int8ul,
    "read_length" / Int8ul,
    "data" / GreedyBytes,
)
"""I2C_TRANSFER: write `data` (may be empty), then, after a repeated start, read `read_length` bytes (may be 0)."""

SetScanSettingsArguments = Struct(
    "address" / Int8ul,
    "settings" / ScanSettings,
    "front_end" / Int8ul,
)
"""SET_SCAN_SETTINGS: address 0 selects every board. front_end: converter for which the settings are (`names.FrontEnd`),
CAPSENSE if the argument is missing."""

GetBoardInfoArguments = Struct("address" / Int8ul)
"""GET_BOARD_INFO: address 0 selects every board; the hub sends one BOARD_INFO frame per board, then the reply."""

GetTimeReply = Struct("hub_time_us" / Int64ul)
"""GET_TIME: the hub's clock when the command's last byte had arrived."""


@dataclass(frozen=True)
class FrameSpec:
    """Payloads that a frame type allows; a decoder checks them before the CRC.

    `minimum` and `maximum` are payload lengths in bytes. `has_address`: the payload's first byte is a board's address.
    """

    payload: Struct
    minimum: int
    maximum: int
    has_address: bool = False


def _fixed(payload: Struct, has_address: bool = False) -> FrameSpec:
    """Return the specification of a frame type whose payload has a fixed size."""
    size = payload.sizeof()
    return FrameSpec(payload, size, size, has_address)


FRAMES: dict[FrameType, FrameSpec] = {
    FrameType.HUB_HANDSHAKE: _fixed(HubHandshake),
    FrameType.TAXELS: FrameSpec(Taxels, 8 + SNAPSHOT_OVERHEAD + 2, 8 + SNAPSHOT_OVERHEAD + 2 * TAXELS_MAX, True),
    FrameType.COMPACT_TAXELS: FrameSpec(CompactTaxels, 8 + COMPACT_OVERHEAD_DELTA, 8 + COMPACT_SIZE_MAX, True),
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
"""Every frame type of this version. COMPACT_TAXELS and ACKNOWLEDGE exist since version 2; a decoder of version 1
rejects them."""

assert max(spec.maximum for spec in FRAMES.values()) == PAYLOAD_MAX
