"""The bytes between sensor boards, hub and host: definitions, limits and a reference codec.

`registers` is the I2C register map of a sensor board, `frames` defines the hub's UART frames, `framing` encodes and
decodes them. `SPEC.md` in the parent folder explains every byte.
"""

from taxel_protocol.framing import ReferenceDecoder, crc32, decode_body, encode_body, encode_frame
from taxel_protocol.limits import PROTOCOL_VERSION, PROTOCOL_VERSION_MIN, SNAPSHOT_OVERHEAD
from taxel_protocol.names import (
    BoardCommand,
    BoardFault,
    BoardState,
    Command,
    FrameType,
    LogLevel,
    ReplyStatus,
    ResetCause,
)

__all__ = [
    "PROTOCOL_VERSION",
    "PROTOCOL_VERSION_MIN",
    "SNAPSHOT_OVERHEAD",
    "BoardCommand",
    "BoardFault",
    "BoardState",
    "Command",
    "FrameType",
    "LogLevel",
    "ReferenceDecoder",
    "ReplyStatus",
    "ResetCause",
    "crc32",
    "decode_body",
    "encode_body",
    "encode_frame",
]
