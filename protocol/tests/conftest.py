"""What the protocol tests share: the C codec through ctypes."""

import ctypes
import importlib.resources
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from taxel_protocol import crc32
from taxel_protocol.frames import TaxelHeader
from taxel_protocol.names import FrameType
from taxel_protocol.registers import SnapshotHeader

LIBRARY_VARIABLE = "TAXEL_CODEC_LIBRARY"
BOARD_CRC_BAD = 1
ROWS, COUNTS, PAYLOAD_BYTES = 1024, 65_536, 65_536


class Row(ctypes.Structure):
    """`struct taxel_batch_row` of firmware/codec/batch.h."""

    _fields_ = [
        ("stream_position", ctypes.c_uint64),
        ("hub_time_us", ctypes.c_uint32),
        ("board_time_us", ctypes.c_uint32),
        ("offset", ctypes.c_uint32),
        ("size", ctypes.c_uint16),
        ("sequence", ctypes.c_uint16),
        ("cycle", ctypes.c_uint16),
        ("board_sequence", ctypes.c_uint16),
        ("type", ctypes.c_uint8),
        ("address", ctypes.c_uint8),
        ("flags", ctypes.c_uint8),
        ("reserved", ctypes.c_uint8),
    ]


@dataclass(frozen=True)
class Seen:
    """A decoded frame as the batch decoder shows it: of a taxel frame all but the board's CRC itself."""

    type: int
    sequence: int
    payload: bytes
    board_crc_ok: bool


class Codec:
    """The C codec: one call encodes a frame, one decodes a stream that arrives in pieces."""

    def __init__(self, path: Path) -> None:
        self.library = ctypes.CDLL(str(path))
        for name in ("struct_size", "row_size", "encode"):
            getattr(self.library, f"taxel_batch_{name}").restype = ctypes.c_size_t
        self.library.taxel_batch_decode.restype = ctypes.c_size_t
        self.library.taxel_batch_discarded_bytes.restype = ctypes.c_uint64
        assert self.library.taxel_batch_row_size() == ctypes.sizeof(Row), "batch.h has another row than this test"
        self._batch = ctypes.create_string_buffer(self.library.taxel_batch_struct_size())
        self._rows = (Row * ROWS)()
        self._counts = (ctypes.c_uint16 * COUNTS)()
        self._payloads = (ctypes.c_uint8 * PAYLOAD_BYTES)()
        self._row_count = ctypes.c_size_t()
        self.discarded_bytes = 0

    @staticmethod
    def seen(frame: tuple[int, int, bytes]) -> Seen:
        """A frame of the reference decoder, in the batch decoder's terms."""
        frame_type, sequence, payload = frame
        if frame_type != FrameType.TAXELS:
            return Seen(frame_type, sequence, payload, True)
        expected = crc32(payload[TaxelHeader.sizeof() : -4], crc32(payload[:1]))
        return Seen(frame_type, sequence, payload[:-4], expected == int.from_bytes(payload[-4:], "little"))

    def encode(self, frame_type: int, sequence: int, payload: bytes) -> bytes:
        out = ctypes.create_string_buffer(1024)
        size = self.library.taxel_batch_encode(
            ctypes.c_uint8(frame_type),
            ctypes.c_uint16(sequence),
            payload,
            ctypes.c_uint16(len(payload)),
            out,
            ctypes.c_size_t(len(out)),
        )
        return out.raw[:size]

    def decode(self, pieces: Iterable[bytes], directions: int = 3) -> list[Seen]:
        frames: list[Seen] = []
        self.library.taxel_batch_init(self._batch, ctypes.c_uint8(directions))
        for piece in pieces:
            taken = 0
            while taken < len(piece):
                rest = piece[taken:]
                taken += self.library.taxel_batch_decode(self._batch, rest, ctypes.c_size_t(len(rest)), *self._output())
                frames += self._found()
        self.library.taxel_batch_finish(self._batch, *self._output())
        self.discarded_bytes = self.library.taxel_batch_discarded_bytes(self._batch)
        return frames + self._found()

    def _output(self) -> tuple[Any, ...]:
        sizes = (ctypes.c_size_t(size) for size in (ROWS, COUNTS, PAYLOAD_BYTES))
        pairs = zip((self._rows, self._counts, self._payloads), sizes, strict=True)
        return (*(part for pair in pairs for part in pair), ctypes.byref(self._row_count))

    def _found(self) -> list[Seen]:
        return [self._seen(self._rows[i]) for i in range(self._row_count.value)]

    def _seen(self, row: Row) -> Seen:
        if row.type != FrameType.TAXELS:
            payload = bytes(self._payloads[row.offset : row.offset + row.size])
            return Seen(row.type, row.sequence, payload, True)
        head = TaxelHeader.build(
            {
                "address": row.address,
                "taxel_count": row.size,
                "cycle": row.cycle,
                "hub_time_us": row.hub_time_us,
            }
        )
        snapshot = SnapshotHeader.build({"sequence": row.board_sequence, "timestamp_us": row.board_time_us})
        counts = b"".join(n.to_bytes(2, "little") for n in self._counts[row.offset : row.offset + row.size])
        return Seen(row.type, row.sequence, head + snapshot + counts, not row.flags & BOARD_CRC_BAD)


def library_path() -> Path:
    """Where the C codec was built. Raises FileNotFoundError with what to do if it was not."""
    named = os.environ.get(LIBRARY_VARIABLE)
    if named:
        return Path(named)
    try:
        path = Path(str(importlib.resources.files("taxel"))) / "native" / "libtaxel_codec.so"
    except ModuleNotFoundError:
        path = Path("taxel/native/libtaxel_codec.so")
    if not path.exists():
        raise FileNotFoundError(
            f"no C codec: {LIBRARY_VARIABLE} is not set and {path} does not exist;"
            " build firmware with CMake and set it, or install the package"
        )
    return path


@pytest.fixture(scope="session")
def codec() -> Codec:
    try:
        return Codec(library_path())
    except (FileNotFoundError, OSError) as error:
        pytest.fail(str(error), pytrace=False)
