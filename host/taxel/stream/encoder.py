"""Encoding of taxel frames as hub bytes, for recordings that contain frames instead of bytes."""

import ctypes
import struct
import zlib
from collections.abc import Iterable, Iterator

from taxel.link import Chunk, LinkError
from taxel.stream.frames import TaxelFrame
from taxel.stream.native import load_codec_library
from taxel_protocol import FrameType
from taxel_protocol.frames import HubStatus
from taxel_protocol.layout import pack
from taxel_protocol.limits import PAYLOAD_MAX

STATUS_PERIOD_S = 1.0
"""Period of the encoded HUB_STATUS frames, seconds, as of a physical hub. The uptime in these frames unwraps the 32-bit
times of taxel frames.
"""

PAUSE_S = 60.0
"""Longest recorded time, seconds, after which `FramesLink.read` returns None once, so that the reader decodes what it
has. Must be below the wrap of 32-bit microseconds.
"""

_HEADERS = struct.Struct("<BBHIHI")
_WIRE_MAX = 2 * PAYLOAD_MAX + 64


def encode_on_wire(frame_type: FrameType, sequence: int, payload: bytes) -> bytes:
    """Encode one frame for the wire with the C encoder; the result equals `taxel_protocol.encode_frame`."""
    out = ctypes.create_string_buffer(_WIRE_MAX)
    encode = load_codec_library().taxel_batch_encode
    encode.restype = ctypes.c_size_t
    size = encode(
        ctypes.c_uint8(frame_type), ctypes.c_uint16(sequence), payload, ctypes.c_uint16(len(payload)), out,
        ctypes.c_size_t(_WIRE_MAX),
    )  # fmt: skip
    return out.raw[:size]


def encode_taxels(frame: TaxelFrame, sequence: int, hub_time_us: int) -> bytes:
    """Encode a TAXELS frame for the wire.

    `sequence`: sequence number of the hub's frame. `hub_time_us`: replaces the hub time of `frame`.
    """
    counts = frame.raw_counts.astype("<u2").tobytes()
    headers = _HEADERS.pack(
        frame.address, len(frame.raw_counts), frame.cycle, hub_time_us % (1 << 32), frame.sequence, frame.board_time_us
    )
    # The board's CRC covers its address and the snapshot; the hub adds the first 8 bytes (address to hub time).
    snapshot = headers[8:] + counts
    crc = zlib.crc32(snapshot, zlib.crc32(headers[:1]))
    return encode_on_wire(FrameType.TAXELS, sequence, headers[:8] + snapshot + crc.to_bytes(4, "little"))


class FramesLink:
    """Read-only link that encodes recorded frames as the bytes of a hub; `time_s` is kept to the microsecond.

    `frames`: taxel frames in order of arrival. The encoded bytes differ from those of the original hub: its messages,
    its `hub_time_us` and the number of frames lost on the wire are not reproduced.
    """

    is_real_time = False
    is_recorded = True
    has_flow_control = False
    has_arrivals = False
    baud = 1e6

    def __init__(self, name: str, frames: Iterable[TaxelFrame]) -> None:
        """Create a link that encodes recorded taxel frames, given in order of arrival, as the bytes of a hub."""
        self.name = name
        self.header: dict[str, object] = {}
        self._frames = iter(frames)
        self._sequence = 0
        self._status_s = float("-inf")
        self._pause_s: float | None = None
        self._postponed: TaxelFrame | None = None

    def read(self, timeout_s: float = 0.0) -> Chunk | None:
        """Return the next taxel frame, encoded as bytes of a hub. Raises EOFError after the last frame.

        Returns None once after each `PAUSE_S` of recorded time, so that the reader decodes the bytes received so far.
        `timeout_s` has no effect.
        """
        frame, self._postponed = self._postponed or next(self._frames, None), None
        if frame is None:
            raise EOFError
        if self._pause_s is None:
            self._pause_s = frame.time_s + PAUSE_S
        if frame.time_s >= self._pause_s:
            self._postponed, self._pause_s = frame, None
            return None
        return Chunk(b"".join(self._encode(frame)), max(0, round(frame.time_s * 1e9)))

    def _encode(self, frame: TaxelFrame) -> Iterator[bytes]:
        """Yield the bytes of a taxel frame; a HUB_STATUS frame precedes it every `STATUS_PERIOD_S` seconds."""
        time_us = max(0, round(frame.time_s * 1e6))
        if frame.time_s >= self._status_s + STATUS_PERIOD_S:
            self._status_s = frame.time_s
            fields = dict.fromkeys((item.name for item in HubStatus.subcons), 0)
            fields |= {"uptime_us": time_us, "streaming": 1, "frames_sent": self._sequence}
            yield encode_on_wire(FrameType.HUB_STATUS, self._next_sequence(), pack(HubStatus, fields))
        yield encode_taxels(frame, self._next_sequence(), time_us)

    def _next_sequence(self) -> int:
        """Return the next 16-bit sequence number of the hub's frames."""
        self._sequence += 1
        return (self._sequence - 1) % (1 << 16)

    def write(self, data: bytes) -> None:
        """Raise LinkError: a recording accepts no commands."""
        raise LinkError(self.name, "is a recording and accepts no commands")

    def close(self) -> None:
        """Close the source of the taxel frames."""
        close = getattr(self._frames, "close", None)
        if close is not None:
            close()
