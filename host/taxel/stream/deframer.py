"""Python binding of the firmware's frame-by-frame deframer (firmware/codec/deframer.c), for tests and fuzzers.

The batch decoder of `taxel.stream.decoder` is much faster.
"""

import ctypes
from collections.abc import Iterable
from typing import Any

from taxel.stream.native import load_codec_library
from taxel_protocol.limits import BODY_MAX, ENCODED_MAX, PAYLOAD_MAX

TO_HOST = 1
"""`TAXEL_DIRECTION_TO_HOST`."""
_STATE_SIZE = 1024  # upper bound of the size of `struct taxel_deframer`, bytes


class _Frame(ctypes.Structure):
    """C structure `struct taxel_frame` of firmware/codec/deframer.h: one decoded frame."""

    _fields_ = (
        ("payload", ctypes.POINTER(ctypes.c_uint8)),
        ("length", ctypes.c_uint16),
        ("sequence", ctypes.c_uint16),
        ("type", ctypes.c_uint8),
    )


_HANDLER = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.POINTER(_Frame))


class _Config(ctypes.Structure):
    """C structure `struct taxel_deframer_config` of firmware/codec/deframer.h: memory and callback of the deframer."""

    _fields_ = (
        ("chunk", ctypes.c_void_p),
        ("chunk_capacity", ctypes.c_size_t),
        ("body", ctypes.c_void_p),
        ("payload_max", ctypes.c_uint16),
        ("directions", ctypes.c_uint8),
        ("handler", _HANDLER),
        ("context", ctypes.c_void_p),
        ("unknown_handler", _HANDLER),
    )


class Deframer:
    """Decoder of complete hub-to-host streams. library: the codec library; None: the library of the package."""

    def __init__(self, library: ctypes.CDLL | None = None) -> None:
        """Create a decoder of hub frames with its C state and memory; library: C codec, None: the package's own."""
        self._library = load_codec_library() if library is None else library
        self._state = ctypes.create_string_buffer(_STATE_SIZE)
        self._chunk = ctypes.create_string_buffer(2 * (ENCODED_MAX + 2))  # two largest frames, as the C code requires
        self._body = ctypes.create_string_buffer(BODY_MAX)
        self._handler = _HANDLER(self._append_frame)
        memory = (ctypes.addressof(self._chunk), len(self._chunk), ctypes.addressof(self._body))
        self._config = _Config(*memory, PAYLOAD_MAX, TO_HOST, self._handler, None, _HANDLER())
        self._frames: list[tuple[int, int, bytes]] = []

    def _append_frame(self, _: int | None, frame: Any) -> None:
        """Store a frame that the C deframer has found. The C deframer calls this method."""
        content = frame.contents
        self._frames.append((content.type, content.sequence, ctypes.string_at(content.payload, content.length)))

    def decode(self, pieces: Iterable[bytes]) -> list[tuple[int, int, bytes]]:
        """Return (type, sequence, payload) of every valid frame in the stream that consists of `pieces`."""
        self._frames = []
        self._library.taxel_deframer_init(self._state, ctypes.byref(self._config))
        for piece in pieces:
            self._library.taxel_deframer_push(self._state, piece, ctypes.c_size_t(len(piece)))
        self._library.taxel_deframer_finish(self._state)
        return self._frames
