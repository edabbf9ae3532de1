"""Shared by the protocol tests: the C codec through ctypes."""

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
from taxel_protocol.limits import BODY_MAX, ENCODED_MAX, PAYLOAD_MAX
from taxel_protocol.names import FrameType
from taxel_protocol.registers import SnapshotHeader

LIBRARY_VARIABLE = "TAXEL_CODEC_LIBRARY"
BOARD_CRC_BAD = 1
ROWS, COUNTS, PAYLOAD_BYTES = 2048, 65_536, 65_536

Frame = tuple[int, int, bytes]


class _Frame(ctypes.Structure):
    """`struct taxel_frame` of firmware/codec/deframer.h."""

    _fields_ = [
        ("payload", ctypes.POINTER(ctypes.c_uint8)),
        ("length", ctypes.c_uint16),
        ("sequence", ctypes.c_uint16),
        ("type", ctypes.c_uint8),
    ]


_Handler = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.POINTER(_Frame))


class _DeframerConfig(ctypes.Structure):
    """`struct taxel_deframer_config`."""

    _fields_ = [
        ("chunk", ctypes.c_void_p),
        ("chunk_capacity", ctypes.c_size_t),
        ("body", ctypes.c_void_p),
        ("payload_max", ctypes.c_uint16),
        ("directions", ctypes.c_uint8),
        ("handler", _Handler),
        ("context", ctypes.c_void_p),
        ("unknown_handler", _Handler),
    ]


class _Deframer(ctypes.Structure):
    """`struct taxel_deframer`."""

    _fields_ = [
        ("config", _DeframerConfig),
        ("fill", ctypes.c_size_t),
        ("position", ctypes.c_uint64),
        ("discarded_bytes", ctypes.c_uint64),
        ("frames", ctypes.c_uint64),
        ("unknown_frames", ctypes.c_uint64),
    ]


class _Row(ctypes.Structure):
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
        ("lost_before", ctypes.c_uint16),
        ("missing_before", ctypes.c_uint16),
        ("type", ctypes.c_uint8),
        ("address", ctypes.c_uint8),
        ("flags", ctypes.c_uint8),
        ("reserved", ctypes.c_uint8),
    ]


class _Output(ctypes.Structure):
    """`struct taxel_batch_output`."""

    _fields_ = [
        ("taxel_rows", ctypes.POINTER(_Row)),
        ("message_rows", ctypes.POINTER(_Row)),
        ("counts", ctypes.POINTER(ctypes.c_uint16)),
        ("payloads", ctypes.POINTER(ctypes.c_uint8)),
        ("row_capacity", ctypes.c_size_t),
        ("count_capacity", ctypes.c_size_t),
        ("payload_capacity", ctypes.c_size_t),
        ("taxel_count", ctypes.c_size_t),
        ("message_count", ctypes.c_size_t),
        ("count_count", ctypes.c_size_t),
        ("payload_count", ctypes.c_size_t),
    ]


@dataclass(frozen=True)
class Taxels:
    """A taxel frame as decoded by the batch decoder: all fields but the board's CRC itself."""

    sequence: int
    payload_without_crc: bytes
    board_crc_ok: bool


@dataclass
class Batch:
    """Output of a batch decoder: taxel frames and all other frames (messages), each in order."""

    taxels: list[Taxels]
    messages: list[Frame]


