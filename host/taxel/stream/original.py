"""Python binding of the C decoder for the original hub (firmware/codec/original.c).

`taxel_protocol.original_stream.OriginalDecoder` has the same interface and gives the same results without a library.
"""

import ctypes
import struct
from typing import Any

from taxel.stream.native import load_codec_library
from taxel_protocol.original import ADDRESSES, FORMATS, REFERENCE_TIMES, OriginalFormat, OriginalMessage

BUFFER_MIN = 512
"""`TAXEL_ORIGINAL_BUFFER_MIN`: smallest buffer of the C decoder in bytes."""


class _Format(ctypes.Structure):
    """`struct taxel_original_format` of firmware/codec/original.h."""

    _fields_ = (
        ("taxels", ctypes.c_uint8 * ADDRESSES),
        ("accelerations", ctypes.c_uint8 * ADDRESSES),
        ("has_timestamp", ctypes.c_bool),
        ("is_big_endian", ctypes.c_bool),
        ("record_size", ctypes.c_uint8),
    )


class _Message(ctypes.Structure):
    """`struct taxel_original_message`."""

    _fields_ = (
        ("words", ctypes.c_void_p),
        ("position", ctypes.c_uint64),
        ("timestamp_ms", ctypes.c_uint32),
        ("address", ctypes.c_uint8),
        ("taxel_count", ctypes.c_uint8),
        ("acceleration_count", ctypes.c_uint8),
        ("is_big_endian", ctypes.c_bool),
        ("is_time_plausible", ctypes.c_bool),
    )


_HANDLER = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.POINTER(_Message))


class _Config(ctypes.Structure):
    """`struct taxel_original_config`."""

    _fields_ = (
        ("buffer", ctypes.c_void_p),
        ("capacity", ctypes.c_size_t),
        ("format", ctypes.POINTER(_Format)),
        ("handler", _HANDLER),
        ("context", ctypes.c_void_p),
    )


class _Candidate(ctypes.Structure):
    """`struct taxel_original_candidate`."""

    _fields_ = (
        ("start", ctypes.c_size_t),
        ("end", ctypes.c_size_t),
        ("is_known", ctypes.c_bool),
        ("has_evidence", ctypes.c_bool),
    )


class _Decoder(ctypes.Structure):
    """`struct taxel_original_decoder`."""

    _fields_ = (
        ("config", _Config),
        ("fill", ctypes.c_size_t),
        ("scan", ctypes.c_size_t),
        ("strong_end", ctypes.c_size_t),
        ("current", _Candidate),
        ("has_current", ctypes.c_bool),
        ("time_count", ctypes.c_uint8),
        ("time_next", ctypes.c_uint8),
        ("times", ctypes.c_uint32 * REFERENCE_TIMES),
        ("base", ctypes.c_uint64),
        ("covered", ctypes.c_uint64),
        ("messages", ctypes.c_uint64),
        ("discarded_bytes", ctypes.c_uint64),
        ("rejected_candidates", ctypes.c_uint64),
        ("ambiguous_candidates", ctypes.c_uint64),
    )


class NativeOriginalDecoder:
    """Decoder of one stream of the original hub, in C; the counters are those of `OriginalDecoder`.

    library: the codec library; None: the library of the package. capacity: size of the decoder's buffer in bytes.
    Raises ValueError for a buffer below 512 bytes.
    """

    def __init__(
        self,
        message_format: OriginalFormat = FORMATS["original"],
        library: ctypes.CDLL | None = None,
        capacity: int = BUFFER_MIN,
    ) -> None:
        """Create the decoder with its C state and buffer.

        message_format: fields and boards of the messages. library, capacity: as for the class. Raises ValueError.
        """
        self.format = message_format
        self._library = load_codec_library() if library is None else library
        self._messages: list[OriginalMessage] = []
        self._order = ">" if message_format.is_big_endian else "<"
        self._layout = _Format(
            has_timestamp=message_format.has_timestamp,
            is_big_endian=message_format.is_big_endian,
            record_size=message_format.record_size,
        )
        for address, taxels in message_format.taxels.items():
            self._layout.taxels[address] = taxels
            # A board with an accelerometer sends one value for each of three axes.
            self._layout.accelerations[address] = 3 * (address in message_format.accelerated)
        self._buffer = ctypes.create_string_buffer(capacity)
        self._handler = _HANDLER(self._append_message)
        memory = (ctypes.addressof(self._buffer), capacity)
        self._config = _Config(*memory, ctypes.pointer(self._layout), self._handler, None)
        self._state = _Decoder()
        if self._library.taxel_original_init(ctypes.byref(self._state), ctypes.byref(self._config)):
            raise ValueError(f"buffer of the original decoder: expected {BUFFER_MIN} bytes or more, found {capacity}")

    def _append_message(self, _: int | None, pointer: Any) -> None:
        """Store a message that the C decoder has found. The C decoder calls this method."""
        message = pointer.contents
        words = message.taxel_count + message.acceleration_count
        data = ctypes.string_at(message.words, 2 * words)
        counts = struct.unpack_from(f"{self._order}{message.taxel_count}H", data)
        accelerations = struct.unpack_from(f"{self._order}{message.acceleration_count}h", data, 2 * message.taxel_count)
        time_ms = message.timestamp_ms if self.format.has_timestamp else None
        self._messages.append(
            OriginalMessage(
                message.address, time_ms, counts, accelerations, message.position, message.is_time_plausible
            )
        )

    def push(self, data: bytes) -> list[OriginalMessage]:
        """Decode the next bytes of the stream; return the messages that they complete, in order."""
        self._messages = []
        self._library.taxel_original_push(ctypes.byref(self._state), data, ctypes.c_size_t(len(data)))
        return self._messages

    def finish(self) -> list[OriginalMessage]:
        """End the stream; return the messages in the remaining bytes. Incomplete messages are rejected."""
        self._messages = []
        self._library.taxel_original_finish(ctypes.byref(self._state))
        return self._messages

    @property
    def position(self) -> int:
        """Number of bytes of the stream that were passed to the decoder."""
        return int(self._state.base + self._state.fill)

    @property
    def pending_bytes(self) -> int:
        """Number of bytes that may belong to an incomplete message and are not decided yet."""
        return int(self.position - self._state.covered)

    @property
    def messages(self) -> int:
        """Number of accepted messages."""
        return int(self._state.messages)

    @property
    def discarded_bytes(self) -> int:
        """Number of bytes in no accepted message."""
        return int(self._state.discarded_bytes)

    @property
    def rejected_candidates(self) -> int:
        """Number of message headers that were rejected because the byte at the stated length is no end byte."""
        return int(self._state.rejected_candidates)

    @property
    def ambiguous_candidates(self) -> int:
        """Number of possible messages that were complete but overlap a more plausible one."""
        return int(self._state.ambiguous_candidates)