class Codec:
    """The C codec: encode a frame, decode a stream that arrives in pieces, frame by frame or as a batch."""

    def __init__(self, path: Path) -> None:
        """Load the C codec library and check that its rows have the layout of `_Row`."""
        self.native = ctypes.CDLL(str(path))
        for name in ("struct_size", "row_size", "encode", "decode"):
            getattr(self.native, f"taxel_batch_{name}").restype = ctypes.c_size_t
        row_size = self.native.taxel_batch_row_size()
        assert row_size == ctypes.sizeof(_Row), (
            f"{path}: size of taxel_batch_row: expected {ctypes.sizeof(_Row)}, found {row_size}"
        )
        self._batch = ctypes.create_string_buffer(self.native.taxel_batch_struct_size())
        self._arrays = (
            (_Row * ROWS)(),
            (_Row * ROWS)(),
            (ctypes.c_uint16 * COUNTS)(),
            (ctypes.c_uint8 * PAYLOAD_BYTES)(),
        )
        self.discarded_bytes = 0
        self.unknown_frames = 0

    def encode(self, frame_type: int, sequence: int, payload: bytes) -> bytes:
        """Encode a frame with the C codec; return its bytes on the wire."""
        out = ctypes.create_string_buffer(1024)
        numbers = (ctypes.c_uint8(frame_type), ctypes.c_uint16(sequence))
        length = ctypes.c_uint16(len(payload))
        size = self.native.taxel_batch_encode(*numbers, payload, length, out, ctypes.c_size_t(len(out)))
        return out.raw[:size]

    def decode(self, pieces: Iterable[bytes], directions: int = 3) -> list[Frame]:
        """Decode a stream with the deframer that the hub and the batch decoder use; return its frames.

        directions: accepted frame types, 1: to the host, 2: to the hub, 3: both. Sets the counters of this object.
        """
        frames: list[Frame] = []

        def handle(_: Any, pointer: Any) -> None:
            frame = pointer.contents
            frames.append((frame.type, frame.sequence, bytes(frame.payload[: frame.length])))

        chunk = ctypes.create_string_buffer(2 * (ENCODED_MAX + 2))
        body = ctypes.create_string_buffer(BODY_MAX)
        memory = (ctypes.addressof(chunk), len(chunk), ctypes.addressof(body))
        config = _DeframerConfig(*memory, PAYLOAD_MAX, directions, _Handler(handle), None, _Handler())
        deframer = _Deframer()
        self.native.taxel_deframer_init(ctypes.byref(deframer), ctypes.byref(config))
        for piece in pieces:
            self.native.taxel_deframer_push(ctypes.byref(deframer), piece, ctypes.c_size_t(len(piece)))
        self.native.taxel_deframer_finish(ctypes.byref(deframer))
        self.discarded_bytes = deframer.discarded_bytes
        self.unknown_frames = deframer.unknown_frames
        return frames

    def decode_batch(self, pieces: Iterable[bytes], directions: int = 3, rows: int = ROWS) -> Batch:
        """Decode a stream with the batch decoder and a row capacity of `rows`, as often as the bytes need it."""
        batch = Batch([], [])
        self.native.taxel_batch_init(self._batch, ctypes.c_uint8(directions))
        for piece in pieces:
            taken = 0
            while taken < len(piece):
                remainder = piece[taken:]
                output = self._make_output(rows)
                taken += self.native.taxel_batch_decode(
                    self._batch, remainder, ctypes.c_size_t(len(remainder)), ctypes.byref(output)
                )
                self._collect(output, batch)
        output = self._make_output(rows)
        self.native.taxel_batch_finish(self._batch, ctypes.byref(output))
        self._collect(output, batch)
        return batch

    def _make_output(self, rows: int) -> _Output:
        """Return an empty output that refers to the arrays of this object and states a row capacity of `rows`."""
        taxel_rows, message_rows, counts, payloads = self._arrays
        return _Output(taxel_rows, message_rows, counts, payloads, rows, COUNTS, PAYLOAD_BYTES)

    def _collect(self, output: _Output, batch: Batch) -> None:
        """Append the decoded rows of a step to `batch`, and check that they do not exceed the stated capacity."""
        assert max(output.taxel_count, output.message_count) <= output.row_capacity, "rows beyond the caller's array"
        batch.taxels += [self._read_taxels(output, output.taxel_rows[i]) for i in range(output.taxel_count)]
        for i in range(output.message_count):
            row = output.message_rows[i]
            batch.messages.append((row.type, row.sequence, bytes(output.payloads[row.offset : row.offset + row.size])))

    @staticmethod
    def _read_taxels(output: _Output, row: _Row) -> Taxels:
        """Rebuild the payload of a taxel frame from its row and its counts."""
        head = {"address": row.address, "taxel_count": row.size, "cycle": row.cycle, "hub_time_us": row.hub_time_us}
        snapshot = {"sequence": row.board_sequence, "timestamp_us": row.board_time_us}
        counts = b"".join(n.to_bytes(2, "little") for n in output.counts[row.offset : row.offset + row.size])
        payload = TaxelHeader.build(head) + SnapshotHeader.build(snapshot) + counts
        return Taxels(row.sequence, payload, not row.flags & BOARD_CRC_BAD)

    @staticmethod
    def as_batch(frames: Iterable[Frame]) -> Batch:
        """Return the output that the batch decoder must give for these frames."""
        batch = Batch([], [])
        for frame_type, sequence, payload in frames:
            if frame_type == FrameType.TAXELS:
                crc = crc32(payload[TaxelHeader.sizeof() : -4], crc32(payload[:1]))
                is_correct = crc == int.from_bytes(payload[-4:], "little")
                batch.taxels.append(Taxels(sequence, payload[:-4], is_correct))
            elif (
                frame_type == FrameType.COMPACT_TAXELS
            ):  # tests send arbitrary bytes, so the board's CRC is wrong and there are no counts
                head = payload[:1] + b"\0" + payload[2:10] + bytes(4)
                batch.taxels.append(Taxels(sequence, head, False))
            else:
                batch.messages.append((frame_type, sequence, payload))
        return batch


def find_library() -> Path:
    """Return the path of the C codec library. Raises FileNotFoundError with instructions if it was not built."""
    path_from_environment = os.environ.get(LIBRARY_VARIABLE)
    if path_from_environment:
        return Path(path_from_environment)
    try:
        path = Path(str(importlib.resources.files("taxel") / "native" / "libtaxel_codec.so"))
    except ModuleNotFoundError:
        path = Path("taxel/native/libtaxel_codec.so")
    if not path.exists():
        raise FileNotFoundError(
            f"no C codec: {LIBRARY_VARIABLE} is not set and {path} does not exist;"
            " build firmware with CMake and set it, or install the package"
        )
    return path


@pytest.fixture(scope="session")
def codec_library_path() -> str:
    """Path of the C codec library; without it the test fails with instructions to build it."""
    try:
        return str(find_library())
    except FileNotFoundError as missing:
        pytest.fail(str(missing))


@pytest.fixture(scope="session")
def codec() -> Codec:
    """C codec of the built library."""
    try:
        return Codec(find_library())
    except (FileNotFoundError, OSError) as error:
        pytest.fail(str(error), pytrace=False)
